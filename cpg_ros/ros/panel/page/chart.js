// One canvas with axes, ticks and their units.

const style = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
const LABEL = 11;  // px from one label to the next
export const COLOURS = ['--a', '--b', '--c', '--d', '--e', '--f'];
export const colour = (k) => style(COLOURS[k % COLOURS.length]);

// Round numbers about a fifth of the span apart.
function ticks(low, high) {
  const rough = (high - low) / 4, power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10].find((one) => one * power >= rough) * power, out = [];
  for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; k++)
    out.push(+(k * step).toPrecision(6));
  return out;
}

export class Chart {
  constructor(id) {
    this.canvas = document.getElementById(id);
    this.context = this.canvas.getContext('2d');
  }

  // Height for a number of rows that each have a label.
  rows(count) {
    this.canvas.style.height = `max(11.75rem, ${(LABEL + 2) * count + 40}px)`;
  }

  get visible() {
    const box = this.canvas.getBoundingClientRect();
    return box.bottom > 0 && box.top < window.innerHeight && box.width > 0;
  }

  // Clear, and draw the axes: [low, high, label], ticks of y as [value, text] if they are names.
  begin([left, right, xLabel], [low, high, yLabel], names) {
    const { canvas, context } = this, scale = window.devicePixelRatio || 1;
    const [wide, high_] = [canvas.clientWidth, canvas.clientHeight];
    if (canvas.width !== Math.round(wide * scale) || canvas.height !== Math.round(high_ * scale)) {
      canvas.width = Math.round(wide * scale);
      canvas.height = Math.round(high_ * scale);
    }
    context.setTransform(scale, 0, 0, scale, 0, 0);
    context.clearRect(0, 0, wide, high_);
    context.font = '11px system-ui, "DejaVu Sans", sans-serif';
    const longest = names ? Math.max(20, ...names.map(([, text]) => context.measureText(text).width))
      : 26;
    Object.assign(this, { x0: longest + 26, x1: wide - 8, y0: high_ - 32, y1: 8,
      left, right, low, high });
    context.strokeStyle = style('--line');
    context.fillStyle = style('--soft');
    context.lineWidth = 1;
    const line = (a, b, c, d) => {
      context.beginPath();
      context.moveTo(a, b);
      context.lineTo(c, d);
      context.stroke();
    };
    context.textAlign = 'center';
    context.textBaseline = 'top';
    for (const tick of ticks(left, right)) {
      line(this.x(tick), this.y0, this.x(tick), this.y1);
      context.fillText(tick, this.x(tick), this.y0 + 4);
    }
    context.fillText(xLabel, (this.x0 + this.x1) / 2, this.y0 + 18);
    context.textAlign = 'right';
    context.textBaseline = 'middle';
    let above = Infinity;
    for (const [value, text] of names || ticks(low, high).map((one) => [one, one])) {
      if (!names) line(this.x0, this.y(value), this.x1, this.y(value));
      // One that would overlap with its neighbour is left out.
      if (Math.abs(this.y(value) - above) < LABEL) continue;
      above = this.y(value);
      context.fillText(text, this.x0 - 5, above);
    }
    context.save();
    context.translate(9, (this.y0 + this.y1) / 2);
    context.rotate(-Math.PI / 2);
    context.textAlign = 'center';
    context.fillText(yLabel, 0, 0);
    context.restore();
  }

  x(value) {
    return this.x0 + (this.x1 - this.x0) * (value - this.left) / (this.right - this.left);
  }

  y(value) {
    return this.y0 + (this.y1 - this.y0) * (value - this.low) / (this.high - this.low);
  }

  line(xs, ys, shade, width = 1.5) {
    const { context } = this;
    context.strokeStyle = shade;
    context.lineWidth = width;
    context.beginPath();
    let pen = false;
    for (let k = 0; k < xs.length; k++) {
      if (ys[k] == null || xs[k] == null) {
        pen = false;
        continue;
      }
      if (pen) context.lineTo(this.x(xs[k]), this.y(ys[k]));
      else context.moveTo(this.x(xs[k]), this.y(ys[k]));
      pen = true;
    }
    context.stroke();
  }

  box(x0, y0, x1, y1, shade) {
    this.context.fillStyle = shade;
    this.context.fillRect(this.x(x0), this.y(y1), Math.max(this.x(x1) - this.x(x0), 1),
      this.y(y0) - this.y(y1));
  }

  dot(x, y, shade, radius = 4) {
    this.context.fillStyle = shade;
    this.context.beginPath();
    this.context.arc(this.x(x), this.y(y), radius, 0, 2 * Math.PI);
    this.context.fill();
  }

  // What the lines are, in a row at the top.
  legend(entries) {
    const { context } = this;
    let x = this.x0 + 6;
    context.textAlign = 'left';
    context.textBaseline = 'middle';
    for (const [text, shade] of entries) {
      const wide = context.measureText(text).width;
      if (x + wide + 14 > this.x1) break;
      context.fillStyle = style('--card');
      context.fillRect(x - 2, this.y1 + 1, wide + 20, 14);
      context.fillStyle = shade;
      context.fillRect(x, this.y1 + 6, 10, 3);
      context.fillStyle = style('--ink');
      context.fillText(text, x + 14, this.y1 + 8);
      x += wide + 26;
    }
  }

  say(text) {
    const { context, canvas } = this;
    this.begin([0, 1, ''], [0, 1, ''], []);
    context.clearRect(0, 0, canvas.clientWidth, canvas.clientHeight);
    context.fillStyle = style('--soft');
    context.textAlign = 'center';
    context.textBaseline = 'middle';
    context.fillText(text, canvas.clientWidth / 2, canvas.clientHeight / 2);
  }
}

export const ink = style;

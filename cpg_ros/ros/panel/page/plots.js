// The plots of the last seconds, by uPlot: footfalls, and beside them the selected plot.
import uPlot from './uplot.min.js';

const SPAN = 5;  // s shown
const STANCE_FORCE = 5;  // a foot stands from this force on, N
const MAX_FRAMES = 400;  // frames that are stored
const MAX_GAP_RATIO = 1.7;  // times the median period of frames; after a longer gap some were missed
const MAX_LINE_FRACTION = 0.1;  // fraction of a stride that a straight line may stand for
const DEFAULT_STRIDE = 1;  // s; what speeds are averaged over where the stride rate is not known
const MAX_LARGE_ROWS = 8;  // rows with larger names
const FOOTFALL_WIDTH = 12;  // width of a footfall, px

const themeColour = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
const lineColour = (k) => themeColour(['--a', '--b', '--c', '--d', '--e', '--f'][k % 6]);
const short = (joint) => joint.replace(/_?joint$/, '');
const nonNull = (values) => values.filter((value) => value != null);
const paddedRange = (values, share, least) => {
  const low = Math.min(...values), high = Math.max(...values), rim = share * (high - low) + least;
  return [low - rim, high + rim];
};

// A figure with one plot, which is made anew when what it shows changes.
class Figure {
  constructor(id) {
    this.place = document.getElementById(id);
    new ResizeObserver(() => this.plot?.setSize(this.size)).observe(this.place);
  }

  get size() {
    const legend = this.place.querySelector('.u-legend')?.offsetHeight || 0;
    return { width: this.place.clientWidth, height: Math.max(80, this.place.clientHeight - legend) };
  }

  // Lines: [label, values, more of uPlot's series]; rows: names of the values 0, -1, ... of y.
  show({ times, lines, x = 'time from now [s]', y = '', rows, xRange, yRange, draw, message }) {
    const key = JSON.stringify([x, y, rows, message, lines?.map(([label]) => label)]);
    if (key !== this.key) {
      this.key = key;
      this.plot?.destroy();
      this.plot = null;
      this.place.textContent = message || '';
      this.place.classList.toggle('empty', !!message);
      if (!message) this.make(lines, x, y, rows);
    }
    if (message) return;
    this.drawHook = draw;
    this.plot.batch(() => {
      this.plot.setData([times, ...lines.map(([, values]) => values)], false);
      for (const [scale, [min, max]] of [['x', xRange || [-SPAN, 0]], ['y', yRange]])
        this.plot.setScale(scale, { min, max });
    });
  }

  make(lines, x, y, rows) {
    const axis = { stroke: () => themeColour('--soft'), font: '11px system-ui, sans-serif', labelGap: 0,
      labelFont: '11px system-ui, sans-serif', labelSize: 14, ticks: { show: false } };
    const grid = { stroke: () => themeColour('--line'), width: 1 };
    const longest = Math.max(0, ...(rows || []).map((row) => row.length));
    this.plot = new uPlot({ ...this.size, padding: [8, 8, 0, 0], cursor: { drag: { x: false, y: false } },
      legend: { show: lines.length > 0 && !rows },
      scales: { x: { time: false, auto: false }, y: { auto: false } },
      axes: [{ ...axis, grid, label: x, size: 22, space: 60 },
        { ...axis, grid, label: y || null, size: rows ? 12 + 6.5 * longest : 40, space: 24,
          ...rows?.length > MAX_LARGE_ROWS && { font: '8px system-ui, sans-serif' },
          ...rows && { splits: () => rows.map((_, k) => -k), values: () => rows } }],
      series: [{ label: x }, ...lines.map(([label, , more], k) => ({ label, width: 1.5,
        stroke: () => lineColour(k), points: { show: false },
        value: (_, value) => value == null ? '' : value.toFixed(2), ...more }))],
      // How high the legend is shows once the plot is as wide as its place.
      hooks: { ready: [(plot) => plot.setSize(this.size)], draw: [(plot) => this.drawHook?.(plot)] } },
    [[0], ...lines.map(() => [null])], this.place);
  }
}

export class Plots {
  constructor(view, changed) {
    Object.assign(this, { view, feet: new Figure('footfalls'), other: new Figure('selected-plot') });
    this.selects = Object.fromEntries(['plot', 'leg', 'portrait'].map((key) => {
      const select = document.getElementById(key);
      select.addEventListener('change', () => {
        view[key] = select.value;
        changed();
        this.draw();
      });
      return [key, select];
    }));
    if (view.plot) this.selects.plot.value = view.plot;
    this.clear();
  }

  clear() {
    Object.assign(this, { frames: [], stride: DEFAULT_STRIDE, names: {}, shape: null, states: [], cellCount: 0 });
  }

  // The stride rate, Hz, of the gait.
  setFrequency(frequency) {
    this.stride = frequency > 0 ? Math.min(1 / frequency, SPAN) : DEFAULT_STRIDE;
  }

  setNames(names) {
    this.names = names;
    const [states, cells] = (names.cells || ['', '']).map((text) => text.split(':'));
    this.cellCount = +cells[1] || 0;
    this.states = states[0].split(',');
    this.fill('portrait', Array.from({ length: this.cellCount }, (_, k) => `cell ${k + 1}`));
    this.fill('leg', [...new Set(this.legs())]);
  }

  setShape(shape) {
    this.shape = shape;
    this.fill('leg', [...new Set(this.legs())]);
  }

  fill(key, words) {
    this.selects[key].replaceChildren(...words.map((word) => new Option(word, word)));
    if (words.includes(this.view[key])) this.selects[key].value = this.view[key];
  }

  // Leg of each joint: the foot whose chain of links it is in.
  legs() {
    const { shape, names } = this, of = {};
    for (const [leg, [foot]] of Object.entries(shape?.feet || {}))
      for (let k = foot; k >= 0; k = shape.links[k].parent) of[shape.links[k].joint] ??= leg;
    return (names.joints || []).map((joint) => of[joint] || 'all');
  }

  add(frame) {
    const last = this.frames.at(-1), now = { ...last, ...frame };
    if (last && now.time < last.time) this.frames = [];
    now.fresh = frame.cells !== undefined;
    if (now.time === undefined) now.time = performance.now() / 1000;
    this.frames.push(now);
    if (this.frames.length > MAX_FRAMES) this.frames.splice(0, this.frames.length - MAX_FRAMES);
  }

  // Speed forward and to the left, m/s, and yaw rate, rad/s: means over the stride before a time.
  speed(time = this.frames.at(-1)?.time) {
    const own = this.frames.filter((frame) =>
      frame.speed && frame.time >= time - this.stride && frame.time <= time);
    return [0, 1, 2].map((k) => {
      const values = nonNull(own.map((frame) => frame.speed[k]));
      return values.length ? values.reduce((sum, value) => sum + value) / values.length : null;
    });
  }

  draw() {
    const end = this.frames.at(-1)?.time, { plot } = this.selects;
    for (const key of ['leg', 'portrait']) this.selects[key].hidden = {
      leg: plot.value !== 'angles', portrait: plot.value !== 'phase' }[key];
    if (end === undefined) return;
    const shown = this.frames.filter((frame) => frame.time > end - SPAN);
    const times = shown.map((frame) => frame.time - end);
    this.feet.show({ times, ...this.footfalls(shown) });
    this.other.show({ times, ...this[plot.value](shown) });
  }

  footfalls(shown) {
    const hasForces = shown.at(-1).forces, rows = hasForces ? this.names.forces : this.names.phases;
    if (!rows) return { message: 'neither foot_contacts nor phases are published' };
    const inStance = (frame, k) => hasForces ? frame.forces?.[k] > STANCE_FORCE : frame.phases?.[k] < 0.5;
    return { rows, yRange: [0.5 - rows.length, 0.5], y: hasForces ? '' : 'first half of each cycle',
      lines: rows.map((leg, k) => [leg, shown.map((frame) => inStance(frame, k) ? -k : null),
        { width: FOOTFALL_WIDTH }]) };
  }

  // A cell's second variable against its first, with a gap where frames were missed.
  path(shown, cell) {
    const own = shown.filter((frame) => frame.fresh);
    const gaps = own.map((frame, j) => j ? frame.time - own[j - 1].time : 0);
    const most = Math.min(MAX_GAP_RATIO * [...gaps].sort((a, b) => a - b)[own.length >> 1],
      MAX_LINE_FRACTION * this.stride);
    return own.flatMap(({ cells }, j) => {
      const at = [cells[cell], cells[this.cellCount + cell]];
      return gaps[j] > most ? [null, at] : [at];
    });
  }

  phase(shown) {
    const points = this.path(shown, this.selects.portrait.selectedIndex), all = nonNull(points);
    if (!all.length || !shown.at(-1).cells) return { message: 'the generator does not publish ~/cells' };
    const [x, y] = this.states, unit = y.startsWith('d') ? '1/model time' : '1';
    return { x: `${x} [1]`, y: `${y} [${unit}]`, lines: [], times: [0],
      xRange: paddedRange(all.map(([a]) => a), 0.08, 1e-3), yRange: paddedRange(all.map(([, b]) => b), 0.08, 1e-3),
      draw: ({ ctx, valToPos }) => {
        const at = ([a, b]) => [valToPos(a, 'x', true), valToPos(b, 'y', true)];
        ctx.save();
        ctx.strokeStyle = lineColour(0);
        ctx.lineWidth = 1.5 * devicePixelRatio;
        ctx.beginPath();
        points.forEach((point, k) => point && (points[k - 1] ? ctx.lineTo(...at(point))
          : ctx.moveTo(...at(point))));
        ctx.stroke();
        ctx.fillStyle = lineColour(1);
        ctx.beginPath();
        ctx.arc(...at(all.at(-1)), 4 * devicePixelRatio, 0, 2 * Math.PI);
        ctx.fill();
        ctx.restore();
      } };
  }

  cells(shown) {
    const count = this.cellCount;
    if (!shown.at(-1).cells) return { message: 'the generator does not publish ~/cells' };
    const rows = Array.from({ length: count }, (_, k) => `${k + 1}`);
    const of = (k) => shown.map((frame) => frame.cells?.[k]);
    const largest = Math.max(1e-6, ...nonNull(rows.flatMap((_, k) => of(k))).map(Math.abs));
    return { rows, y: 'cell', yRange: [0.3 - count, 0.7], lines: rows.map((row, k) => [row,
      of(k).map((value) => value == null ? null : 0.48 * value / largest - k)]) };
  }

  angles(shown) {
    const legs = this.legs(), { joints } = this.names, leg = this.selects.leg.value || 'all';
    const indices = Object.keys(legs).filter((k) => legs[k] === leg);
    if (!indices.length || !shown.at(-1).angles) return { message: 'no joint states received' };
    const lines = indices.map((k) => [short(joints[k]), shown.map((frame) => frame.angles?.[k])]);
    const yRange = paddedRange(nonNull(lines.flatMap(([, row]) => row)), 0.12, 0.02);
    const limits = indices.flatMap((k) => this.shape?.limits[joints[k]] || []);
    return { y: 'angle [rad]', yRange, lines: [...lines, ...nonNull(limits)
      .filter((limit) => limit > yRange[0] && limit < yRange[1]).map((limit) => [`limit ${limit.toFixed(2)}`,
        shown.map(() => limit), { class: 'limit', stroke: () => themeColour('--danger'), dash: [4, 4], width: 1 }])] };
  }

  // The range of each joint in the last seconds within its limits, and where it is.
  limits(shown) {
    const { joints } = this.names, { angles } = shown.at(-1);
    if (!joints || !angles) return { message: 'no joint states received' };
    const legs = Object.keys(this.shape?.feet || {}), of = this.legs();
    const spans = joints.map((joint) => this.shape?.limits[joint] || [null, null]);
    const xRange = paddedRange(nonNull([...spans.flat(), ...angles]), 0, 0.1);
    return { rows: joints.map(short), x: 'angle [rad]', lines: [], times: [0], xRange,
      yRange: [0.4 - joints.length, 0.6], draw: ({ ctx, valToPos }) => joints.forEach((_, k) => {
        const [low, high] = spans[k], y = valToPos(-k, 'y', true), at = angles[k];
        const bar = (from, to, half, shade) => {
          const left = valToPos(from, 'x', true);
          ctx.save();
          ctx.fillStyle = shade;
          ctx.fillRect(left, y - half * devicePixelRatio, Math.max(1, valToPos(to, 'x', true) - left),
            2 * half * devicePixelRatio);
          ctx.restore();
        };
        const past = nonNull(shown.map((frame) => frame.angles?.[k]));
        const atLimit = (low != null && at < low + 0.02) || (high != null && at > high - 0.02);
        bar(low ?? xRange[0], high ?? xRange[1], 1.5, themeColour('--line'));
        if (!past.length) return;
        bar(Math.min(...past), Math.max(...past), 3, lineColour(Math.max(legs.indexOf(of[k]), 0)));
        bar(at - 0.01, at + 0.01, 5, atLimit ? themeColour('--danger') : themeColour('--ink'));
      }) };
  }

  speeds(shown) {
    if (!shown.at(-1).speed) return { message: 'no node publishes odom' };
    const averages = shown.map((frame) => this.speed(frame.time));
    const lines = ['forward', 'to the left'].map((label, k) =>
      [label, averages.map((speed) => speed[k])]);
    const values = nonNull(lines.flatMap(([, row]) => row));
    return { lines, y: 'speed [m/s]', yRange: [Math.min(-0.2, ...values), 0.1 + Math.max(1, ...values)] };
  }
}

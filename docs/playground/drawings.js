// Copyright 2026 cpg_ros maintainers
// SPDX-License-Identifier: Apache-2.0
//
// What the page draws, from the simulation, the walker and the traces of playground.js.
'use strict';

function canvas(id) {
  const element = $(id);
  const ratio = window.devicePixelRatio || 1;
  const [width, height] = [element.clientWidth, element.clientHeight];
  if (element.width !== Math.round(width * ratio) || element.height !== Math.round(height * ratio)) {
    element.width = Math.round(width * ratio);
    element.height = Math.round(height * ratio);
  }
  const context = element.getContext('2d');
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.clearRect(0, 0, width, height);
  context.lineJoin = context.lineCap = 'round';
  context.font = '12px system-ui, sans-serif';
  return [context, width, height];
}

function line(context, points, stroke, width = 1.5) {
  context.strokeStyle = stroke;
  context.lineWidth = width;
  context.beginPath();
  points.forEach(([x, y], n) => (n ? context.lineTo(x, y) : context.moveTo(x, y)));
  context.stroke();
}

// The cells that joints follow, one for each leg.
const legCells = () => Object.entries(simulation.network.legs);

function drawCells(colours) {
  const [context, width, height] = canvas('cells');
  const {times, cells} = traces;
  const shown = legCells();
  const all = shown.flatMap(([, cell]) => cells[cell]);
  const [low, high] = [Math.min(...all, 0), Math.max(...all, 0)];
  const [first, final] = [times[0], times.at(-1)];
  shown.forEach(([, cell], n) => line(context, times.map((time, k) => [
    width * (time - first) / (final - first || 1),
    height - 6 - (height - 12) * (cells[cell][k] - low) / (high - low || 1)]), colours[n % 4]));
}

function drawPortrait(colours, soft) {
  const [context, width, height] = canvas('portrait');
  const [xs, ys] = [traces.cells[0], traces.rates];
  const [left, right] = [Math.min(...xs), Math.max(...xs)];
  const [low, high] = [Math.min(...ys), Math.max(...ys)];
  const toPixels = (k) => [10 + (width - 20) * (xs[k] - left) / (right - left || 1),
                        height - 10 - (height - 32) * (ys[k] - low) / (high - low || 1)];
  line(context, xs.map((_, k) => toPixels(k)), colours[0]);
  context.fillStyle = soft;
  const {states} = simulation.network;
  context.fillText(`cell 1: ${states[0]} across, ${states[1] || `d${states[0]}/dt`} up`, 6, 14);
  if (xs.length) {
    context.beginPath();
    context.arc(...toPixels(xs.length - 1), 4, 0, 7);
    context.fillStyle = colours[1];
    context.fill();
  }
}

function drawFeet(colours, soft) {
  const [context, width, height] = canvas('feet');
  const legs = legCells();
  const row = height / legs.length;
  const step = (width - 40) / 700;
  legs.forEach(([leg], n) => {
    context.fillStyle = soft;
    context.fillText(leg, 2, (n + 0.5) * row + 4);
    context.fillStyle = colours[n % 4];
    const {feet} = traces;
    for (let k = 0; k < feet.length;) {
      let end = k;
      while (end < feet.length && feet[end][leg] === feet[k][leg]) { end++; }
      if (feet[k][leg]) {
        context.fillRect(40 + k * step, n * row + 3, (end - k) * step, row - 6);
      }
      k = end;
    }
  });
}

function drawRobot(colours, soft, ink) {
  const [context, width, height] = canvas('robot');
  const {points, lowest} = walker.move(simulation.time);
  const scale = height / 0.62;
  const ground = height - 18;
  const body = ground + lowest * scale;
  const mid = width / 2;
  const hip = (leg) => {
    const fore = /f$|^f/i.test(leg) && leg.length <= 3;
    const far = /^r/i.test(leg);
    const offset = legCells().length > 2 ? (fore ? 0.22 : -0.22) : 0;
    return [mid + (offset + (far ? 0.02 : 0)) * scale, body, far];
  };
  context.strokeStyle = soft;
  const shift = (walker.distance * scale) % 40;
  line(context, [[0, ground], [width, ground]], soft, 1);
  for (let x = -shift - 40; x < width + 40; x += 40) {
    line(context, [[x, ground], [x - 8, ground + 8]], soft, 1);
  }
  legCells().forEach(([leg], n) => {
    const [x, y, far] = hip(leg);
    context.globalAlpha = far ? 0.55 : 1;
    line(context, points[leg].map(([dx, dz]) => [x + dx * scale, y - dz * scale]),
         colours[n % 4], far ? 4 : 6);
    context.globalAlpha = 1;
  });
  if (legCells().length > 2) {
    line(context, [[mid - 0.24 * scale, body], [mid + 0.26 * scale, body]], ink, 8);
  } else {
    line(context, [[mid, body], [mid, body - 0.16 * scale]], ink, 8);
  }
  context.fillStyle = soft;
  context.fillText(walker.hipless ? 'in place: the robot file has no hips'
    : `${walker.distance.toFixed(2)} m with links of ${UPPER} m`, 6, 14);
}

function nameCells() {
  $('names').replaceChildren(...legCells().map(([leg], n) => Object.assign(
    document.createElement('span'), {textContent: ` ${leg}`,
                                     style: `color:${theme.colours[n % 4]}`})));
}

function draw() {
  const {colours, soft, ink} = theme;
  drawCells(colours);
  drawPortrait(colours, soft);
  drawFeet(colours, soft);
  drawRobot(colours, soft, ink);
}

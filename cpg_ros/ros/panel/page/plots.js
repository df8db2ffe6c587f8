// The plots: footfalls, portrait, cells, angles, limits, speed; of the last seconds.
import { Chart, colour, ink } from './chart.js';

const SPAN = 5;      // s shown
const STANDS = 5;    // a foot stands from this force on, N
const KEPT = 400;    // frames
const USUAL = 1.7;   // times the usual time between two frames; after more, some were missed
const CHORD = 0.1;   // fraction of a stride that a straight line may stand for
const STRIDE = 1;    // s; what speeds are averaged over where the stride rate is not known

export class Plots {
  constructor(view, changed) {
    this.view = view;
    this.charts = Object.fromEntries(['footfalls', 'phase', 'cells', 'angles', 'limits', 'speeds']
      .map((id) => [id, new Chart(id)]));
    this.leg = document.getElementById('leg');
    this.portrait = document.getElementById('portrait');
    for (const [select, key] of [[this.leg, 'leg'], [this.portrait, 'portrait']])
      select.addEventListener('change', () => {
        view[key] = select.value;
        changed();
      });
    this.clear();
  }

  clear() {
    this.frames = [];
    this.stride = STRIDE;
    this.names = {};
    this.shape = null;
  }

  // The stride rate, Hz, of the gait.
  paced(frequency) {
    this.stride = frequency > 0 ? Math.min(1 / frequency, SPAN) : STRIDE;
  }

  named(names) {
    this.names = names;
    const [states, cells] = (names.cells || ['', '']).map((text) => text.split(':'));
    this.cellCount = +cells[1] || 0;
    this.states = states[0].split(',');
    // A cell's second variable against its first; of cells that have but one, its rate.
    this.cellNames = Array.from({ length: this.cellCount }, (_, k) => `cell ${k + 1}`);
    this.fill(this.portrait, this.cellNames, 'portrait');
    this.fill(this.leg, [...new Set(this.legs())], 'leg');
  }

  shaped(shape) {
    this.shape = shape;
    this.fill(this.leg, [...new Set(this.legs())], 'leg');
  }

  fill(select, words, key) {
    select.replaceChildren(...words.map((word) => new Option(word, word)));
    if (words.includes(this.view[key])) select.value = this.view[key];
  }

  // Leg of each joint: the foot whose chain of links it is in.
  legs() {
    const { shape, names } = this, of = {};
    for (const [leg, [foot]] of Object.entries(shape?.feet || {}))
      for (let k = foot; k >= 0; k = shape.links[k].parent) of[shape.links[k].joint] ??= leg;
    return (names.joints || []).map((joint) => of[joint] || 'all');
  }

  take(frame) {
    const last = this.frames.at(-1);
    const now = { ...last, ...frame };
    if (last && now.time < last.time) this.frames = [];
    now.fresh = frame.cells !== undefined;
    if (now.time === undefined) now.time = performance.now() / 1000;
    this.frames.push(now);
    if (this.frames.length > KEPT) this.frames.splice(0, this.frames.length - KEPT);
  }

  // A component of the speed at each of some frames, averaged over the stride before it.
  averages(shown, k) {
    let from = 0, sum = 0, count = 0;
    return shown.map((frame) => {
      const value = frame.speed?.[k];
      if (value != null) {
        sum += value;
        count++;
      }
      for (; shown[from].time < frame.time - this.stride; from++)
        if (shown[from].speed?.[k] != null) {
          sum -= shown[from].speed[k];
          count--;
        }
      return count ? sum / count : null;
    });
  }

  // The averages at the newest frame: forward and to the left, m/s, and turning, rad/s.
  speed() {
    const end = this.frames.at(-1)?.time;
    const stride = this.frames.filter((frame) => frame.time >= end - this.stride);
    return [0, 1, 2].map((k) => this.averages(stride, k).at(-1));
  }

  draw() {
    const end = this.frames.at(-1)?.time;
    if (end === undefined) return;
    const shown = this.frames.filter((frame) => frame.time > end - SPAN);
    const times = shown.map((frame) => frame.time - end), axis = [-SPAN, 0, 'time from now [s]'];
    for (const [name, chart] of Object.entries(this.charts))
      if (chart.visible) this[name](chart, shown, times, axis);
  }

  footfalls(chart, shown, times, axis) {
    const felt = shown.at(-1).forces, legs = felt ? this.names.forces : this.names.phases;
    if (!legs) return chart.say('neither foot_contacts nor phases are published');
    const down = (frame, k) => felt ? frame.forces?.[k] > STANDS : frame.phases?.[k] < 0.5;
    const rows = legs.length;
    chart.begin(axis, [-0.5, rows - 0.5, ''], legs.map((leg, k) => [rows - 1 - k, leg]));
    legs.forEach((_, k) => {
      let from = null;
      shown.forEach((frame, j) => {
        if (down(frame, k)) from ??= j ? times[j - 1] : times[0];
        else if (from !== null) {
          chart.box(from, rows - 1.35 - k, times[j - 1], rows - 0.65 - k, colour(k));
          from = null;
        }
      });
      if (from !== null) chart.box(from, rows - 1.35 - k, 0, rows - 0.65 - k, colour(k));
    });
    if (!felt) chart.legend([['first half of each leg\'s cycle', ink('--soft')]]);
  }

  phase(chart, shown) {
    const cell = this.cellNames?.indexOf(this.portrait.value) ?? -1;
    if (cell < 0 || !shown.at(-1).cells) return chart.say('the generator does not publish ~/cells');
    const [x, y] = this.states;
    const own = shown.filter((frame) => frame.fresh);
    // Where frames were missed the line is broken: it would be a chord.
    const gaps = own.map((frame, j) => j ? frame.time - own[j - 1].time : 0);
    const most = Math.min(USUAL * [...gaps].sort((a, b) => a - b)[own.length >> 1],
      CHORD * this.stride);
    const points = own.flatMap(({ cells }, j) => gaps[j] > most ? [null, cells] : [cells]);
    const [xs, ys] = [cell, this.cellCount + cell].map((k) => points.map((row) => row?.[k]));
    const span = (values) => {
      const known = values.filter((value) => value != null);
      const low = Math.min(...known), high = Math.max(...known), rim = 0.08 * (high - low) + 1e-3;
      return [low - rim, high + rim];
    };
    const unit = y.startsWith('d') ? '1/model time' : '1';
    chart.begin([...span(xs), `${x} [1]`], [...span(ys), `${y} [${unit}]`]);
    chart.line(xs, ys, colour(0), 1);
    xs.forEach((x0, j) => x0 != null && chart.dot(x0, ys[j], colour(0), 1));
    chart.dot(xs.at(-1), ys.at(-1), colour(1));
  }

  cells(chart, shown, times, axis) {
    if (!shown.at(-1).cells) return chart.say('the generator does not publish ~/cells');
    const count = this.cellCount, values = shown.map((frame) => frame.cells || []);
    let largest = 1e-6;
    for (const row of values)
      for (let k = 0; k < count; k++) largest = Math.max(largest, Math.abs(row[k] || 0));
    chart.begin(axis, [-0.7, count - 0.3, 'cell'], Array.from({ length: count }, (_, k) =>
      [count - 1 - k, `${k + 1}`]));
    for (let k = 0; k < count; k++)
      chart.line(times, values.map((row) => row[k] == null ? null
        : count - 1 - k + 0.48 * row[k] / largest), colour(k));
  }

  angles(chart, shown, times, axis) {
    const legs = this.legs(), { joints } = this.names;
    const chosen = legs.map((leg, k) => leg === (this.leg.value || 'all') ? k : -1)
      .filter((k) => k >= 0);
    if (!chosen.length || !shown.at(-1).angles) return chart.say('no joint states received');
    const rows = chosen.map((k) => shown.map((frame) => frame.angles?.[k]));
    const known = rows.flat().filter((value) => value != null);
    const low = Math.min(...known), high = Math.max(...known), rim = 0.12 * (high - low) + 0.02;
    chart.begin(axis, [low - rim, high + 2.5 * rim, 'angle [rad]']);
    rows.forEach((row, k) => {
      chart.line(times, row, colour(k));
      for (const limit of this.shape?.limits[joints[chosen[k]]] || [])
        if (limit != null && limit > low - rim && limit < high + rim) {
          chart.context.setLineDash([4, 4]);
          chart.line([-SPAN, 0], [limit, limit], ink('--danger'), 1);
          chart.context.setLineDash([]);
        }
    });
    chart.legend([...chosen.map((j, k) => [joints[j].replace(/_?joint$/, ''), colour(k)]),
      ['limits', ink('--danger')]]);
    return undefined;
  }

  limits(chart, shown) {
    const { joints } = this.names, angles = shown.at(-1).angles;
    if (!joints || !angles) return chart.say('no joint states received');
    chart.rows(joints.length);
    const rows = joints.length, of = this.legs(), legs = Object.keys(this.shape?.feet || {});
    const spans = joints.map((joint) => this.shape?.limits[joint] || [null, null]);
    const ends = [...spans.flat(), ...angles].filter((value) => value != null);
    chart.begin([Math.min(...ends) - 0.1, Math.max(...ends) + 0.1, 'angle [rad]'],
      [-0.6, rows - 0.4, ''], joints.map((joint, k) => [rows - 1 - k, joint.replace(/_?joint$/, '')]));
    joints.forEach((_, k) => {
      const [low, high] = spans[k], y = rows - 1 - k;
      chart.box(low ?? chart.left, y - 0.12, high ?? chart.right, y + 0.12, ink('--line'));
      let [least, most] = [Infinity, -Infinity];
      for (const { angles: one } of shown) {
        if (one?.[k] == null) continue;
        least = Math.min(least, one[k]);
        most = Math.max(most, one[k]);
      }
      const shade = colour(Math.max(legs.indexOf(of[k]), 0));
      if (most >= least) chart.box(least, y - 0.22, most, y + 0.22, shade);
      const tight = (low != null && angles[k] < low + 0.02) || (high != null && angles[k] > high - 0.02);
      if (angles[k] != null) chart.dot(angles[k], y, tight ? ink('--danger') : ink('--ink'), 3);
    });
    return undefined;
  }

  speeds(chart, shown, times, axis) {
    if (!shown.at(-1).speed) return chart.say('no node publishes odom');
    const rows = [0, 1].map((k) => this.averages(shown, k));
    const known = rows.flat().filter((value) => value != null);
    chart.begin(axis, [Math.min(-0.2, ...known), 0.1 + Math.max(1, ...known), 'speed [m/s]']);
    rows.forEach((row, k) => chart.line(times, row, colour(k)));
    chart.legend([['forward', colour(0)], ['to the left', colour(1)]]);
    return undefined;
  }
}

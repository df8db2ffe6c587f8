// Copyright 2026 cpg_ros maintainers
// SPDX-License-Identifier: Apache-2.0
//
// The page: controls, the link that holds their state, drawings, and the verdict on the gait.
'use strict';

const $ = (id) => document.getElementById(id);
const state = {network: '', gait: '', speed: 1, paused: false, moved: '', changed: {}};
let simulation, walker, traces;
let pendingTime = 0, last = 0, frames = [], searchCount = 0, verdictTime = 0, drawingTime = 0;
const COLOURS = ['--a', '--b', '--c', '--d'];
// Read when the theme changes, not in each frame.
let theme = {};
const dark = matchMedia('(prefers-color-scheme: dark)');
function readTheme() {
  const style = getComputedStyle(document.documentElement);
  const colour = (name) => style.getPropertyValue(name).trim();
  theme = {colours: COLOURS.map(colour), soft: colour('--soft'), ink: colour('--ink')};
}
const short = (value) => Number(value.toPrecision(6)).toString();

// -- what is run ---------------------------------------------------------------------------------

function start() {
  const network = NETWORKS[state.network];
  const gait = network.gaits[state.gait];
  simulation = new Simulation(network, gait);
  walker = new Walker(network, gait);
  for (const [name, value] of Object.entries(state.changed)) { simulation.set(name, value); }
  traces = {times: [], cells: Array.from({length: network.cells}, () => []), rates: [], feet: []};
  pendingTime = 0;
  $('threshold-result').textContent = '';
  document.documentElement.dataset.ready = 'yes';
}

function advance(seconds) {
  const {gait} = simulation;
  pendingTime += Math.min(seconds, 0.1) * state.speed * gait.period;
  const sampleInterval = Math.max(1, Math.round(gait.period / simulation.h / 160));
  while (pendingTime >= simulation.h) {
    simulation.step();
    walker.observe(simulation);
    pendingTime -= simulation.h;
    if (Math.round(simulation.time / simulation.h) % sampleInterval) { continue; }
    traces.times.push(simulation.time);
    traces.cells.forEach((trace, cell) => trace.push(simulation.value(cell)));
    traces.rates.push(simulation.network.states.length > 1
      ? simulation.value(simulation.cells) : simulation.rate(0));
    walker.move(simulation.time);
    traces.feet.push({...walker.stance});
    if (traces.times.length > 700) {
      [traces.times, traces.rates, traces.feet, ...traces.cells].forEach((one) => one.shift());
    }
  }
}

function verdict() {
  const {gait} = simulation;
  const nominal = gait.range[gait.waves[0]];
  const strides = walker.crossings[0].length - 1;
  const ratio = walker.swing[0] / nominal;
  const since = simulation.time - (walker.crossings[0].at(-1) || 0);
  const period = walker.period();
  let [text, kind] = ['', ''];
  if (![0, 1].every((i) => Number.isFinite(simulation.value(i)))) {
    [text, kind] = ['no gait here: the state grew beyond all numbers', 'bad'];
  } else if (ratio < 0.02 || (ratio < 0.2 && since > 3 * gait.period)) {
    text = `no gait here: cell 1 swings by ${short(100 * ratio)} % of what it does in the preset `
      + '(looked at: its last one and a half strides)';
    kind = 'bad';
  } else if (strides < 3) {
    text = 'running in: fewer than three strides';
  } else if (Math.abs(walker.change) > 0.02) {
    text = `settling: cell 1 swings by ${Math.round(100 * ratio)} % of what it does in the preset, `
      + `${short(100 * walker.change)} % more than one and a half strides before`;
  } else {
    const legs = walker.legs(simulation.time);
    const phaseError = Math.max(...legs.map((phase, n) => {
      const difference = Math.abs(phase - (((gait.legs[n] - gait.legs[0]) % 1) + 1) % 1) % 1;
      return Math.min(difference, 1 - difference);
    }));
    const steady = Math.abs(walker.crossings[0].at(-2) - walker.crossings[0].at(-3) - period) / period;
    const names = Object.keys(simulation.network.legs);
    text = `${phaseError < 0.05 ? state.gait : `not ${state.gait}`}: period ${short(period)}, legs `
      + `${names.map((leg, n) => `${leg} ${legs[n].toFixed(2)}`).join(', ')}; swing `
      + `${Math.round(100 * ratio)} % of the preset's, the last two strides differ by `
      + `${Number((100 * steady).toPrecision(2))} % (looked at: ${strides} strides`
      + `${gait.gain ? ", within the gait's symmetry" : ''})`;
    kind = phaseError < 0.05 ? 'good' : 'bad';
  }
  $('verdict').textContent = text;
  $('verdict').className = kind;
}

// Halves the way from where the gait runs to where it does not, one run a time, between frames.
function threshold() {
  const name = state.moved;
  const range = simulation.network.ranges[name];
  const origin = simulation.clone();
  const current = origin.values[name];
  const [low, high] = sliderRange(name);
  const search = ++searchCount;
  const strides = 40;
  const ends = [low, high].map((end) => ({end, present: current, absent: null, bisections: 14}));
  const report = () => {
    const lines = ends.map((one) => (one.absent === null ? `up to ${short(one.present)} it runs on`
      : `it ends between ${short(one.present)} and ${short(one.absent)}`));
    $('threshold-result').textContent = `${name} from ${short(low)} to ${short(high)}: ${lines.join('; ')}. `
      + `Looked at: ${strides} strides a run from the present state`
      + `${origin.gait.gain ? ", within the gait's symmetry" : ''}; it ends at a Hopf point or a `
      + 'fold of orbits.';
    $('threshold-result').dataset.ends = JSON.stringify(ends);
  };
  const next = () => {
    const one = ends.find((end) => end.bisections > 0);
    if (search !== searchCount || !one) {
      if (search === searchCount) { $('threshold-result').dataset.done = 'yes'; }
      return;
    }
    const value = one.absent === null ? one.end : 0.5 * (one.present + one.absent);
    if (value === current) {
      one.bisections = 0;
    } else if (persists(origin, name, value, strides)) {
      one.present = value;
      one.bisections = one.absent === null ? 0 : one.bisections - 1;
    } else {
      one.absent = value;
      one.bisections--;
    }
    report();
    setTimeout(next, 0);
  };
  delete $('threshold-result').dataset.done;
  if (range) { next(); }
}

// -- controls and link ---------------------------------------------------------------------------

function sliderRange(name) {
  const [low, high] = simulation.network.ranges[name];
  const value = simulation.gait.values[name];
  const half = Math.max(1.5 * Math.abs(value), 0.02 * (high - low));
  return [Math.max(low, value - half), Math.min(high, value + half)];
}

function controls() {
  const box = $('parameters');
  box.replaceChildren();
  for (const [name, [low, high, text]] of Object.entries(simulation.network.ranges)) {
    const [from, to] = sliderRange(name);
    const row = document.createElement('label');
    row.className = 'parameter';
    const slider = Object.assign(document.createElement('input'), {
      type: 'range', min: from, max: to, step: (to - from) / 1000, value: simulation.values[name]});
    const field = Object.assign(document.createElement('input'), {
      type: 'number', min: low, max: high, step: 'any', value: short(simulation.values[name])});
    slider.setAttribute('aria-label', name);
    slider.dataset.name = name;
    const change = (value) => {
      if (!(value >= low && value <= high)) { return; }
      simulation.set(name, value);
      state.changed[name] = value;
      state.moved = name;
      $('last').textContent = name;
      searchCount++;
      save();
    };
    slider.oninput = () => { change(Number(slider.value)); field.value = short(Number(slider.value)); };
    field.onchange = () => { change(Number(field.value)); slider.value = field.value; };
    const label = Object.assign(document.createElement('span'), {textContent: name});
    row.append(label, slider, field,
               Object.assign(document.createElement('small'), {textContent: text}));
    box.append(row);
  }
  state.moved = simulation.network.ranges[state.moved] ? state.moved
    : Object.keys(simulation.network.ranges)[0];
  $('last').textContent = state.moved;
}

function options(select, names, selected) {
  select.replaceChildren(...names.map((name) => new Option(name, name, false, name === selected)));
}

function save() {
  const query = new URLSearchParams({network: state.network, gait: state.gait, speed: state.speed});
  for (const [name, value] of Object.entries(state.changed)) { query.set(`p.${name}`, value); }
  history.replaceState(null, '', `#${query}`);
}

// Whatever of a link is not known is left out.
function load() {
  const query = new URLSearchParams(location.hash.slice(1));
  state.network = NETWORKS[query.get('network')] ? query.get('network') : Object.keys(NETWORKS)[0];
  const network = NETWORKS[state.network];
  state.gait = network.gaits[query.get('gait')] ? query.get('gait') : network.usual;
  if (!network.gaits[state.gait]) { state.gait = Object.keys(network.gaits)[0]; }
  const speed = Number(query.get('speed'));
  state.speed = speed > 0 && speed <= 3 ? speed : 1;
  state.changed = {};
  for (const [name, [low, high]] of Object.entries(network.ranges)) {
    const value = query.has(`p.${name}`) ? Number(query.get(`p.${name}`)) : NaN;
    if (value >= low && value <= high) { state.changed[name] = value; }
  }
  show();
}

function show() {
  options($('network'), Object.keys(NETWORKS), state.network);
  options($('gait'), Object.keys(NETWORKS[state.network].gaits), state.gait);
  $('speed').value = state.speed;
  start();
  controls();
  nameCells();
}

function choose(network, gait) {
  Object.assign(state, {network, gait, changed: {}});
  if (!NETWORKS[network].gaits[gait]) {
    const {usual, gaits} = NETWORKS[network];
    state.gait = gaits[usual] ? usual : Object.keys(gaits)[0];
  }
  show();
  save();
}

$('network').onchange = () => choose($('network').value, '');
$('gait').onchange = () => choose(state.network, $('gait').value);
$('speed').oninput = () => { state.speed = Number($('speed').value); save(); };
$('reset').onclick = () => choose(state.network, state.gait);
$('threshold').onclick = threshold;
$('pause').onclick = () => {
  state.paused = !state.paused;
  $('pause').textContent = state.paused ? 'run' : 'pause';
};
$('link').onclick = () => {
  save();
  if (navigator.clipboard) { navigator.clipboard.writeText(location.href).catch(() => {}); }
};
window.onhashchange = load;

function frame(now) {
  const began = performance.now();
  const seconds = (now - (last || now)) / 1000;
  last = now;
  if (!state.paused) { advance(seconds); }
  if (traces.times.length > 1) { draw(); }
  if (now - verdictTime > 250) {
    verdictTime = now;
    verdict();
  }
  drawingTime = 0.95 * drawingTime + 0.05 * (performance.now() - began);
  frames.push(now);
  while (frames.length > 120) { frames.shift(); }
  if (frames.length > 30) {
    const rate = 1000 * (frames.length - 1) / (now - frames[0]);
    if (verdictTime === now) { $('rate').textContent = `${rate.toFixed(0)} frames a second`; }
    document.documentElement.dataset.rate = rate;
    document.documentElement.dataset.work = drawingTime.toFixed(2);
  }
  requestAnimationFrame(frame);
}

dark.addEventListener('change', () => { readTheme(); nameCells(); });
readTheme();
load();
requestAnimationFrame(frame);

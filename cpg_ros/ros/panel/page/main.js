// The page: messages from the node go to its parts, and user actions go to the node.
import { Bridges } from './bridges.js';
import { Lease } from './lease.js';
import { Parameters } from './parameters.js';
import { Plots } from './plots.js';
import { Scene } from './scene.js';
import { Steering } from './steering.js';
import { Tour } from './tour.js';

const byId = (id) => document.getElementById(id);
const token = new URLSearchParams(location.search).get('token');

// -- the view, which the address carries ------------------------------------------------------

const hash = new URLSearchParams(location.hash.slice(1));
const DEFAULT_CAMERA = [50, 18, 2];
const camera = (hash.get('camera') || '').split(',').map((text, k) => Number(text) || DEFAULT_CAMERA[k]);
const view = Object.fromEntries(['node', 'plot', 'leg', 'portrait', 'theme'].map((key) =>
  [key, hash.get(key) || '']));
const dark = matchMedia('(prefers-color-scheme: dark)');

function applyTheme() {
  document.documentElement.dataset.theme = view.theme || (dark.matches ? 'dark' : 'light');
  scene?.setColours();
  needsDraw = true;
}

function saveView() {
  const options = new URLSearchParams();
  if (scene.renderer) options.set('camera', scene.view.map((value) => +value.toFixed(2)).join(','));
  for (const [key, value] of Object.entries(view)) if (value) options.set(key, value);
  history.replaceState(null, '', `#${options}`);
}

// -- its parts --------------------------------------------------------------------------------

const MIN_REALTIME_FACTOR = 0.9;  // a simulation below this fraction of real time is said to be slow
let wasConnected = false, isSelected = false, state = {}, frames = 0, framesBefore = 0, needsDraw = true, scene = null;
const latest = {};
const link = new Worker('link.js');
const send = (request) => link.postMessage({ send: request });
const set = (name, value) => send({ do: 'set', name, value });
const parameters = new Parameters((name, value) => {
  if (name === 'gait') tour.end();
  set(name, value);
});
const lease = new Lease();
const bridges = new Bridges(send);
const steering = new Steering((held) => link.postMessage({ held }));
applyTheme();
dark.addEventListener('change', applyTheme);
const push = (force, direction) => send({ do: 'push', force, direction });
scene = new Scene(byId('scene'), [...camera, ...DEFAULT_CAMERA.slice(camera.length)], () => {
  needsDraw = true;
  saveView();
}, push);
const plots = new Plots(view, saveView);
const tour = new Tour(steering, set, byId('tour'));
// What tests look at.
window.panel = { get frames() { return frames; }, latest, get state() { return state; },
  get lease() { return lease.now; }, plots, scene, steering, tour };

function notify(text, kind) {
  for (const old of [...byId('notices').children]) if (old.textContent === text) old.remove();
  const line = Object.assign(document.createElement('p'), { textContent: text, className: kind });
  byId('notices').append(line);
  while (byId('notices').children.length > 4) byId('notices').firstChild.remove();
  setTimeout(() => line.remove(), kind === 'refused' ? 9000 : 4000);
}

function setChip(element, text, kind = '') {
  element.textContent = text;
  element.className = `chip ${kind}`;
}

function updateAvailability() {
  const { simulation, inversion } = state.beside?.[view.node] || {};
  byId('reset').disabled = !simulation;
  byId('pushing').hidden = !simulation;
  scene.pushable = !!simulation;
  byId('fit').disabled = !inversion;
  const exists = state.generators?.includes(view.node);
  const [text, bar] = byId('starting').children, done = /(\d+) of about (\d+) s/.exec(state.starting);
  byId('starting').hidden = exists;
  text.textContent = state.starting || (isSelected ? `${view.node} is gone`
    : state.generators?.length ? 'choose a generator' : 'waiting for a generator');
  bar.hidden = !done;
  if (done) [bar.value, bar.max] = done.slice(1).map(Number);
  const steerable = exists && parameters.byName.cmd_vel?.value === true;
  steering.enable(steerable && lease.steers);
  tour.enable(steering.able, parameters.gaitNames);
  byId('steered').textContent = lease.reason || (steerable
    ? `up to ${state.fastest[0]} m/s and ${state.fastest[1]} rad/s`
    : 'not steered: the gait has no steering table, or the generator runs without cmd_vel:=true');
}

const handlers = {
  state(message) {
    state = message;
    byId('generators').replaceChildren(...message.generators.map((name) => new Option(name)));
    byId('generators').value = view.node;
    byId('generators').hidden = message.generators.length < 2;
    byId('record').textContent = message.recording ? 'Stop recording' : 'Record';
    byId('record').classList.toggle('on', message.recording);
    byId('download').hidden = message.recording || !message.bag;
    byId('download').href = `bags/${message.bag}.zip${token ? `?token=${encodeURIComponent(token)}`
      : ''}`;
    if (!message.generators.length) setChip(byId('now'), 'no generator yet');
    updateAvailability();
  },
  selected(message) {
    if (view.node && view.node !== message.node && state.generators?.includes(view.node)
        && !isSelected) {
      // The address names a generator other than the one that the node offers first.
      isSelected = true;
      send({ do: 'choose', node: view.node });
      return;
    }
    isSelected = true;
    // What was held was for another robot.
    if (view.node !== message.node) steering.release();
    view.node = message.node;
    byId('generators').value = message.node;
    for (const key of Object.keys(latest)) delete latest[key];
    plots.clear();
    parameters.show([]);
    byId('health').replaceChildren();
    byId('fallen').hidden = byId('slow').hidden = true;
    setChip(byId('now'), 'no gait');
    updateAvailability();
    saveView();
  },
  bridges: (message) => bridges.update(message),
  controls(message) {
    parameters.show(message.controls);
    updateAvailability();
  },
  values: (message) => parameters.update(message.values),
  shape(message) {
    scene.show(message);
    plots.setShape(message);
    byId('source').textContent = [`shape: ${message.source}`, ...scene.software
      ? ['drawn coarsely: this browser has no graphics card'] : [], ...message.doubts.slice(0, 1)].join('; ');
    byId('source').title = message.doubts.join('\n');
    needsDraw = true;
  },
  names: (message) => plots.setNames(message),
  gait(message) {
    setChip(byId('now'), message.gait, 'ok');
    latest.gait = message.gait;
    parameters.markGait(message.gait);
  },
  health(message) {
    byId('health').replaceChildren(...Object.entries(message.parts).map(([name, part]) => {
      const box = document.createElement('div'), label = document.createElement('span');
      setChip(label, `${name}: ${part.text}`, part.level);
      const table = document.createElement('table');
      for (const pair of Object.entries(part.values)) {
        const row = table.insertRow();
        for (const text of pair) row.insertCell().textContent = text;
      }
      box.append(label, table);
      return box;
    }));
    const parts = Object.values(message.parts);
    const worst = ['error', 'warn', 'stale'].find((level) =>
      parts.some((part) => part.level === level)) || 'ok';
    setChip(byId('worst'), parts.filter((part) => part.level === worst).map((part) => part.text)
      .join(', '), worst);
    const value = (name) => Number(parts.map((part) => part.values[name]).find(Boolean));
    byId('slow').hidden = !(value('real-time factor') < MIN_REALTIME_FACTOR);
    byId('slow').textContent = `${value('real-time factor').toFixed(2)} of real time`;
    byId('fallen').hidden = !parts.some((part) => part.values.fallen === 'True');
    plots.setFrequency(value('frequency [Hz]'));
  },
  lease(message) {
    lease.update(message);
    updateAvailability();
  },
  released() {
    steering.release();
    notify('the robot stopped because this page stood still; it goes on while the key is held', 'refused');
  },
  notice(message) {
    notify(message.text, message.kind);
    if (message.kind === 'refused') parameters.restore();
  },
  frames(message) {
    for (const frame of message.frames) {
      frames++;
      Object.assign(latest, frame);
      plots.add(frame);
      if (frame.time !== undefined) tour.advance(frame.time);
    }
    needsDraw = true;
    link.postMessage({ drawn: true });
  },
};

function connect() {
  const where = new URL('socket', location.href);
  where.protocol = location.protocol === 'https:' ? 'wss:' : 'ws:';
  where.hash = '';
  where.search = token ? `?token=${encodeURIComponent(token)}` : '';
  link.postMessage({ connect: where.href });
}

handlers.opened = () => {
  wasConnected = true;
  isSelected = false;
  setChip(byId('link-state'), 'connected', 'ok');
};
handlers.closed = () => {
  steering.release();
  setChip(byId('link-state'), wasConnected ? 'the panel is gone; reconnecting'
    : 'cannot connect: is the panel running, and is the token in the address right?', 'error');
  setTimeout(connect, 1000);
};
link.onmessage = ({ data }) => handlers[data.type]?.(data);
// The link stops the robot if it does not hear that this thread runs.
setInterval(() => link.postMessage({}), 50);

// -- drawing ----------------------------------------------------------------------------------

// Where a picture takes so long, ms, none is drawn while the robot is steered.
const SLOW_DRAWING = 150;
// Longest pause after a picture, ms.
const MAX_PAUSE = 300;
let drawingTime = 0, drawnAt = 0, pause = 0;
const isPaused = () => !!steering.held && drawingTime > SLOW_DRAWING;

// Draw, and take note of how long that takes.
function measure(drawing) {
  const began = performance.now();
  drawing();
  link.postMessage({});
  drawnAt = performance.now();
  pause = Math.min(drawnAt - began, MAX_PAUSE);
  drawingTime = Math.max(drawnAt - began, 0.95 * drawingTime);
}

function draw() {
  requestAnimationFrame(draw);
  scene.adaptResolution(performance.now());
  // Half of the time is for all else.
  if (!needsDraw || isPaused() || performance.now() - drawnAt < pause) return;
  needsDraw = false;
  measure(drawScene);
}

// How much of the picture the panels at the right and at the bottom cover, px.
function coveredPixels() {
  const [aside, below] = [document.querySelector('aside'), byId('plots')].map((one) =>
    getComputedStyle(one).position === 'fixed' ? one.getBoundingClientRect() : null);
  return [aside ? innerWidth - aside.left : 0, below ? innerHeight - below.top : 0];
}

function drawScene() {
  const named = (key) => Object.fromEntries((plots.names[key] || []).map((name, k) =>
    [name, latest[key === 'joints' ? 'angles' : key]?.[k]]).filter(([, value]) => value != null));
  scene.pose(named('joints'), latest.base);
  scene.draw(named('forces'), coveredPixels());
}

setInterval(() => {
  if (document.hidden) return;
  byId('paused').hidden = !isPaused();
  if (!isPaused()) measure(() => plots.draw());
  // Without a minus before a zero.
  const digits = (value, unit) => value == null ? '–'
    : `${(+value.toFixed(2) || 0).toFixed(2)} ${unit}`;
  const [speed, , turning] = plots.speed();
  byId('speed').textContent = digits(speed, 'm/s');
  byId('turning').textContent = digits(turning, 'rad/s');
  byId('time').textContent = digits(latest.time == null ? null : latest.time % 1e5, 's');
}, 150);
setInterval(() => {
  byId('updates').textContent = `${((frames - framesBefore) / 2).toFixed(0)} per second`;
  framesBefore = frames;
}, 2000);

// -- what people do ---------------------------------------------------------------------------

const stop = () => {
  steering.release();
  send({ do: 'stop' });
};
byId('generators').onchange = () => send({ do: 'choose', node: byId('generators').value });
byId('stop').onclick = stop;
for (const button of document.querySelectorAll('[data-request]'))
  button.onclick = () => send(JSON.parse(button.dataset.request));
byId('record').onclick = () => send({ do: 'record', on: !state.recording });
// The controls count from ahead of the robot, the command from the world's x.
const pushArguments = () => [+byId('force').value, +byId('direction').value + scene.heading];
byId('push').onclick = () => push(...pushArguments());
for (const [kind, visible] of [['pointerenter', true], ['input', true], ['pointerleave', false]])
  byId('pushing').addEventListener(kind, () => {
    scene.showPush(...visible ? pushArguments() : [0, 0]);
    needsDraw = true;
  });
for (const button of byId('views').children)
  button.onclick = () => scene.preset(button.dataset.view);
byId('theme').onclick = () => {
  view.theme = document.documentElement.dataset.theme === 'dark' ? 'light' : 'dark';
  applyTheme();
  saveView();
};
byId('copy').onclick = () => {
  saveView();
  navigator.clipboard?.writeText(location.href).then(() => notify('link copied', 'info'),
    () => notify(location.href, 'info')) ?? notify(location.href, 'info');
};
const directionText = (degrees) => degrees === 0 ? 'forward' : Math.abs(degrees) === 180 ? 'backward'
  : `${Math.abs(degrees)}° ${degrees > 0 ? 'left' : 'right'}`;
for (const [id, text] of [['force', (value) => `${value} N`], ['direction', (value) => directionText(+value)]]) {
  const show = () => { byId(`${id}-is`).textContent = text(byId(id).value); };
  byId(id).addEventListener('input', show);
  show();
}

const MAX_KEY_AGE = 200;  // largest age of a key's repetition, ms
window.addEventListener('keydown', (event) => {
  const typing = event.target.matches('input, select, textarea');
  if (event.ctrlKey || event.metaKey || event.altKey) return;
  if (event.key === ' ' && !event.target.matches('input[type="text"], input[type="number"]')) {
    event.preventDefault();
    if (!event.repeat) stop();
  } else if (typing) {
    // Its own keys.
  } else if (event.key.startsWith('Arrow')) {
    event.preventDefault();
    // A key that repeats is still down: after the page stood still the robot goes on.
    if (!event.repeat || (!steering.held && performance.now() - event.timeStamp < MAX_KEY_AGE))
      steering.key(event.key, true);
  } else if (/^[1-9]$/.test(event.key) && !event.repeat) {
    byId('gaits').children[event.key - 1]?.click();
  }
});
window.addEventListener('keyup', (event) => {
  if (event.key === ' ' && event.target.matches('button')) event.preventDefault();
  if (event.key.startsWith('Arrow')) steering.key(event.key, false);
});

saveView();
connect();
draw();

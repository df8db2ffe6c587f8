// The page: messages from the node go to its parts, and user actions go to the node.
import { Bridges } from './bridges.js';
import { Lease } from './lease.js';
import { Parameters } from './parameters.js';
import { Plots } from './plots.js';
import { Scene } from './scene.js';
import { Steering } from './steering.js';
import { Tour } from './tour.js';

const at = (id) => document.getElementById(id);
const token = new URLSearchParams(location.search).get('token');

// -- the view, which the address carries ------------------------------------------------------

const given = new URLSearchParams(location.hash.slice(1));
const usual = [50, 18, 2];
const camera = (given.get('camera') || '').split(',').map((text, k) => Number(text) || usual[k]);
const view = Object.fromEntries(['node', 'plot', 'leg', 'portrait', 'theme'].map((key) =>
  [key, given.get(key) || '']));
const dark = matchMedia('(prefers-color-scheme: dark)');

function paint() {
  document.documentElement.dataset.theme = view.theme || (dark.matches ? 'dark' : 'light');
  scene?.paint();
  fresh = true;
}

function remember() {
  const words = new URLSearchParams();
  if (scene.renderer) words.set('camera', scene.view.map((value) => +value.toFixed(2)).join(','));
  for (const [key, value] of Object.entries(view)) if (value) words.set(key, value);
  history.replaceState(null, '', `#${words}`);
}

// -- its parts --------------------------------------------------------------------------------

const REAL = 0.9;  // a simulation below this fraction of real time is said to be slow
let opened = false, state = {}, frames = 0, counted = 0, fresh = true, scene = null;
const last = {};
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
paint();
dark.addEventListener('change', paint);
const push = (force, direction) => send({ do: 'push', force, direction });
scene = new Scene(at('scene'), [...camera, ...usual.slice(camera.length)], () => {
  fresh = true;
  remember();
}, push);
const plots = new Plots(view, remember);
const tour = new Tour(steering, set, at('tour'));
// What tests look at.
window.panel = { get frames() { return frames; }, last, get state() { return state; },
  get lease() { return lease.now; }, plots, scene, steering, tour };

function say(text, kind) {
  for (const same of [...at('said').children]) if (same.textContent === text) same.remove();
  const line = Object.assign(document.createElement('p'), { textContent: text, className: kind });
  at('said').append(line);
  while (at('said').children.length > 4) at('said').firstChild.remove();
  setTimeout(() => line.remove(), kind === 'refused' ? 9000 : 4000);
}

function chip(element, text, kind = '') {
  element.textContent = text;
  element.className = `chip ${kind}`;
}

function beside() {
  const { simulation, inversion } = state.beside?.[view.node] || {};
  at('reset').disabled = !simulation;
  at('pushing').hidden = !simulation;
  scene.pushable = !!simulation;
  at('fit').disabled = !inversion;
  const there = state.generators?.includes(view.node);
  const [text, bar] = at('starting').children, done = /(\d+) of about (\d+) s/.exec(state.starting);
  at('starting').hidden = there;
  text.textContent = state.starting || (takes.wanted ? `${view.node} is gone`
    : state.generators?.length ? 'choose a generator' : 'waiting for a generator');
  bar.hidden = !done;
  if (done) [bar.value, bar.max] = done.slice(1).map(Number);
  const steered = there && parameters.known.cmd_vel?.value === true;
  steering.enable(steered && lease.steers);
  tour.enable(steering.able, parameters.gaitNames);
  at('steered').textContent = lease.reason || (steered
    ? `up to ${state.fastest[0]} m/s and ${state.fastest[1]} rad/s`
    : 'not steered: the gait has no steering table, or the generator runs without cmd_vel:=true');
}

const takes = {
  state(message) {
    state = message;
    at('generators').replaceChildren(...message.generators.map((name) => new Option(name)));
    at('generators').value = view.node;
    at('generators').hidden = message.generators.length < 2;
    at('record').textContent = message.recording ? 'Stop recording' : 'Record';
    at('record').classList.toggle('on', message.recording);
    at('download').hidden = message.recording || !message.bag;
    at('download').href = `bags/${message.bag}.zip${token ? `?token=${encodeURIComponent(token)}`
      : ''}`;
    if (!message.generators.length) chip(at('now'), 'no generator yet');
    beside();
  },
  chosen(message) {
    if (view.node && view.node !== message.node && state.generators?.includes(view.node)
        && !takes.wanted) {
      // The address names a generator other than the one that the node offers first.
      takes.wanted = true;
      send({ do: 'choose', node: view.node });
      return;
    }
    takes.wanted = true;
    // What was held was for another robot.
    if (view.node !== message.node) steering.release();
    view.node = message.node;
    at('generators').value = message.node;
    for (const key of Object.keys(last)) delete last[key];
    plots.clear();
    parameters.show([]);
    at('health').replaceChildren();
    at('fallen').hidden = at('slow').hidden = true;
    chip(at('now'), 'no gait');
    beside();
    remember();
  },
  bridges: (message) => bridges.take(message),
  controls(message) {
    parameters.show(message.controls);
    beside();
  },
  values: (message) => parameters.take(message.values),
  shape(message) {
    scene.show(message);
    plots.shaped(message);
    at('source').textContent = [`shape: ${message.source}`, ...scene.software
      ? ['drawn coarsely: this browser has no graphics card'] : [], ...message.doubts.slice(0, 1)].join('; ');
    at('source').title = message.doubts.join('\n');
    fresh = true;
  },
  names: (message) => plots.named(message),
  gait(message) {
    chip(at('now'), message.gait, 'ok');
    last.gait = message.gait;
    parameters.mark(message.gait);
  },
  health(message) {
    at('health').replaceChildren(...Object.entries(message.parts).map(([name, part]) => {
      const made = document.createElement('div'), head = document.createElement('span');
      chip(head, `${name}: ${part.text}`, part.level);
      const table = document.createElement('table');
      for (const pair of Object.entries(part.values)) {
        const row = table.insertRow();
        for (const text of pair) row.insertCell().textContent = text;
      }
      made.append(head, table);
      return made;
    }));
    const parts = Object.values(message.parts);
    const worst = ['error', 'warn', 'stale'].find((level) =>
      parts.some((part) => part.level === level)) || 'ok';
    chip(at('worst'), parts.filter((part) => part.level === worst).map((part) => part.text)
      .join(', '), worst);
    const value = (name) => Number(parts.map((part) => part.values[name]).find(Boolean));
    at('slow').hidden = !(value('real-time factor') < REAL);
    at('slow').textContent = `${value('real-time factor').toFixed(2)} of real time`;
    at('fallen').hidden = !parts.some((part) => part.values.fallen === 'True');
    plots.paced(value('frequency [Hz]'));
  },
  lease(message) {
    lease.take(message);
    beside();
  },
  let_go() {
    steering.release();
    say('the robot stopped because this page stood still; it goes on while the key is held', 'refused');
  },
  said(message) {
    say(message.text, message.kind);
    if (message.kind === 'refused') parameters.restore();
  },
  frames(message) {
    for (const frame of message.frames) {
      frames++;
      Object.assign(last, frame);
      plots.take(frame);
      if (frame.time !== undefined) tour.take(frame.time);
    }
    fresh = true;
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

takes.opened = () => {
  opened = true;
  takes.wanted = false;
  chip(at('link-state'), 'connected', 'ok');
};
takes.closed = () => {
  steering.release();
  chip(at('link-state'), opened ? 'the panel is gone; reconnecting'
    : 'cannot connect: is the panel running, and is the token in the address right?', 'error');
  setTimeout(connect, 1000);
};
link.onmessage = ({ data }) => takes[data.type]?.(data);
// The link stops the robot if it does not hear that this thread runs.
setInterval(() => link.postMessage({}), 50);

// -- drawing ----------------------------------------------------------------------------------

// Where a picture takes so long, ms, none is drawn while the robot is steered.
const SLOW = 150;
// Longest pause after a picture, ms.
const LONGEST = 300;
let slowest = 0, ended = 0, spent = 0;
const pauses = () => !!steering.held && slowest > SLOW;

// Draw, and take note of how long that takes.
function timed(drawing) {
  const began = performance.now();
  drawing();
  link.postMessage({});
  ended = performance.now();
  spent = Math.min(ended - began, LONGEST);
  slowest = Math.max(ended - began, 0.95 * slowest);
}

function draw() {
  requestAnimationFrame(draw);
  scene.beat(performance.now());
  // Half of the time is for all else.
  if (!fresh || pauses() || performance.now() - ended < spent) return;
  fresh = false;
  timed(picture);
}

// How much of the picture the panels at the right and at the bottom cover, px.
function covered() {
  const [aside, below] = [document.querySelector('aside'), at('plots')].map((one) =>
    getComputedStyle(one).position === 'fixed' ? one.getBoundingClientRect() : null);
  return [aside ? innerWidth - aside.left : 0, below ? innerHeight - below.top : 0];
}

function picture() {
  const named = (key) => Object.fromEntries((plots.names[key] || []).map((name, k) =>
    [name, last[key === 'joints' ? 'angles' : key]?.[k]]).filter(([, value]) => value != null));
  scene.pose(named('joints'), last.base);
  scene.draw(named('forces'), covered());
}

setInterval(() => {
  if (document.hidden) return;
  at('paused').hidden = !pauses();
  if (!pauses()) timed(() => plots.draw());
  // Without a minus before a zero.
  const digits = (value, unit) => value == null ? '–'
    : `${(+value.toFixed(2) || 0).toFixed(2)} ${unit}`;
  const [speed, , turning] = plots.speed();
  at('speed').textContent = digits(speed, 'm/s');
  at('turning').textContent = digits(turning, 'rad/s');
  at('time').textContent = digits(last.time == null ? null : last.time % 1e5, 's');
}, 150);
setInterval(() => {
  at('updates').textContent = `${((frames - counted) / 2).toFixed(0)} per second`;
  counted = frames;
}, 2000);

// -- what people do ---------------------------------------------------------------------------

const stop = () => {
  steering.release();
  send({ do: 'stop' });
};
at('generators').onchange = () => send({ do: 'choose', node: at('generators').value });
at('stop').onclick = stop;
for (const button of document.querySelectorAll('[data-request]'))
  button.onclick = () => send(JSON.parse(button.dataset.request));
at('record').onclick = () => send({ do: 'record', on: !state.recording });
// The controls count from ahead of the robot, the command from the world's x.
const aimed = () => [+at('force').value, +at('direction').value + scene.heading];
at('push').onclick = () => push(...aimed());
for (const [kind, shown] of [['pointerenter', true], ['input', true], ['pointerleave', false]])
  at('pushing').addEventListener(kind, () => {
    scene.point(...shown ? aimed() : [0, 0]);
    fresh = true;
  });
for (const button of at('views').children)
  button.onclick = () => scene.preset(button.dataset.view);
at('theme').onclick = () => {
  view.theme = document.documentElement.dataset.theme === 'dark' ? 'light' : 'dark';
  paint();
  remember();
};
at('copy').onclick = () => {
  remember();
  navigator.clipboard?.writeText(location.href).then(() => say('link copied', 'told'),
    () => say(location.href, 'told')) ?? say(location.href, 'told');
};
const side = (degrees) => degrees === 0 ? 'forward' : Math.abs(degrees) === 180 ? 'backward'
  : `${Math.abs(degrees)}° ${degrees > 0 ? 'left' : 'right'}`;
for (const [id, text] of [['force', (value) => `${value} N`], ['direction', (value) => side(+value)]]) {
  const show = () => { at(`${id}-is`).textContent = text(at(id).value); };
  at(id).addEventListener('input', show);
  show();
}

const FRESH = 200;  // largest age of a key's repetition, ms
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
    if (!event.repeat || (!steering.held && performance.now() - event.timeStamp < FRESH))
      steering.key(event.key, true);
  } else if (/^[1-9]$/.test(event.key) && !event.repeat) {
    at('gaits').children[event.key - 1]?.click();
  }
});
window.addEventListener('keyup', (event) => {
  if (event.key === ' ' && event.target.matches('button')) event.preventDefault();
  if (event.key.startsWith('Arrow')) steering.key(event.key, false);
});

remember();
connect();
draw();

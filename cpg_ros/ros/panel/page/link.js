// The connection to the panel, in a worker: what is sent waits for nothing that is drawn.

const TICK = 50;     // ms between two commands while the robot is steered
const SILENT = 250;  // ms; a page that has stood still for this long has let go
const KEPT = 60;     // frames that wait for a page that draws slowly
let socket = null, stamp = null, held = null, pending = [], busy = false, count = 0;
let alive = performance.now(), ticked = alive, sent = 0;

// A command carries the newest stamp that has come: the panel sees by it how old it may be.
function send(request) {
  if (socket?.readyState !== WebSocket.OPEN) return;
  socket.send(JSON.stringify(stamp === null ? request : { ...request, stamp }));
}

function steer(speed, turn) {
  sent = performance.now();
  send({ do: 'steer', speed, turn });
}

function letGo() {
  if (held) steer(0, 0);
  held = null;
}

// Frames that come while the page draws go to it at once: none of its messages waits behind many.
function pass() {
  busy = pending.length > 0;
  if (busy) postMessage({ type: 'frames', frames: pending });
  pending = [];
}

function take(message) {
  if (message.stamp !== undefined) stamp = message.stamp;
  if (message.type === 'frame') {
    pending = [...pending.slice(1 - KEPT), message];
    if (!busy) pass();
  } else if (message.type !== 'stamp') {
    if (message.type === 'chosen') pending = [];
    postMessage(message);
  }
}

function connect(url) {
  stamp = held = null;
  pending = [];
  busy = false;
  socket = new WebSocket(url);
  socket.onopen = () => postMessage({ type: 'opened' });
  socket.onmessage = (event) => take(JSON.parse(event.data));
  socket.onclose = (event) => {
    held = null;
    postMessage({ type: 'closed', reason: event.reason });
  };
}

onmessage = ({ data }) => {
  alive = performance.now();
  if (data.connect) connect(data.connect);
  if (data.send) send(data.send);
  if (data.drawn) pass();
  if (data.held === null) letGo();
  if (data.held) {
    held = data.held;
    if (alive - sent >= TICK) steer(...held);
  }
};

setInterval(() => {
  const now = performance.now();
  // Of a page that stands still nobody knows whether the key is still down.
  const still = now - alive > SILENT || now - ticked > SILENT;
  ticked = now;
  if (held && still) {
    letGo();
    postMessage({ type: 'let_go' });
  }
  count++;
  // What cannot leave now is not queued: it would come late.
  if (socket?.bufferedAmount || stamp === null) return;
  if (held) steer(...held);
  else if (count % 2) send({ do: 'alive' });
}, TICK);

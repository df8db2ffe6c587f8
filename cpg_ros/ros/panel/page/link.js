// The connection to the panel, in a worker: what is sent waits for nothing that is drawn.

const STEERING_PERIOD = 50;  // ms between two commands while the robot is steered
const RELEASE_TIMEOUT = 250;  // ms; a page that stands still for this long releases the robot
const MAX_PENDING = 60;  // frames that wait for a page that draws slowly
let socket = null, stamp = null, held = null, pending = [], isBusy = false, numTicks = 0;
let lastMessage = performance.now(), lastTick = lastMessage, lastCommand = 0;

// A command carries the newest stamp that has come: the panel sees by it how old it may be.
function send(request) {
  if (socket?.readyState !== WebSocket.OPEN) return;
  socket.send(JSON.stringify(stamp === null ? request : { ...request, stamp }));
}

function steer(speed, turn) {
  lastCommand = performance.now();
  send({ do: 'steer', speed, turn });
}

function release() {
  if (held) steer(0, 0);
  held = null;
}

// Frames that come while the page draws go to it at once: none of its messages waits behind many.
function passFrames() {
  isBusy = pending.length > 0;
  if (isBusy) postMessage({ type: 'frames', frames: pending });
  pending = [];
}

function receive(message) {
  if (message.stamp !== undefined) stamp = message.stamp;
  if (message.type === 'frame') {
    pending = [...pending.slice(1 - MAX_PENDING), message];
    if (!isBusy) passFrames();
  } else if (message.type !== 'stamp') {
    if (message.type === 'selected') pending = [];
    postMessage(message);
  }
}

function connect(url) {
  stamp = held = null;
  pending = [];
  isBusy = false;
  socket = new WebSocket(url);
  socket.onopen = () => postMessage({ type: 'opened' });
  socket.onmessage = (event) => receive(JSON.parse(event.data));
  socket.onclose = (event) => {
    held = null;
    postMessage({ type: 'closed', reason: event.reason });
  };
}

onmessage = ({ data }) => {
  lastMessage = performance.now();
  if (data.connect) connect(data.connect);
  if (data.send) send(data.send);
  if (data.drawn) passFrames();
  if (data.held === null) release();
  if (data.held) {
    held = data.held;
    if (lastMessage - lastCommand >= STEERING_PERIOD) steer(...held);
  }
};

setInterval(() => {
  const now = performance.now();
  // Of a page that stands still nobody knows whether the key is still down.
  const isStill = now - lastMessage > RELEASE_TIMEOUT || now - lastTick > RELEASE_TIMEOUT;
  lastTick = now;
  if (held && isStill) {
    release();
    postMessage({ type: 'released' });
  }
  numTicks++;
  // What cannot leave now is not queued: it would come late.
  if (socket?.bufferedAmount || stamp === null) return;
  if (held) steer(...held);
  else if (numTicks % 2) send({ do: 'alive' });
}, STEERING_PERIOD);

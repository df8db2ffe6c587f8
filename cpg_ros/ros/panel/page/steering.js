// The pad and the arrow keys: the robot is steered only while one of them is held.

const KNOB_RANGE = 3.5;  // rem from the middle of the pad to the outermost place of the knob

export class Steering {
  // What is held goes to the link, which repeats it: [speed, turn], or null.
  constructor(hold) {
    this.send = hold;
    this.pad = document.getElementById('pad');
    this.knob = this.pad.querySelector('i');
    this.keys = new Set();
    this.able = false;
    this.held = null;
    this.released = () => {};
    this.addListeners();
  }

  enable(able) {
    this.able = able;
    this.pad.classList.toggle('off', !able);
    if (!able) this.release();
  }

  hold(speed, turn) {
    if (!this.able) return;
    this.held = [speed, turn];
    this.pad.classList.add('held');
    // Both at full reach are in a corner: the knob stays in its circle.
    const reach = KNOB_RANGE / Math.max(1, Math.hypot(speed, turn));
    this.knob.style.transform = `translate(${-reach * turn}rem, ${-reach * speed}rem)`;
    this.send(this.held);
  }

  // Let go: whatever was held, and nothing is sent after it.
  release() {
    this.keys.clear();
    this.knob.style.transform = '';
    this.pad.classList.remove('held');
    if (this.held) this.send(null);
    this.held = null;
    this.released();
  }

  addListeners() {
    const { pad } = this, clip = (value) => Math.max(-1, Math.min(1, +value.toFixed(3)));
    const follow = (event) => {
      const box = pad.getBoundingClientRect(), reach = 0.4 * box.width;
      this.hold(clip((box.top + box.height / 2 - event.clientY) / reach),
        clip((box.left + box.width / 2 - event.clientX) / reach));
    };
    pad.addEventListener('pointerdown', (event) => {
      if (!this.able) return;
      pad.setPointerCapture(event.pointerId);
      follow(event);
    });
    pad.addEventListener('pointermove', (event) => {
      if (pad.hasPointerCapture(event.pointerId)) follow(event);
    });
    for (const kind of ['pointerup', 'pointercancel', 'lostpointercapture'])
      pad.addEventListener(kind, () => this.release());
    // Dead man's switch: whoever cannot see the robot cannot steer it.
    document.addEventListener('visibilitychange', () => document.hidden && this.release());
    window.addEventListener('pagehide', () => this.release());
    window.addEventListener('blur', () => this.release());
  }

  key(name, down) {
    if (down) this.keys.add(name);
    else this.keys.delete(name);
    const pressed = (key) => this.keys.has(key) ? 1 : 0;
    const speed = pressed('ArrowUp') - pressed('ArrowDown'), turn = pressed('ArrowLeft') - pressed('ArrowRight');
    if (speed || turn) this.hold(speed, turn);
    else this.release();
  }
}

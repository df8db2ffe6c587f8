// A tour of the gaits: this page steers the robot ahead, and changes its gait now and then.

const EVERY = 6;     // s of the robot's time for each gait
const SPEED = 0.8;   // fraction of the largest speed

export class Tour {
  // Steering holds what it is told to, as if a key were down; set changes the gait.
  constructor(steering, set, button) {
    Object.assign(this, { steering, set, button, gaits: null, due: 0 });
    button.onclick = () => this.gaits ? this.end() : this.begin();
    steering.released = () => this.end();
  }

  enable(able, gaits) {
    this.all = gaits;
    this.button.disabled = !able || gaits.length < 2;
    if (this.button.disabled) this.end();
  }

  begin() {
    this.gaits = [...this.all];
    this.due = -Infinity;
    this.button.textContent = 'End tour';
    this.button.classList.add('on');
    this.steering.hold(SPEED, 0);
  }

  // Whatever lets go of the robot, or steers it, ends the tour.
  end() {
    if (!this.gaits) return;
    this.gaits = null;
    this.button.textContent = 'Tour of the gaits';
    this.button.classList.remove('on');
    this.steering.release();
  }

  // The robot's time, s, as it goes on.
  take(time) {
    if (!this.gaits || time < this.due) return;
    if (!this.gaits.length) {
      this.end();
      return;
    }
    this.due = time + EVERY;
    this.set('gait', this.gaits.shift());
  }
}

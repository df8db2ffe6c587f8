// A tour of the gaits: this page steers the robot ahead, and changes its gait now and then.

const GAIT_TIME = 6;  // s of the robot's time for each gait
const SPEED_FRACTION = 0.8;  // fraction of the largest speed

export class Tour {
  // Steering holds what it is told to, as if a key were down; set changes the gait.
  constructor(steering, set, button) {
    Object.assign(this, { steering, set, button, remaining: null, nextChange: 0 });
    button.onclick = () => this.remaining ? this.end() : this.begin();
    steering.released = () => this.end();
  }

  enable(able, gaits) {
    this.gaitNames = gaits;
    this.button.disabled = !able || gaits.length < 2;
    if (this.button.disabled) this.end();
  }

  begin() {
    this.remaining = [...this.gaitNames];
    this.nextChange = -Infinity;
    this.button.textContent = 'End tour';
    this.button.classList.add('on');
    this.steering.hold(SPEED_FRACTION, 0);
  }

  // Whatever lets go of the robot, or steers it, ends the tour.
  end() {
    if (!this.remaining) return;
    this.remaining = null;
    this.button.textContent = 'Tour of the gaits';
    this.button.classList.remove('on');
    this.steering.release();
  }

  // The robot's time, s, as it goes on.
  advance(time) {
    if (!this.remaining || time < this.nextChange) return;
    if (!this.remaining.length) {
      this.end();
      return;
    }
    this.nextChange = time + GAIT_TIME;
    this.set('gait', this.remaining.shift());
  }
}

// Where the links of a robot are, from its joints' angles and the pose of its base.
import { about, frame, fromQuaternion, identity, multiply, point } from './matrices.js';

const STILL = [1, 0, 0, 0, 1, 0, 0, 0, 1];

export class Body {
  constructor(shape) {
    this.shape = shape;
    this.angles = {};
    this.base = null;
    this.worlds = shape.links.map(identity);
  }

  // Take what a frame brings: angles by joint, the base as x y z and a quaternion w x y z.
  take(angles, base) {
    Object.assign(this.angles, angles);
    if (base) this.base = base;
  }

  place() {
    const { links, feet } = this.shape;
    const held = (origin) => links.forEach((link, k) => {
      let own = link.parent < 0 ? origin : multiply(this.worlds[link.parent],
        frame(link.place, link.pose));
      if (link.joint) {
        const angle = (this.angles[link.joint] ?? link.zero) - link.zero;
        own = multiply(own, link.slides ? frame(link.axis.map((part) => part * angle), STILL)
          : frame([0, 0, 0], about(link.axis, angle)));
      }
      this.worlds[k] = own;
    });
    if (this.base) {
      held(frame(this.base.slice(0, 3), fromQuaternion(...this.base.slice(3))));
    } else {
      // Nobody says where it is: it stands on its lowest foot.
      held(identity());
      const heights = Object.keys(feet).map((leg) => this.foot(leg)[2]);
      held(frame([0, 0, heights.length ? 0.02 - Math.min(...heights) : 0.4], STILL));
    }
  }

  foot(leg) {
    const [link, ...place] = this.shape.feet[leg];
    return point(this.worlds[link], place);
  }

  get middle() {
    return [...this.worlds[0].slice(12, 15)];
  }
}

// The robot in three.js: its links, their shadow, the forces on its feet, and pushes.
import { BasicShadowMap, BoxGeometry, BufferAttribute, BufferGeometry, CapsuleGeometry, Color,
  CylinderGeometry, DirectionalLight, DoubleSide, Fog, Group, HemisphereLight, Matrix4, mergeVertices,
  Mesh, MeshLambertMaterial, MeshStandardMaterial, OrbitControls, PCFShadowMap, PerspectiveCamera,
  Plane, PlaneGeometry, Quaternion, Raycaster, Scene as World, SphereGeometry, SRGBColorSpace,
  toCreasedNormals, Vector2, Vector3, WebGLRenderer } from './three.min.js';

const UP = new Vector3(0, 0, 1);
const MIN_RESOLUTION = 0.5;  // fraction of the screen's pixels that are drawn at least, each way
const FORCE_SCALE = 0.0022;  // length of an arrow for each newton on a foot, m
const MAX_PUSH = 300;  // hardest push, N
const MAX_ARROW = 0.6;  // length of the arrow of the hardest push, m
const CREASE_ANGLE = 0.7;  // edges that bend by more stay sharp, rad
const COARSE_DISTANCE = 0.008;  // vertices closer than this are one where software draws, m
const HALF_FLOOR = 30, HALF_STRIPE = 0.006;  // half the floor and half the width of a stripe on it, m
const RADIANS = Math.PI / 180;
// Presets of the camera: azimuth and elevation, degrees.
const VIEWS = { quarter: [50, 18], front: [0, 10], side: [90, 8], top: [0.01, 89] };

const PIXEL = new Uint8Array(4);
const decodeBase64 = (text) => Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0)).buffer;

// Close vertices become one; triangles without area go.
function coarsened(geometry) {
  const result = mergeVertices(geometry, COARSE_DISTANCE), { array } = result.index, whole = [];
  for (let k = 0; k < array.length; k += 3) {
    const corners = array.slice(k, k + 3);
    if (new Set(corners).size === 3) whole.push(...corners);
  }
  return result.setIndex(whole);
}

// Sizes are those of a geom of MuJoCo; its cylinders and capsules are along z.
const SOLIDS = { box: ([x, y, z]) => new BoxGeometry(2 * x, 2 * y, 2 * z),
  sphere: ([r]) => new SphereGeometry(r, 24, 16),
  ellipsoid: (size) => new SphereGeometry(1, 24, 16).scale(...size),
  cylinder: ([r, half]) => new CylinderGeometry(r, r, 2 * half, 24).rotateX(Math.PI / 2),
  capsule: ([r, half]) => new CapsuleGeometry(r, 2 * half, 8, 24).rotateX(Math.PI / 2) };

function withFrame(object, frame) {
  object.applyMatrix4(new Matrix4().fromArray(frame));
  return object;
}

// Stripes every metre, as triangles: lines are a pixel wide, and software may leave them out.
function grid() {
  const corners = [], geometry = new BufferGeometry();
  for (let k = -HALF_FLOOR; k <= HALF_FLOOR; k++)
    for (const [x0, y0, x1, y1] of [[k - HALF_STRIPE, -HALF_FLOOR, k + HALF_STRIPE, HALF_FLOOR],
      [-HALF_FLOOR, k - HALF_STRIPE, HALF_FLOOR, k + HALF_STRIPE]])
      corners.push(x0, y0, 0, x1, y0, 0, x1, y1, 0, x0, y0, 0, x1, y1, 0, x0, y1, 0);
  geometry.setAttribute('position', new BufferAttribute(new Float32Array(corners), 3));
  geometry.computeVertexNormals();
  return new Mesh(geometry, new MeshLambertMaterial());
}

// An arrow along z, 1 m long.
function arrow() {
  const material = new MeshLambertMaterial(), result = new Group();
  result.add(new Mesh(new CylinderGeometry(0.008, 0.008, 0.85).translate(0, 0.425, 0), material),
    new Mesh(new CylinderGeometry(0, 0.022, 0.15).translate(0, 0.925, 0), material));
  result.children.forEach((one) => one.geometry.rotateX(Math.PI / 2));
  result.tint = material.color;
  return result;
}

export class Scene {
  // Camera as azimuth and elevation in degrees and distance in m; moved is called when it moves,
  // push with a force in N and a direction in degrees from the world's x to its y.
  constructor(canvas, [azimuth, elevation, distance], moved, push) {
    Object.assign(this, { canvas, push, resolution: 1, links: [], arrows: {}, pushable: false });
    this.camera = new PerspectiveCamera(40, 1, 0.1, 60);
    this.camera.up = UP;
    this.robot = new Group();
    try {
      this.renderer = new WebGLRenderer({ canvas, antialias: true });
    } catch {
      return;  // no WebGL: everything else on the page works
    }
    this.gl = this.renderer.getContext();
    const named = this.gl.getExtension('WEBGL_debug_renderer_info');
    this.software = /swiftshader|llvmpipe|software/i.test(
      named ? this.gl.getParameter(named.UNMASKED_RENDERER_WEBGL) : '');
    this.renderer.shadowMap.enabled = true;
    this.renderer.shadowMap.type = this.software ? BasicShadowMap : PCFShadowMap;
    this.controls = new OrbitControls(this.camera, canvas);
    Object.assign(this.controls, { minDistance: 0.4, maxDistance: 12, maxPolarAngle: 1.54 });
    this.controls.target.set(0, 0, 0.22);
    this.build();
    this.look(azimuth, elevation, distance);
    this.controls.addEventListener('change', moved);
    this.addListeners();
  }

  build() {
    this.world = new World();
    this.world.fog = new Fog(0, 4, 14);
    this.sun = new DirectionalLight(0xffffff, 2.2);
    this.sun.castShadow = true;
    this.sun.shadow.mapSize.setScalar(this.software ? 512 : 2048);
    this.sun.shadow.radius = 5;
    this.sun.shadow.normalBias = 0.01;
    Object.assign(this.sun.shadow.camera, { left: -1.2, right: 1.2, top: 1.2, bottom: -1.2, far: 8 });
    this.floor = new Mesh(new PlaneGeometry(2 * HALF_FLOOR, 2 * HALF_FLOOR), new MeshLambertMaterial({
      polygonOffset: true, polygonOffsetFactor: 1, polygonOffsetUnits: 4 }));  // below its grid
    this.floor.receiveShadow = true;
    this.grid = grid();
    this.grid.receiveShadow = true;
    this.pushArrow = arrow();
    this.pushArrow.visible = false;
    this.world.add(new HemisphereLight(0xffffff, 0x8899aa, 1.6), this.sun, this.sun.target,
      this.floor, this.grid, this.robot, this.pushArrow);
    this.setColours();
  }

  // Colours of the page's theme.
  setColours() {
    if (!this.renderer) return;
    const style = getComputedStyle(document.documentElement);
    const colour = (name) => new Color(style.getPropertyValue(name).trim());
    this.world.background = this.world.fog.color = colour('--sky');
    this.floor.material.color = colour('--floor');
    this.grid.material.color = colour('--floor-line');
    this.forceColour = colour('--good');
    this.pushArrow.tint.copy(colour('--b'));
  }

  // Turn the camera around its target; a distance of 0 leaves the distance as it is.
  look(azimuth, elevation, distance = 0) {
    const away = distance || this.camera.position.distanceTo(this.controls.target);
    const [a, e] = [azimuth * RADIANS, elevation * RADIANS];
    this.camera.position.set(Math.cos(e) * Math.cos(a), Math.cos(e) * Math.sin(a), Math.sin(e))
      .multiplyScalar(away).add(this.controls.target);
    this.controls.update();
  }

  // From where the robot is seen: a preset turns with it.
  preset(name) {
    const [azimuth, elevation] = VIEWS[name];
    this.look(azimuth + this.heading, elevation);
  }

  // The robot's yaw, degrees.
  get heading() {
    const ahead = new Vector3(1, 0, 0).applyQuaternion(this.robot.quaternion);
    return Math.atan2(ahead.y, ahead.x) / RADIANS;
  }

  get view() {
    const way = this.camera.position.clone().sub(this.controls.target), distance = way.length();
    return [Math.atan2(way.y, way.x) / RADIANS, Math.asin(way.z / distance) / RADIANS, distance];
  }

  show(shape) {
    for (const old of Object.values(this.arrows)) old.removeFromParent();
    this.robot.traverse((old) => old.geometry?.dispose());
    this.robot.clear();
    Object.assign(this, { shape, links: [], arrows: {} });
    for (const link of shape.links) {
      const group = withFrame(new Group(), link.frame);
      group.userData = { rest: group.quaternion.clone(), place: group.position.clone(),
        axis: new Vector3(...link.axis) };
      for (const part of link.parts) group.add(this.part(part));
      (link.parent < 0 ? this.robot : this.links[link.parent]).add(group);
      this.links.push(group);
    }
  }

  part({ kind, size, colour, frame, low, step, points, triangles }) {
    let geometry = SOLIDS[kind]?.(size);
    if (!geometry) {
      const corners = Float32Array.from(new Uint16Array(decodeBase64(points)),
        (n, k) => low[k % 3] + step * n);
      geometry = new BufferGeometry();
      geometry.setAttribute('position', new BufferAttribute(corners, 3));
      geometry.setIndex(new BufferAttribute(new Uint32Array(decodeBase64(triangles)), 1));
      // With sharp edges no vertex is shared: three times as many, for a graphics card.
      geometry = this.software ? coarsened(geometry) : toCreasedNormals(geometry, CREASE_ANGLE);
    }
    // The sides of a thin wall are one when merged: their normals would cancel.
    const shade = { side: DoubleSide, flatShading: this.software,
      color: new Color().setRGB(...colour, SRGBColorSpace) };
    const material = this.software ? new MeshLambertMaterial(shade)
      : new MeshStandardMaterial({ roughness: 0.55, metalness: 0.1, ...shade });
    const mesh = withFrame(new Mesh(geometry, material), frame);
    mesh.castShadow = true;
    mesh.receiveShadow = !this.software;  // flat triangles would shade themselves in stripes
    return mesh;
  }

  // Angles by joint, rad or m; the base as x y z and a quaternion w x y z, null if unknown.
  pose(angles, base) {
    this.shape?.links.forEach((link, k) => {
      if (!link.joint) return;
      const { rest, place, axis } = this.links[k].userData;
      const angle = angles[link.joint] ?? 0;
      if (link.slides) this.links[k].position.copy(
        axis.clone().multiplyScalar(angle).applyQuaternion(rest).add(place));
      else this.links[k].quaternion.setFromAxisAngle(axis, angle).premultiply(rest);
    });
    const [x, y, z, w, i, j, k] = base || [0, 0, 0, 1, 0, 0, 0];
    this.robot.position.set(x, y, z);
    this.robot.quaternion.copy(new Quaternion(i, j, k, w));
    this.robot.updateMatrixWorld(true);
    if (base || !this.shape) return;
    // Its place is unknown: it stands on its lowest foot.
    const heights = Object.keys(this.shape.feet).map((leg) => this.foot(leg).z);
    this.robot.position.z = heights.length ? 0.02 - Math.min(...heights) : 0.4;
    this.robot.updateMatrixWorld(true);
  }

  foot(leg) {
    const [link, ...place] = this.shape.feet[leg];
    return new Vector3(...place).applyMatrix4(this.links[link].matrixWorld);
  }

  // Forces on the feet by leg, N; inset is what panels cover of the canvas at right and bottom, px.
  draw(forces, inset = [0, 0]) {
    const { renderer, canvas, camera, controls } = this;
    if (!renderer || !canvas.clientHeight) return;
    const [wide, high] = [canvas.clientWidth, canvas.clientHeight];
    renderer.setPixelRatio(this.resolution * Math.min(window.devicePixelRatio || 1, 2));
    renderer.setSize(wide, high, false);
    camera.aspect = wide / high;
    camera.setViewOffset(wide, high, inset[0] / 2, inset[1] / 2, wide, high);
    this.follow();
    for (const leg of Object.keys(this.shape?.feet || {})) {
      if (!this.arrows[leg]) this.world.add(this.arrows[leg] = arrow());
      const force = this.arrows[leg];
      force.visible = forces[leg] > 1;
      force.position.copy(this.foot(leg));
      force.scale.z = FORCE_SCALE * (forces[leg] || 1);
      force.tint.copy(this.forceColour);
    }
    renderer.render(this.world, camera);
    // Software draws later, unless what it has drawn is asked for: what that takes would go unseen.
    if (this.software) this.gl.readPixels(0, 0, 1, 1, this.gl.RGBA, this.gl.UNSIGNED_BYTE, PIXEL);
  }

  // The camera goes along with the robot, smoothly, and jumps with it.
  follow() {
    const now = performance.now(), { x, y } = this.robot.position, { target } = this.controls;
    const from = this.followedPoint ||= new Vector3(target.x, target.y, 0);
    const way = new Vector3(x - from.x, y - from.y, 0);
    way.multiplyScalar(way.length() > 1 ? 1 : 1 - Math.exp(((this.lastDraw || 0) - now) / 150));
    this.lastDraw = now;
    for (const moved of [from, target, this.camera.position]) moved.add(way);
    this.sun.target.position.set(x, y, 0);
    this.sun.position.set(x + 1.2, y + 0.9, 3.5);
    this.grid.position.set(Math.round(x), Math.round(y), 0.002);
    this.floor.position.set(x, y, 0);
  }

  // Fewer pixels where drawing them holds up the browser, as without a graphics card. Called at each
  // of its beats, also when there is nothing to draw: a robot that moves slowly is drawn as sharply.
  adaptResolution(now) {
    const passed = now - (this.lastFrame ?? now);
    this.lastFrame = now;
    if (passed > 0 && passed < 1000) this.framePeriod = 0.8 * (this.framePeriod ?? 33) + 0.2 * passed;
    if (this.framePeriod > 70) this.resolution = Math.max(MIN_RESOLUTION, 0.9 * this.resolution);
    else if (this.framePeriod < 40) this.resolution = Math.min(1, 1.01 * this.resolution);
  }

  // The arrow of a push, N and degrees from the world's x to its y; none without a force.
  showPush(force, direction) {
    if (!this.renderer) return;
    this.pushArrow.visible = force > 0;
    this.pushArrow.position.copy(this.robot.position);
    this.pushArrow.quaternion.setFromUnitVectors(
      UP, new Vector3(Math.cos(direction * RADIANS), Math.sin(direction * RADIANS), 0));
    this.pushArrow.scale.z = 0.15 + MAX_ARROW * force / MAX_PUSH;
  }

  // Shift and a drag on the robot push it, by the way that the pointer goes on the level.
  addListeners() {
    const { canvas, controls, camera } = this, ray = new Raycaster();
    const at = (event) => {
      const box = canvas.getBoundingClientRect();
      ray.setFromCamera(new Vector2(2 * (event.clientX - box.left) / box.width - 1,
        1 - 2 * (event.clientY - box.top) / box.height), camera);
      return ray;
    };
    let level = null, from = null, way = null;
    canvas.addEventListener('pointerdown', (event) => {
      const [hit] = event.shiftKey && this.pushable ? at(event).intersectObject(this.robot) : [];
      if (!hit) return;
      [from, way, level] = [hit.point, null, new Plane(UP, -hit.point.z)];
      controls.enabled = false;
      canvas.setPointerCapture(event.pointerId);
    }, { capture: true });
    canvas.addEventListener('pointermove', (event) => {
      const to = level && at(event).ray.intersectPlane(level, new Vector3());
      if (!to) return;
      to.sub(from);
      way = [Math.min(MAX_PUSH, MAX_PUSH * to.length() / MAX_ARROW), Math.atan2(to.y, to.x) / RADIANS];
      this.showPush(...way);
    });
    for (const kind of ['pointerup', 'pointercancel'])
      canvas.addEventListener(kind, () => {
        if (!level) return;
        level = null;
        controls.enabled = true;
        this.showPush(0, 0);
        if (way && kind === 'pointerup') this.push(...way);
      });
  }
}

// The robot in WebGL: links, their shadow on the floor, and the forces on its feet.
import { identity, lookAt, multiply, perspective } from './matrices.js';

const LIGHT = [0.35, 0.25, -1];
const LEAST = 0.7;      // fraction of the screen's pixels that are drawn at least, each way
const NEWTON = 0.0022;  // length of an arrow for each newton, m

const SOLID = [`#version 300 es
in vec3 place; in vec3 colour; uniform mat4 model, view, shadow; uniform vec4 flat_colour;
out vec3 at; out vec3 tint;
void main() { vec4 p = shadow * model * vec4(place, 1.0); at = p.xyz; tint = colour;
  gl_Position = view * p; }`, `#version 300 es
precision highp float; in vec3 at; in vec3 tint; uniform vec4 flat_colour; out vec4 seen;
void main() { vec3 n = normalize(cross(dFdx(at), dFdy(at)));
  float lit = 0.42 + 0.5 * max(dot(n, normalize(vec3(-0.35, -0.25, 1.0))), 0.0)
    + 0.12 * max(dot(n, normalize(vec3(0.8, 0.5, 0.3))), 0.0);
  seen = flat_colour.a > 0.0 ? flat_colour : vec4(tint * lit + 0.06, 1.0); }`];

const FLOOR = [`#version 300 es
in vec3 place; uniform mat4 view; uniform vec2 middle; out vec2 at;
void main() { at = place.xy + middle; gl_Position = view * vec4(at, 0.0, 1.0); }`,
`#version 300 es
precision highp float; in vec2 at; uniform vec3 floor_colour, line_colour, sky;
uniform vec2 middle; out vec4 seen;
void main() { vec2 w = fwidth(at) + 1e-5, cell = abs(fract(at * 2.0 - 0.5) - 0.5) / (2.0 * w);
  vec2 metre = abs(fract(at - 0.5) - 0.5) / w;
  float line = max(0.45 * (1.0 - min(min(cell.x, cell.y), 1.0)),
    1.0 - min(min(metre.x, metre.y) * 0.7, 1.0));
  float far = smoothstep(2.0, 7.5, distance(at, middle));
  seen = vec4(mix(mix(floor_colour, line_colour, line), sky, far), 1.0); }`];

const bytes = (text) => Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));

function arrow() {
  const out = [];
  const ring = (k, radius, z) => [radius * Math.cos(k * Math.PI / 5),
    radius * Math.sin(k * Math.PI / 5), z];
  for (let k = 0; k < 10; k++) {
    out.push(ring(k, 0.008, 0), ring(k + 1, 0.008, 0), ring(k + 1, 0.008, 0.8));
    out.push(ring(k, 0.008, 0), ring(k + 1, 0.008, 0.8), ring(k, 0.008, 0.8));
    out.push(ring(k, 0.022, 0.8), ring(k + 1, 0.022, 0.8), [0, 0, 1]);
  }
  return new Float32Array(out.flat());
}

export class Scene {
  constructor(canvas, camera, moved) {
    this.canvas = canvas;
    this.camera = camera;  // azimuth and elevation in degrees, distance in m
    this.moved = moved;
    this.target = [0, 0, 0.25];
    this.meshes = [];
    this.resolution = 1;
    this.gl = canvas.getContext('webgl2', { stencil: true, antialias: true });
    this.drag();
    if (!this.gl) return;
    this.solid = this.program(SOLID);
    this.ground = this.program(FLOOR);
    this.plane = this.mesh(new Float32Array([-9, -9, 0, 9, -9, 0, 9, 9, 0, -9, -9, 0, 9, 9, 0,
      -9, 9, 0]));
    this.arrow = this.mesh(arrow());
  }

  program(sources) {
    const gl = this.gl, made = gl.createProgram();
    [gl.VERTEX_SHADER, gl.FRAGMENT_SHADER].forEach((kind, k) => {
      const shader = gl.createShader(kind);
      gl.shaderSource(shader, sources[k]);
      gl.compileShader(shader);
      if (!gl.getShaderParameter(shader, gl.COMPILE_STATUS))
        throw new Error(gl.getShaderInfoLog(shader));
      gl.attachShader(made, shader);
    });
    gl.bindAttribLocation(made, 0, 'place');
    gl.bindAttribLocation(made, 1, 'colour');
    gl.linkProgram(made);
    const at = {}, count = gl.getProgramParameter(made, gl.ACTIVE_UNIFORMS);
    for (let k = 0; k < count; k++) {
      const { name } = gl.getActiveUniform(made, k);
      at[name] = gl.getUniformLocation(made, name);
    }
    return { made, at };
  }

  mesh(vertices, colours) {
    const gl = this.gl, array = gl.createVertexArray();
    gl.bindVertexArray(array);
    const fill = (k, data, kind, normalised) => {
      gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
      gl.bufferData(gl.ARRAY_BUFFER, data, gl.STATIC_DRAW);
      gl.enableVertexAttribArray(k);
      gl.vertexAttribPointer(k, 3, kind, normalised, 0, 0);
    };
    fill(0, vertices, gl.FLOAT, false);
    if (colours) fill(1, colours, gl.UNSIGNED_BYTE, true);
    gl.bindVertexArray(null);
    return { array, count: vertices.length / 3 };
  }

  show(body) {
    this.body = body;
    if (!this.gl) return;
    for (const { array } of this.meshes) this.gl.deleteVertexArray(array);
    this.meshes = body.shape.links.map((link) => this.mesh(
      new Float32Array(bytes(link.vertices).buffer), bytes(link.colours)));
  }

  colour(name) {
    const text = getComputedStyle(document.documentElement).getPropertyValue(name).trim();
    return [1, 3, 5].map((k) => parseInt(text.slice(k, k + 2), 16) / 255);
  }

  draw(forces) {
    const { gl, canvas, camera } = this;
    if (!gl) return;
    // One pixel for each of the screen's; the edges are smoothed by the context's antialiasing.
    const scale = this.resolution * Math.min(window.devicePixelRatio || 1, 3);
    const [wide, high] = [canvas.clientWidth, canvas.clientHeight].map((one) => one * scale | 0);
    if (canvas.width !== wide || canvas.height !== high)
      [canvas.width, canvas.height] = [wide, high];
    gl.viewport(0, 0, wide, high);
    const sky = this.colour('--sky');
    gl.clearColor(...sky, 1);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT | gl.STENCIL_BUFFER_BIT);
    if (this.body) {
      const [x, y] = this.body.middle;
      // The camera goes along; a jump of the robot is one of the camera.
      const now = performance.now(), passed = now - (this.drawn || 0);
      const step = Math.hypot(x - this.target[0], y - this.target[1]) > 1 ? 1
        : 1 - Math.exp(-passed / 150);
      this.drawn = now;
      this.target = [this.target[0] + step * (x - this.target[0]),
        this.target[1] + step * (y - this.target[1]), 0.22];
    }
    const [azimuth, elevation] = [camera.azimuth, camera.elevation].map((a) => a * Math.PI / 180);
    const away = camera.distance;
    const eye = [this.target[0] + away * Math.cos(elevation) * Math.cos(azimuth),
      this.target[1] + away * Math.cos(elevation) * Math.sin(azimuth),
      this.target[2] + away * Math.sin(elevation)];
    const view = multiply(perspective(0.7, wide / high, 0.05, 40), lookAt(eye, this.target));
    gl.enable(gl.DEPTH_TEST);
    gl.useProgram(this.ground.made);
    gl.uniformMatrix4fv(this.ground.at.view, false, view);
    gl.uniform2f(this.ground.at.middle, this.target[0], this.target[1]);
    gl.uniform3fv(this.ground.at.floor_colour, this.colour('--floor'));
    gl.uniform3fv(this.ground.at.line_colour, this.colour('--floor-line'));
    gl.uniform3fv(this.ground.at.sky, sky);
    gl.bindVertexArray(this.plane.array);
    gl.drawArrays(gl.TRIANGLES, 0, 6);
    if (!this.body) return;
    gl.useProgram(this.solid.made);
    gl.uniformMatrix4fv(this.solid.at.view, false, view);
    this.shade();
    gl.uniformMatrix4fv(this.solid.at.shadow, false, identity());
    gl.uniform4f(this.solid.at.flat_colour, 0, 0, 0, 0);
    this.links();
    gl.uniform4f(this.solid.at.flat_colour, ...this.colour('--good'), 1);
    for (const [leg, force] of Object.entries(forces || {})) {
      if (!(force > 1) || !this.body.shape.feet[leg]) continue;
      const [x, y, z] = this.body.foot(leg), model = identity();
      model[10] = force * NEWTON;
      [model[12], model[13], model[14]] = [x, y, z];
      gl.uniformMatrix4fv(this.solid.at.model, false, model);
      gl.bindVertexArray(this.arrow.array);
      gl.drawArrays(gl.TRIANGLES, 0, this.arrow.count);
    }
  }

  // Fewer pixels where drawing them holds up the browser, as without a graphics card. Called at each
  // of its beats, also when there is nothing to draw: a robot that moves slowly is drawn as sharply.
  beat(now) {
    const passed = now - (this.before ?? now);
    this.before = now;
    if (passed > 0 && passed < 1000) this.pace = 0.8 * (this.pace ?? 33) + 0.2 * passed;
    if (this.pace > 70) this.resolution = Math.max(LEAST, 0.9 * this.resolution);
    else if (this.pace < 40) this.resolution = Math.min(1, 1.01 * this.resolution);
  }

  // Every pixel of the floor is darkened once, however many links are above it.
  shade() {
    const { gl } = this, [x, y, z] = LIGHT;
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.SRC_ALPHA, gl.ONE_MINUS_SRC_ALPHA);
    gl.enable(gl.STENCIL_TEST);
    gl.stencilFunc(gl.EQUAL, 0, 255);
    gl.stencilOp(gl.KEEP, gl.KEEP, gl.INCR);
    gl.uniformMatrix4fv(this.solid.at.shadow, false, new Float32Array([1, 0, 0, 0, 0, 1, 0, 0,
      -x / z, -y / z, 0, 0, 0, 0, 0.002, 1]));
    gl.uniform4f(this.solid.at.flat_colour, 0, 0, 0, 0.3);
    this.links();
    gl.disable(gl.STENCIL_TEST);
    gl.disable(gl.BLEND);
  }

  links() {
    const { gl } = this;
    this.meshes.forEach((mesh, k) => {
      if (!mesh.count) return;
      gl.uniformMatrix4fv(this.solid.at.model, false, this.body.worlds[k]);
      gl.bindVertexArray(mesh.array);
      gl.drawArrays(gl.TRIANGLES, 0, mesh.count);
    });
  }

  drag() {
    const { canvas, camera } = this, fingers = new Map();
    let apart = 0;
    const zoom = (factor) => {
      camera.distance = Math.min(8, Math.max(0.5, camera.distance * factor));
      this.moved();
    };
    canvas.addEventListener('pointerdown', (event) => {
      canvas.setPointerCapture(event.pointerId);
      fingers.set(event.pointerId, [event.clientX, event.clientY]);
      apart = 0;
    });
    canvas.addEventListener('pointermove', (event) => {
      const before = fingers.get(event.pointerId);
      if (!before) return;
      fingers.set(event.pointerId, [event.clientX, event.clientY]);
      if (fingers.size === 2) {
        const [a, b] = [...fingers.values()], now = Math.hypot(a[0] - b[0], a[1] - b[1]);
        if (apart) zoom(apart / now);
        apart = now;
        return;
      }
      camera.azimuth = (camera.azimuth - 0.4 * (event.clientX - before[0])) % 360;
      camera.elevation = Math.min(85, Math.max(3, camera.elevation
        + 0.4 * (event.clientY - before[1])));
      this.moved();
    });
    for (const kind of ['pointerup', 'pointercancel'])
      canvas.addEventListener(kind, (event) => fingers.delete(event.pointerId));
    canvas.addEventListener('wheel', (event) => {
      event.preventDefault();
      zoom(Math.exp(0.001 * event.deltaY));
    }, { passive: false });
  }
}

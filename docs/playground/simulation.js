// Copyright 2026 cpg_ros maintainers
// SPDX-License-Identifier: Apache-2.0
//
// A network with its history: the classical Runge-Kutta method with a ring of nodes, cubics in
// between, and the symmetry lock, as dynamics/integration/stepper.py has them.
'use strict';

class Simulation {
  constructor(network, gait) {
    this.network = network;
    this.cells = network.cells;
    this.size = network.cells * network.states.length;
    this.h = network.step;
    this.equations = network.equations(network.cells);
    this.values = {...gait.values};
    this.gait = gait;
    const longest = network.delay ? network.ranges[network.delay][1] : 0;
    this.nodes = Math.max(2, Math.ceil(longest / this.h) + 2);
    const make = (n) => new Float64Array(n);
    this.x = make(this.nodes * this.size);
    this.slope = make(this.nodes * this.size);
    this.before = make(this.size);
    this.carry = make(this.size);
    this.driven = make(Math.max(1, this.equations.driven) * this.cells);
    [this.past, this.z, this.k2, this.k3, this.k4] = [0, 0, 0, 0, 0].map(() => make(this.size));
    this.p = make(network.p.length);
    this.head = this.nodes - 1;
    this.kink = -1;
    this.time = 0;
    this.readParameters();
    this.seed();
  }

  clone() {
    const other = new Simulation(this.network, this.gait);
    for (const name of ['x', 'slope', 'before', 'carry']) {
      other[name].set(this[name]);
    }
    Object.assign(other, {head: this.head, kink: this.kink, time: this.time,
                          values: {...this.values}});
    other.readParameters();
    return other;
  }

  readParameters() {
    this.network.p.forEach((name, k) => { this.p[k] = this.values[name]; });
    this.delay = this.network.delay ? this.values[this.network.delay] / this.h : 0;
  }

  set(name, value) {
    this.values[name] = value;
    this.readParameters();
    this.restart();
  }

  // The orbit's past, its newest node at phase 0.
  seed() {
    const {gait, size, cells, h} = this;
    for (let node = 0; node < this.nodes; node++) {
      const at = (node - (this.nodes - 1)) * h / gait.period;
      for (let i = 0; i < size; i++) {
        const cell = i % cells;
        const k = node * size + i;
        if (!gait.history) {
          this.x[k] = gait.start[i];
          continue;
        }
        const table = gait.history[gait.waves[cell]][Math.floor(i / cells)];
        const place = ((at + gait.phases[cell]) % 1 + 1) % 1 * table.length;
        const low = Math.min(table.length - 1, Math.floor(place));
        const [a, da] = table[low];
        const [b, db] = table[(low + 1) % table.length];
        const t = place - low;
        const c2 = 3 * (b - a) - 2 * da - db;
        const c3 = da + db - 2 * (b - a);
        this.x[k] = a + t * (da + t * (c2 + t * c3));
        this.slope[k] = (da + t * (2 * c2 + 3 * c3 * t)) * table.length / gait.period;
      }
    }
    this.restart();
  }

  pastState(back, out) {
    const n = Math.max(1, Math.ceil(back));
    const {size, nodes, x, slope} = this;
    const start = (this.head - n + nodes) % nodes;
    const end = (start + 1) % nodes;
    const s = n - back;
    const h11 = s * s * (s - 1) * this.h;
    const h10 = s * (s - 1) * (s - 1) * this.h;
    const h01 = s * s * (3 - 2 * s);
    const arriving = end === this.kink ? this.before : slope;
    const offset = end === this.kink ? 0 : end * size;
    for (let i = 0; i < size; i++) {
      out[i] = (1 - h01) * x[start * size + i] + h10 * slope[start * size + i]
             + h01 * x[end * size + i] + h11 * arriving[offset + i];
    }
  }

  updateDrive(c) {
    if (this.equations.drive) {
      this.pastState(this.delay - c, this.past);
      this.equations.drive(this.past, this.p, this.driven);
    }
  }

  // Rates at x + weight k, from places in x and k on, into out from a place on.
  rates(x, from, weight, k, kFrom, out, to) {
    const {z, size, gait} = this;
    for (let i = 0; i < size; i++) {
      z[i] = x[from + i] + weight * k[kFrom + i];
    }
    const target = out.subarray(to, to + size);
    this.equations.field(z, this.driven, this.p, target);
    if (gait.gain > 0) {
      for (let i = 0; i < size; i++) {
        target[i] -= gait.gain * z[i];
      }
      for (const row of gait.basis) {
        let sum = 0;
        for (let i = 0; i < size; i++) {
          sum += row[i] * z[i];
        }
        for (let i = 0; i < size; i++) {
          target[i] += gait.gain * sum * row[i];
        }
      }
    }
  }

  // After parameters have changed the newest node has two slopes.
  restart() {
    const at = this.head * this.size;
    if (this.kink !== this.head) {
      this.before.set(this.slope.subarray(at, at + this.size));
      this.kink = this.head;
    }
    this.updateDrive(0);
    this.rates(this.x, at, 0, this.before, 0, this.slope, at);
  }

  step() {
    const {size, h, x, slope, k2, k3, k4, carry} = this;
    const now = this.head * size;
    const next = (this.head + 1) % this.nodes;
    const to = next * size;
    this.updateDrive(0.5);
    this.rates(x, now, 0.5 * h, slope, now, k2, 0);
    this.rates(x, now, 0.5 * h, k2, 0, k3, 0);
    this.updateDrive(1);
    this.rates(x, now, h, k3, 0, k4, 0);
    for (let i = 0; i < size; i++) {
      const value = h / 6 * (slope[now + i] + 2 * (k2[i] + k3[i]) + k4[i]) - carry[i];
      const sum = x[now + i] + value;
      carry[i] = (sum - x[now + i]) - value;
      x[to + i] = sum;
    }
    if (this.kink === next) {
      this.kink = -1;
    }
    this.rates(x, to, 0, k4, 0, slope, to);
    this.head = next;
    this.time += h;
  }

  value(i) {
    return this.x[this.head * this.size + i];
  }

  rate(i) {
    return this.slope[this.head * this.size + i];
  }

  // Time at which a component rose through a level within the last step, or NaN.
  crossing(i, level) {
    const last = (this.head - 1 + this.nodes) % this.nodes;
    const [a, b] = [this.x[last * this.size + i], this.value(i)];
    if (!(a < level && b >= level)) {
      return NaN;
    }
    const [da, db] = [this.slope[last * this.size + i] * this.h, this.rate(i) * this.h];
    const c2 = 3 * (b - a) - 2 * da - db;
    const c3 = da + db - 2 * (b - a);
    let [low, high] = [0, 1];
    for (let n = 0; n < 60; n++) {
      const t = 0.5 * (low + high);
      if (a + t * (da + t * (c2 + t * c3)) < level) { low = t; } else { high = t; }
    }
    return this.time - this.h * (1 - low);
  }
}

// Mean period of a cell over so many strides, after as many to settle; NaN if it does not swing.
function measurePeriod(simulation, strides) {
  const times = [];
  const level = simulation.gait.levels[simulation.gait.waves[0]];
  const maxSteps = 4 * strides * simulation.gait.period / simulation.h;
  for (let n = 0; n < maxSteps && times.length <= 2 * strides; n++) {
    simulation.step();
    const time = simulation.crossing(0, level);
    if (time === time) {
      times.push(time);
    }
  }
  return times.length > 2 * strides ? (times[2 * strides] - times[strides]) / strides : NaN;
}

// Whether a swing of at least a fiftieth of the gait's is left after so many strides.
function persists(simulation, name, value, strides) {
  const run = simulation.clone();
  run.set(name, value);
  const nominal = Math.max(...run.gait.range);
  const steps = Math.round(strides * run.gait.period / run.h);
  const swings = [];
  for (let part = 0; part < 4; part++) {
    let [low, high] = [Infinity, -Infinity];
    for (let n = 0; n < steps / 4; n++) {
      run.step();
      low = Math.min(low, run.value(0));
      high = Math.max(high, run.value(0));
    }
    swings.push(high - low);
    if (!(swings[part] > 0.02 * nominal) || !Number.isFinite(swings[part])) {
      return false;
    }
  }
  return swings[3] > 0.5 * nominal || swings[3] > 0.93 * swings[2];
}

// Copyright 2026 cpg_ros maintainers
// SPDX-License-Identifier: Apache-2.0
//
// What joints and feet do while a network runs: each cell's phase is counted from where it last rose
// through the middle of its swing, and joints are read off their tables at that phase.
'use strict';

const UPPER = 0.2;  // length of each link, m
const CONTACT = 0.015;  // a foot this close to the lowest one is on the ground, m

class Walker {
  constructor(network, gait) {
    Object.assign(this, {network, gait, distance: 0, feet: {}, stance: {}});
    this.hipless = !network.robot.some((joint) => /hip|thigh|coxa|femur|tarsal/.test(joint.name));
    this.crossings = Array.from({length: network.cells}, () => []);
    this.low = new Float64Array(network.cells).fill(Infinity);
    this.high = new Float64Array(network.cells).fill(-Infinity);
    this.swing = gait.waves.map((wave) => gait.range[wave]);
    this.middle = gait.waves.map((wave) => gait.levels[wave]);
    this.timeSince = this.change = 0;
  }

  // To be called after each step.
  observe(simulation) {
    for (let cell = 0; cell < this.network.cells; cell++) {
      const value = simulation.value(cell);
      this.low[cell] = Math.min(this.low[cell], value);
      this.high[cell] = Math.max(this.high[cell], value);
      const time = simulation.crossing(cell, this.middle[cell]);
      const last = this.crossings[cell];
      const far = last.length > 1 ? 0.6 * (last.at(-1) - last.at(-2)) : 0.2 * this.gait.period;
      if (time === time && (!last.length || time - last.at(-1) > far)) {
        last.push(time);
        if (last.length > 12) { last.shift(); }
      }
    }
    // Swings and their middles are of the last one and a half strides or so.
    this.timeSince += simulation.h;
    if (this.timeSince > 1.5 * (this.period() || this.gait.period)) {
      this.change = (this.high[0] - this.low[0]) / this.swing[0] - 1;
      for (let cell = 0; cell < this.network.cells; cell++) {
        this.swing[cell] = this.high[cell] - this.low[cell];
        this.middle[cell] = 0.5 * (this.high[cell] + this.low[cell]);
        this.low[cell] = Infinity;
        this.high[cell] = -Infinity;
      }
      this.timeSince = 0;
    }
  }

  period() {
    const last = this.crossings[0];
    return last.length > 1 ? last.at(-1) - last.at(-2) : NaN;
  }

  phase(cell, time) {
    const last = this.crossings[cell];
    if (!last.length) { return this.gait.phases[cell] + time / this.gait.period; }
    const own = last.length > 1 ? last.at(-1) - last.at(-2) : this.gait.period;
    return this.gait.rising[this.gait.waves[cell]] + Math.min(1, (time - last.at(-1)) / own);
  }

  // Phases of the legs in cycles, after the first one.
  legs(time) {
    const {network, gait} = this;
    const names = Object.keys(network.legs);
    const phases = names.map((leg, n) => this.phase(network.legs[leg], time)
      - gait.phases[network.legs[leg]] + gait.legs[n]);
    return phases.map((phase) => (((phase - phases[0]) % 1) + 1) % 1);
  }

  angles(time) {
    const {network, gait} = this;
    return network.robot.map((joint, n) => {
      const table = gait.tables[gait.joints[n]];
      const place = ((this.phase(joint.cell, time) % 1) + 1) % 1 * table.length;
      const low = Math.floor(place) % table.length;
      const value = table[low] + (place - Math.floor(place))
        * (table[(low + 1) % table.length] - table[low]);
      const ratio = this.swing[joint.cell] / gait.range[gait.waves[joint.cell]];
      return gait.stand[n] + value * Math.min(1.2, ratio || 0);
    });
  }

  // Points of each leg from its hip, forward and up, and how far the body went.
  move(time) {
    const {network} = this;
    const angles = this.angles(time);
    const legs = {};
    network.robot.forEach((joint, n) => {
      // The joint that turns a leg sideways is not seen from the side.
      if (!/abduction|hip_joint$/.test(joint.name) || network.robot.length <= 8) {
        (legs[joint.leg] = legs[joint.leg] || []).push(angles[n]);
      }
    });
    const points = {};
    for (const [leg, turns] of Object.entries(legs)) {
      let [x, z, sum] = [0, 0, 0];
      if (this.hipless) {
        // The file says nothing of a hip: the foot stays below it.
        turns.splice(0, 2, -0.5 * turns[0], turns[0]);
      }
      points[leg] = [[0, 0]];
      turns.slice(0, 2).forEach((turn) => {
        sum += turn;
        x -= UPPER * Math.sin(sum);
        z -= UPPER * Math.cos(sum);
        points[leg].push([x, z]);
      });
    }
    const lowest = Math.min(...Object.values(points).map((line) => line.at(-1)[1]));
    let [motion, count] = [0, 0];
    for (const [leg, line] of Object.entries(points)) {
      const [x, z] = line.at(-1);
      const inStance = z < lowest + CONTACT;
      if (inStance && this.stance[leg]) {
        motion -= x - this.feet[leg];
        count++;
      }
      this.feet[leg] = x;
      this.stance[leg] = inStance;
    }
    this.distance += count ? motion / count : 0;
    return {points, lowest};
  }
}

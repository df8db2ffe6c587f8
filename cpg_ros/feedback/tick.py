# Copyright 2026 cpg_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""One tick of the feedback, compiled: all laws together, run by run and leg by leg."""

import math
from typing import NamedTuple

from cpg_ros.feedback import (
    heading,
    pace,
    placement,
    posture,
    reflexes,
    sidestep,
    slope,
    speed,
    tegotae,
    touchdown,
)
from cpg_ros.feedback.efference_copy import expect, SIGNALS
from cpg_ros.feedback.estimate import update
from cpg_ros.feedback.kinematics import foot_of, move_foot
from cpg_ros.feedback.timetable import POINTS
from cpg_ros.integration.jit import entry, jit
from cpg_ros.motion.strides import approach
import numpy as np

#: Joints are where they are told to be a little later: corrections come ahead by this, cycles.
LEAD = 0.04


class Memory(NamedTuple):
    """What the feedback keeps from tick to tick, of each run.

    Attributes:
        velocity: of the base in its own frame, m/s, shape (runs, 3).
        contact: whether each foot is on the ground, shape (runs, legs).
        way: by which each foot is moved now, m, shape (runs, legs, 3).
        stepped: of that, by placement, shape (runs, legs, 2).
        carried: of that, by the sidestep, shape (runs, legs).
        built: by reflexes, see reflexes, shape (runs, legs, 5).
        ground: low-passed roll and pitch, rad, shape (runs, 2).
        missed: integral of the missing speed, m, shape (runs,).
        aside: asked of the feet beyond the sideways speed that is wanted, m/s, shape (runs,).
        stride: to be added to each leg's stride, shape (runs, legs).
        hurry: factor of the stride frequency, shape (runs,).
        fatigue: low-passed share by which it was above 1 for pushes, shape (runs,).
        phase: of the first leg at the last tick, cycles, shape (runs,).
        owed: by the touchdown reset to the phase, cycles, shape (runs,).
        asked: wanted speed forward and to the left as it is approached, m/s, and in a second row
            its rates, m/s^2, shape (runs, 2, 2).
        landed, seen, scratch, own: for passing on within a tick.

    """

    velocity: np.ndarray
    contact: np.ndarray
    way: np.ndarray
    stepped: np.ndarray
    carried: np.ndarray
    built: np.ndarray
    ground: np.ndarray
    missed: np.ndarray
    aside: np.ndarray
    stride: np.ndarray
    hurry: np.ndarray
    fatigue: np.ndarray
    phase: np.ndarray
    owed: np.ndarray
    asked: np.ndarray
    landed: np.ndarray
    seen: np.ndarray
    scratch: np.ndarray
    own: np.ndarray

    @classmethod
    def empty(cls, runs: int, legs: int) -> 'Memory':
        """Remember nothing."""
        return cls(np.zeros((runs, 3)), np.zeros((runs, legs), dtype=bool),
                   np.zeros((runs, legs, 3)), np.zeros((runs, legs, 2)), np.zeros((runs, legs)),
                   np.zeros((runs, legs, 5)), np.zeros((runs, 2)), np.zeros(runs),
                   np.zeros(runs), np.zeros((runs, legs)), np.ones(runs), np.zeros(runs),
                   np.zeros(runs), np.zeros(runs), np.zeros((runs, 2, 2)),
                   np.zeros(legs, dtype=bool), np.zeros((legs, 4)), np.zeros((5, 3)),
                   np.zeros(SIGNALS))


@jit
def _steer(tables, slot, sides, gains, memory, run, missing, wanted, course, yaw, dt, share):
    """Work out what is added to strides."""
    stride = memory.stride[run]
    stride[:] = 0.0
    if not tables.steered[slot]:
        return
    longer = uneven = 0.0
    if gains.speed:
        memory.missed[run] = speed.gather(memory.missed[run], missing, gains, share * dt)
        longer = share * speed.longer(missing, memory.missed[run], gains)
    if gains.heading:
        at, turn, k = tables.at[slot], tables.turn[slot], 0
        while k + 2 < at.shape[0] and wanted > at[k + 1]:
            k += 1
        gap = at[k + 1] - at[k]
        up = min(max((wanted - at[k]) / gap, 0.0), 1.0) if gap > 0.0 else 0.0
        rate = turn[k] + up * (turn[k + 1] - turn[k])
        uneven = share * heading.turn(course, yaw, gains) / rate
    for leg in range(stride.shape[0]):
        stride[leg] = longer + uneven * sides[leg]


@entry
def tick(rows, columns, radius, weight, gains, tables, sides, memory, angles, rates, loads,
         lean, turning, push, planned, phases, gaits, mix, wanted, course, dt, share, level,
         out):
    """Correct planned angles; arguments as of Feedback.advance, out is filled."""
    quick = 1.0 - math.exp(-dt / gains.smooth)
    own, foot, feet = memory.own, memory.scratch[0], memory.seen
    for run in range(planned.shape[0]):
        memory.landed[:] = memory.contact[run]
        update(rows, columns, radius, weight, angles[run], rates[run], loads[run], lean[run],
               turning[run], push[run], dt, memory.velocity[run], memory.contact[run],
               memory.seen, memory.scratch)
        old, new = gaits[run, 0], gaits[run, 1]
        slot = new if mix[run] > 0.5 else old
        # What is wished for is approached as strides are.
        approach(wanted[run], wanted[run, :0], dt, memory.asked[run, 0], memory.asked[run, 1])
        phase = phases[run]
        forward, left = memory.asked[run, 0, 0], memory.asked[run, 0, 1]
        own[:] = 0.0
        expect(tables.speeds[old], tables.expected[old], phase, forward, 1.0 - mix[run], own)
        if mix[run] > 0.0:
            expect(tables.speeds[new], tables.expected[new], phase, forward, mix[run], own)
        for k in range(SIGNALS):
            own[k] *= level
        vx = memory.velocity[run, 0] - own[0]
        vy = memory.velocity[run, 1] - own[1] - left
        wx, wy = turning[run, 0] - own[2], turning[run, 1] - own[3]
        roll, pitch = lean[run, 0] - own[4], lean[run, 1] - own[5]

        # Feet that land together pitch and roll the body wherever they are put: of the laws
        # that move feet or change the pace, only posture helps a hop.
        turns = tables.turns[old] + mix[run] * (tables.turns[new] - tables.turns[old])
        ground = memory.ground[run]
        ground[0] = slope.follow(ground[0], roll, gains, dt)
        ground[1] = slope.follow(ground[1], pitch, gains, dt)
        uphill_x = uphill_y = 0.0
        if gains.slope:
            uphill_x = turns * slope.shift(ground[1], gains)
            uphill_y = -turns * slope.shift(ground[0], gains)
        step_x = placement.step(vx, wy, gains.step, gains.step_pitch_rate, gains)
        step_y = placement.step(vy, wx, gains.step_left, gains.step_roll_rate, gains)
        memory.aside[run] = sidestep.gather(memory.aside[run], -vy, left, gains, share * dt)
        sideways = left + memory.aside[run]
        strode = (phase - memory.phase[run] + 0.5) % 1.0 - 0.5
        memory.phase[run] = phase
        row = int((phase + LEAD) % 1.0 * POINTS) % POINTS
        now = int(phase % 1.0 * POINTS) % POINTS
        out[run] = planned[run]
        leaning, standing, mean_x, mean_y = 0.0, 0, 0.0, 0.0
        for leg in range(rows.shape[0]):
            hip, thigh, calf = columns[leg, 0], columns[leg, 1], columns[leg, 2]
            feet[leg, 0], feet[leg, 1], feet[leg, 2] = foot_of(
                rows[leg], planned[run, hip], planned[run, thigh], planned[run, calf])
            if not tables.swinging[slot, row, leg]:
                standing, mean_x, mean_y = (standing + 1, mean_x + feet[leg, 0],
                                            mean_y + feet[leg, 1])
        mean_x, mean_y = mean_x / max(standing, 1), mean_y / max(standing, 1)
        for leg in range(rows.shape[0]):
            foot[0], foot[1], foot[2] = feet[leg, 0], feet[leg, 1], feet[leg, 2]
            swinging = tables.swinging[slot, row, leg]
            x, y, z = uphill_x, uphill_y, 0.0
            if gains.posture:
                if swinging:
                    # A hop lands on legs that a falling nose would draw in.
                    z = turns * posture.in_swing(foot[0], foot[1], roll - ground[0],
                                                 pitch - ground[1], gains)
                else:
                    # About the middle of the feet that stand: the body is tilted, not raised.
                    z = posture.in_stance(foot[0] - mean_x, foot[1] - mean_y, roll, pitch, wx,
                                          wy, gains)
            if gains.placement:
                stepped = memory.stepped[run, leg]
                if swinging:
                    stepped[0] = placement.swing(stepped[0], step_x, gains, dt)
                    stepped[1] = placement.swing(stepped[1], step_y, gains, dt)
                else:
                    stepped[0] = placement.stand(stepped[0], gains.give * vx, gains, dt)
                    stepped[1] = placement.stand(stepped[1], gains.give_left * vy, gains, dt)
                x, y = x + turns * stepped[0], y + turns * stepped[1]
            if gains.sidestep:
                carried = memory.carried[run, leg]
                if swinging:
                    stance = tables.duty[slot, leg] * dt / max(strode, 0.1 * dt)
                    landing = sidestep.landing(sideways, stance, gains)
                    carried = placement.swing(carried, landing, gains, dt)
                else:
                    carried = sidestep.carry(carried, sideways, gains, dt)
                memory.carried[run, leg] = carried
                y += carried
            if gains.reflexes:
                z += turns * reflexes.advance(
                    memory.built[run, leg], memory.contact[run, leg],
                    tables.swinging[slot, now, leg], tables.progress[slot, now, leg], foot[2],
                    (roll - ground[0]) * foot[1] - (pitch - ground[1]) * foot[0], gains, dt)
            if gains.tegotae:
                leaning += tegotae.rate(max(loads[run, leg], 0.0) / weight,
                                        tables.swinging[slot, now, leg],
                                        tables.progress[slot, now, leg], gains)
            if gains.touchdown and memory.contact[run, leg] and not memory.landed[leg]:
                memory.owed[run] += touchdown.change(
                    tables.swinging[slot, now, leg], tables.progress[slot, now, leg],
                    tables.duty[slot, leg], gains) / rows.shape[0]
            way = memory.way[run, leg]
            way[0] += quick * (share * x - way[0])
            way[1] += quick * (share * y - way[1])
            way[2] += quick * (share * z - way[2])
            move_foot(rows[leg], columns[leg], out[run], foot, way)
        memory.hurry[run] = 1.0
        if gains.pace:
            memory.hurry[run] += share * turns * pace.hurry(vy, memory.fatigue[run], gains)
        memory.fatigue[run] = pace.tire(memory.fatigue[run], memory.hurry[run] - 1.0, gains,
                                        dt)
        frequency = max(strode / dt, 0.1)
        memory.hurry[run] += share * leaning / (2.0 * math.pi * frequency * rows.shape[0])
        if gains.touchdown:
            more = share * touchdown.hurry(memory.owed[run], frequency)
            memory.owed[run] -= more * strode
            memory.hurry[run] += more
        memory.hurry[run] = max(memory.hurry[run], 0.2)
        _steer(tables, slot, sides, gains, memory, run, -vx, forward, course[run],
               lean[run, 2], dt, share)

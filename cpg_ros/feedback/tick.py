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

from cpg_ros.dynamics.integration.compilation import jit, jit_entry
from cpg_ros.feedback.efference_copy import expect, SIGNALS
from cpg_ros.feedback.estimate import update
from cpg_ros.feedback.gait_tables import NUM_PHASES
from cpg_ros.feedback.kinematics import foot_of, move_foot, wrapped
from cpg_ros.feedback.laws import (
    clearance,
    heading,
    pace,
    placement,
    posture,
    reflexes,
    sidestep,
    slope,
    speed,
    stiffen,
    virtual_stiffness,
)
from cpg_ros.feedback.laws.law import limited, low_passed
import numpy as np

#: PHASE_LEAD: phase by which corrections lead the pattern, cycles, as joints lag behind their
#: commands.
PHASE_LEAD = 0.04
#: APPROACH_TIME: time constant with which the wanted velocity is approached, s.
APPROACH_TIME = 0.2


class PlannedMotion(NamedTuple):
    """Plan of the pattern and commands, for each run.

    Attributes:
        angles: of the joints, rad, shape (runs, joints).
        phase: of the first leg, cycles, shape (runs,).
        gaits: slots of the gait that is left and of the entered one, shape (runs, 2).
        mix: fraction of the entered gait, shape (runs,).
        velocity: wanted forward and to the left, m/s, shape (runs, 2).
        heading: wanted, rad, shape (runs,).
        turn: wanted yaw rate, rad/s, shape (runs,).
        lean: wanted roll, pitch and yaw of the body against its feet, rad, shape (runs, 3).

    """

    angles: np.ndarray
    phase: np.ndarray
    gaits: np.ndarray
    mix: np.ndarray
    velocity: np.ndarray
    heading: np.ndarray
    turn: np.ndarray
    lean: np.ndarray

    @classmethod
    def zeros(cls, runs: int, joints: int) -> 'PlannedMotion':
        """Return zeros to fill in place."""
        return cls(np.zeros((runs, joints)), np.zeros(runs), np.zeros((runs, 2), dtype=np.int64),
                   np.zeros(runs), np.zeros((runs, 2)), np.zeros(runs), np.zeros(runs),
                   np.zeros((runs, 3)))


class Deviation(NamedTuple):
    """Deviation of the body's motion from the expected one: m/s, rad/s, rad."""

    vx: float
    vy: float
    wx: float
    wy: float
    roll: float
    pitch: float


class Intent(NamedTuple):
    """Motion of all feet of a run that the laws request; pairs are forward and to the left.

    Attributes:
        alternates: 1 where left and right legs alternate, 0 where they hop.
        singly: 1 where legs swing one by one, 0 where two or more swing at a time.
        roll, pitch: deviation from the slope of the ground, rad.
        uphill: displacement of all feet, m, a pair.
        further: how much further to put feet down, m, a pair.
        yielded: speeds to which feet in stance yield, m/s, a pair.
        sideways: wanted speed to the left, m/s.
        strode: cycles since the last tick.
        stiffness: factor of the servos' proportional gain at the wanted speed.
        error: velocity error, as pace has it, m/s.

    """

    alternates: float
    singly: float
    roll: float
    pitch: float
    uphill: tuple[float, float]
    further: tuple[float, float]
    yielded: tuple[float, float]
    sideways: float
    strode: float
    stiffness: float
    error: float


@jit
def _approach(target, dt, now, rate):
    """Advance a velocity and its rate by dt in s towards a target, as cpg_steer does strides."""
    decay = math.exp(-dt / APPROACH_TIME)
    for k in range(len(now)):
        gap = now[k] - target[k]
        pull = rate[k] + gap / APPROACH_TIME
        now[k] = target[k] + (gap + pull * dt) * decay
        rate[k] = (rate[k] - pull * dt / APPROACH_TIME) * decay


@jit
def _deviation(tables, memory, sensors, planned, run, level):
    """Return the deviation from the gaits' efference copies and the wanted sideways speed."""
    old, new, mix = planned.gaits[run, 0], planned.gaits[run, 1], planned.mix[run]
    phase, forward = planned.phase[run], memory.wanted_velocity[run, 0, 0]
    expected, turning, rpy = memory.expected, sensors.angular_velocity[run], sensors.rpy[run]
    expected[:] = 0.0
    expect(tables.speeds[old], tables.expected[old], phase, forward, 1.0 - mix, expected)
    if mix > 0.0:
        expect(tables.speeds[new], tables.expected[new], phase, forward, mix, expected)
    for k in range(SIGNALS):
        expected[k] *= level
    left, lean = memory.wanted_velocity[run, 0, 1], planned.lean[run]
    return Deviation(memory.velocity[run, 0] - expected[0],
                     memory.velocity[run, 1] - expected[1] - left,
                     turning[0] - expected[2], turning[1] - expected[3],
                     rpy[0] - expected[4] - lean[0], rpy[1] - expected[5] - lean[1])


@jit
def _possible_speed(tables, memory, run, slot):
    """Return the wanted forward speed as far as steering goes, m/s."""
    return limited(memory.wanted_velocity[run, 0, 0], tables.at[slot, -1])


@jit
def _change_strides(tables, gains, memory, run, slot, missing, turned, step):
    """Fill the changes of the strides; missing speed in m/s, missing heading in rad.

    Returns:
        Relative increase of their frequency, where they cannot be as long as the speed takes.

    """
    stride, (dt, fraction, _, _) = memory.stride[run], step
    stride[:] = 0.0
    if not tables.steered[slot]:
        return 0.0
    longer = uneven = faster = 0.0
    if gains.speed:
        memory.speed_integral[run] = speed.integrate(memory.speed_integral[run], missing, gains,
                                                     fraction * dt)
        longer = fraction * speed.stride_change(missing, memory.speed_integral[run], gains)
    if gains.heading:
        rate = heading.response(tables.at[slot], tables.turn[slot],
                                memory.wanted_velocity[run, 0, 0])
        memory.heading_integral[run] = integral = heading.integrate(
            memory.heading_integral[run], turned, gains, fraction * dt)
        # The faster it runs, the sooner a heading error carries it off its line.
        hurry = max(_possible_speed(tables, memory, run, slot) / sidestep.FAST_SPEED, 1.0)
        uneven = fraction * hurry * heading.yaw_rate(turned, integral, gains) / rate
        length = heading.response(tables.at[slot], tables.length[slot],
                                  memory.wanted_velocity[run, 0, 0])
        # No stride is longer than 1: turning back comes before speed.
        room = max(1.0 - 0.5 * abs(uneven), 0.0)
        # What lasts: a clock that follows each sway shakes the body where sensors are late.
        lasting = length + fraction * gains.speed_rate * memory.speed_integral[run]
        faster = limited(max(lasting - room, 0.0), gains.speed_faster)
        longer = limited(length + longer, room) - length
    for leg in range(stride.shape[0]):
        stride[leg] = longer + uneven * tables.sides[leg]
    return faster


@jit
def _stiffness(tables, planned, run, speed):
    """Return the factor of the servos' proportional gain at a forward speed, m/s."""
    old, new = planned.gaits[run, 0], planned.gaits[run, 1]
    before = heading.response(tables.at[old], tables.stiffness[old], speed)
    after = heading.response(tables.at[new], tables.stiffness[new], speed)
    return before + planned.mix[run] * (after - before)


@jit
def _intend(tables, gains, memory, planned, run, off, step):
    """Return the slot of the gait and the Intent of a run; advance the filters behind them."""
    old, new, mix, (dt, fraction, _, _) = (planned.gaits[run, 0], planned.gaits[run, 1],
                                           planned.mix[run], step)
    slot = new if mix > 0.5 else old
    phase, left = planned.phase[run], memory.wanted_velocity[run, 0, 1]
    # Feet that land together pitch and roll the body wherever they are put: of the laws
    # that move feet or change the frequency, only posture helps a hop.
    alternates = tables.alternates[old] + mix * (tables.alternates[new] - tables.alternates[old])
    ground = memory.ground_angles[run]
    ground[0] = low_passed(ground[0], off.roll, gains.slope_filter, dt)
    ground[1] = low_passed(ground[1], off.pitch, gains.slope_filter, dt)
    singly = tables.one_by_one[old] + mix * (tables.one_by_one[new] - tables.one_by_one[old])
    uphill_x = uphill_y = 0.0
    if gains.slope:
        uphill_x = alternates * slope.shift_ahead(
            ground[1], singly, memory.clearance_share[run], gains)
        uphill_y = -alternates * slope.shift(ground[0], gains.slope_share, gains)
    # A foot passes below the body in the duration of a stance.
    stance = tables.stance[old] + mix * (tables.stance[new] - tables.stance[old])
    brief = min(stance / gains.step_stance, 1.0)
    vx, vy = brief * off.vx, brief * off.vy
    further = (placement.step(vx, off.wy, gains.step, gains.step_pitch_rate, gains),
               placement.step(vy, off.wx, gains.step_left, -gains.step_roll_rate, gains))
    yielded = placement.yielding(
        vx, vy, gains.stiffen and memory.stiff_for[run] > 0.0
        and tables.one_by_one[slot] > 0.0, gains)
    memory.commanded_turn[run] = low_passed(
        memory.commanded_turn[run], planned.turn[run], gains.sidestep_filter, dt)
    memory.sidestep_correction[run] = sidestep.correct_speed(
        memory.sidestep_correction[run], -off.vy, left, memory.commanded_turn[run],
        math.hypot(ground[0], ground[1]), _possible_speed(tables, memory, run, slot), gains,
        fraction * dt)
    strode = (phase - memory.last_phase[run] + 0.5) % 1.0 - 0.5
    memory.last_phase[run] = phase
    return slot, Intent(alternates, singly, off.roll - ground[0], off.pitch - ground[1],
                        (uphill_x, uphill_y), further, yielded,
                        left + memory.sidestep_correction[run], strode,
                        _stiffness(tables, planned, run, memory.wanted_velocity[run, 0, 0]),
                        alternates * pace.velocity_error(vx, vy, gains))


@jit
def _displacement(tables, gains, memory, at, foot, middle, off, intent, dt):
    """Return how far to move a foot forward, to the left and up, m.

    Args:
        tables: GaitTables.
        gains: Gains.
        memory: Memory, changed in place.
        at: run, leg, slot of the gait, and the rows of its tables with PHASE_LEAD and without.
        foot: planned position, base's frame, m, shape (3,).
        middle: of the standing feet, forward and to the left, m.
        off: Deviation.
        intent: Intent.
        dt: s.

    """
    run, leg, slot, row, now = at
    alternates, swinging, contact = (intent.alternates, tables.swinging[slot, row, leg],
                                     memory.contact[run, leg])
    (x, y), z = intent.uphill, 0.0
    if gains.posture:
        if swinging:
            # A hop lands on legs that a falling nose would draw in.
            z = alternates * posture.in_swing(foot[0], foot[1], intent.roll, intent.pitch, gains)
        else:
            # About the middle of the feet that stand: the body is tilted, not raised. Its
            # torque goes with the servos' stiffness.
            z = posture.in_stance(foot[0] - middle[0], foot[1] - middle[1], off.roll, off.pitch,
                                  off.wx, off.wy, intent.singly, gains) / intent.stiffness
    if gains.placement:
        placed = memory.placement_displacement[run, leg]
        placement.advance(placed, swinging, intent.further, intent.yielded, gains, dt)
        x, y = x + alternates * placed[0], y + alternates * placed[1]
    if gains.sidestep:
        carried = memory.sidestep_displacement[run]
        carried[leg] = sidestep.advance(
            carried[leg], swinging, intent.sideways,
            tables.duty[slot, leg] * dt / max(intent.strode, 0.1 * dt), gains, dt)
        y += carried[leg]
    if gains.reflexes:
        z += alternates * reflexes.advance(
            memory.reflex_state[run, leg], contact, tables.swinging[slot, now, leg],
            tables.progress[slot, now, leg], foot[2],
            intent.roll * foot[1] - intent.pitch * foot[0], gains, dt)
    if gains.clearance and swinging:
        z += alternates * clearance.lift(
            memory.clearance_share[run], tables.progress[slot, row, leg], gains)
    return x, y, z


@jit
def _move_feet(legs, tables, gains, memory, planned, run, slot, off, intent, step, out):
    """Move the feet of a run; out are its angles, rad, shape (joints,).

    Returns the number of feet that stumble.
    """
    rows, columns, (dt, fraction, _, delay) = legs.rows, legs.columns, step
    quick, phase = 1.0 - math.exp(-dt / gains.smooth), planned.phase[run]
    foot, feet = memory.scratch[0], memory.leg_velocities
    row = int((phase + PHASE_LEAD) % 1.0 * NUM_PHASES) % NUM_PHASES
    now = int(phase % 1.0 * NUM_PHASES) % NUM_PHASES
    # Contacts are as old as angles, and say what feet did then.
    then = int((phase - delay * intent.strode / dt) % 1.0 * NUM_PHASES) % NUM_PHASES
    standing, mean_x, mean_y, stumbling = 0, 0.0, 0.0, 0.0
    for leg in range(rows.shape[0]):
        feet[leg, 0], feet[leg, 1], feet[leg, 2] = foot_of(
            rows[leg], out[columns[leg, 0]], out[columns[leg, 1]], out[columns[leg, 2]])
        if not tables.swinging[slot, row, leg]:
            standing, mean_x, mean_y = (standing + 1, mean_x + feet[leg, 0],
                                        mean_y + feet[leg, 1])
    middle = mean_x / max(standing, 1), mean_y / max(standing, 1)
    for leg in range(rows.shape[0]):
        foot[0], foot[1], foot[2] = feet[leg, 0], feet[leg, 1], feet[leg, 2]
        way = _displacement(tables, gains, memory, (run, leg, slot, row, now), foot, middle, off,
                            intent, dt)
        if gains.clearance:
            stumbling += clearance.stumbles(
                memory.contact[run, leg], tables.swinging[slot, then, leg],
                tables.progress[slot, then, leg])
        displacement = memory.displacement[run, leg]
        for k in range(3):
            displacement[k] += quick * (fraction * way[k] - displacement[k])
        move_foot(rows[leg], columns[leg], out, foot, displacement)
    return stumbling


@jit
def _stiffen(gains, memory, run, intent, step):
    """Make the servos as stiff as the gait wants, and stiffer after a velocity error."""
    dt, fraction, _, delay = step
    memory.kp_scale[run], memory.stiff[run] = intent.stiffness, False
    if not gains.stiffen:
        return
    # Before the full gait is reached the body is not yet where the efference copy has it.
    memory.stiff_for[run] = stiffen.remaining(
        memory.stiff_for[run], intent.error if fraction == 1.0 else 0.0, gains, dt)
    memory.stiff[run] = memory.stiff_for[run] > 0.0
    if gains.virtual_stiffness:
        # Measurements of which the feedback lets go may be old.
        spent = memory.virtual_spent[run]
        memory.stiff[run] = virtual_stiffness.acts(
            spent, memory.stiff[run] and fraction == 1.0, delay, gains)
        memory.virtual_spent[run] = virtual_stiffness.spend(spent, memory.stiff[run], gains, dt)
    elif memory.stiff[run]:
        memory.kp_scale[run] = intent.stiffness * gains.stiffen_kp


@jit
def _change_frequency(gains, memory, run, steered, intent, faster, step):
    """Fill the factor of the stride frequency, which the speed makes faster by a fraction."""
    quicker, (dt, fraction, _, _) = 0.0, step
    if gains.pace and steered:
        quicker = fraction * pace.frequency_change(intent.error, memory.fatigue[run], gains)
    memory.fatigue[run] = low_passed(memory.fatigue[run], quicker, gains.pace_memory, dt)
    # After a push the clock is that of pace.
    pushed = memory.stiff_for[run] > 0.0
    memory.frequency_scale[run] = 1.0 + quicker + (0.0 if pushed else faster)


@jit_entry
def tick(legs, tables, gains, memory, sensors, planned, step, out):
    """Correct planned angles: fill out, rad, shape (runs, joints), and memory's outputs.

    Args:
        legs: LegArrays of the robot.
        tables: GaitTables of its gaits.
        gains: Gains of the laws.
        memory: Memory of all runs, changed in place.
        sensors: SensorData.
        planned: PlannedMotion.
        step: dt in s, the fraction of all corrections, the pattern's level, 0 to 1 both, and the
            age of the measured angles, s.
        out: filled.

    """
    dt, fraction, level, _ = step
    for run in range(out.shape[0]):
        update(legs, sensors, run, dt, memory.velocity[run], memory.contact[run], memory.doubt,
               memory.leg_velocities, memory.scratch)
        target = memory.wanted_velocity[run]
        _approach(planned.velocity[run], dt, target[0], target[1])
        off = _deviation(tables, memory, sensors, planned, run, level)
        slot, intent = _intend(tables, gains, memory, planned, run, off, step)
        out[run] = planned.angles[run]
        stumbling = _move_feet(legs, tables, gains, memory, planned, run, slot, off, intent, step,
                               out[run])
        # A body that recovers from a push leans: then feet touch early on any ground.
        counts = fraction == 1.0 and memory.stiff_for[run] == 0.0
        memory.clearance_share[run] = clearance.update(
            memory.clearance_share[run], stumbling if counts else 0.0, gains, dt)
        _stiffen(gains, memory, run, intent, step)
        faster = _change_strides(tables, gains, memory, run, slot, -off.vx,
                                 wrapped(planned.heading[run] - sensors.rpy[run, 2]
                                         + planned.lean[run, 2]), step)
        _change_frequency(gains, memory, run, tables.steered[slot], intent, faster, step)

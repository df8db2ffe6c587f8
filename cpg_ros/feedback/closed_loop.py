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

"""One tick of the closed loop, compiled: from the values of messages to corrected angles."""

import math
from typing import NamedTuple

from cpg_ros.dynamics.integration.compilation import jit, jit_entry
from cpg_ros.feedback.estimate import (
    advance_odometry,
    loads_of,
    lose_odometry,
    Odometry,
    SensorData,
    TOUCHDOWN_LOAD,
)
from cpg_ros.feedback.feedback import Feedback
from cpg_ros.feedback.gains import Gains, Memory
from cpg_ros.feedback.gait_tables import GaitTables, NUM_PHASES
from cpg_ros.feedback.input_checks import (
    AGE,
    agreement,
    check_imu,
    check_joints,
    check_loads,
    fade,
    IMU,
    IMU_STATE_SIZE,
    is_out,
    LAST_MESSAGE,
    LAST_VALID,
    note,
    NUM_VALUES,
)
from cpg_ros.feedback.kinematics import LegArrays
from cpg_ros.feedback.laws import servo_gains, virtual_stiffness
from cpg_ros.feedback.leg_rates import compare_rates, rates_memory
from cpg_ros.feedback.tick import PlannedMotion, tick
import numpy as np

#: MAX_HEADING_ERROR: largest difference between wanted and measured heading, rad.
MAX_HEADING_ERROR = 0.5
#: DECAY_TIME: time at a fraction of 0 after which all displacements have decayed, s.
DECAY_TIME = 0.3
#: MIN_AGREEMENT: least mean fraction of legs whose contacts agree with the gait.
MIN_AGREEMENT = 0.5
#: MAX_FLIGHT_TIME: longest time for which all feet may be unloaded, s.
MAX_FLIGHT_TIME = 0.3
#: Sources of the loads on the feet.
FOOT_CONTACTS, WRENCHES, EFFORTS = CONTACTS = ('foot_contacts', 'wrenches', 'efforts')
#: JOINT_SIZE: number of values that are read of each joint; FORCE_SIZE: number of a Wrench's.
JOINT_SIZE, FORCE_SIZE = 3, 3


class Senses(NamedTuple):
    """The values of the newest messages, and the data by which they are checked.

    Inputs are the IMU, the joints and, unless those show them, the contacts: of all feet, or of
    each.

    Attributes:
        monitors: see input_checks.LAST_VALID, shape (inputs, NUM_VALUES).
        news: 1 for a new message with the same numbers, 2 for one with others, else 0, (inputs,).
        stamps: of the messages, s, NaN without, (inputs,).
        unreadable: verdict on messages of a layout that cannot be used, else 0, (inputs,).
        imu: as in the message, shape (IMU,).
        joints: positions, velocities and efforts, shape (JOINT_SIZE, joints).
        feet: loads, shape (1, legs), or forces, shape (legs, FORCE_SIZE).
        counts: measured joints, which of CONTACTS it is, and whether there are efforts, (3,).
        indices: indices 0, 1, 2 and so on.
        mount: orientation of the IMU in the base's frame, x y z w.
        limits: of the joints, lowest, highest, fastest, shape (3, joints).
        weight: of the robot, N, shape (1,).
        memory: of check_imu.
        heavy: of check_loads, shape (legs, 1).
        loads: scratch, shape (legs,).

    """

    monitors: np.ndarray
    news: np.ndarray
    stamps: np.ndarray
    unreadable: np.ndarray
    imu: np.ndarray
    joints: np.ndarray
    feet: np.ndarray
    counts: np.ndarray
    indices: np.ndarray
    mount: np.ndarray
    limits: np.ndarray
    weight: np.ndarray
    memory: np.ndarray
    heavy: np.ndarray
    loads: np.ndarray

    @classmethod
    def empty(cls, legs: int, limits: np.ndarray, mount: np.ndarray, weight: float, contacts: str
              ) -> 'Senses':
        """Return that of a robot before its first messages."""
        kind, joints = CONTACTS.index(contacts), limits.shape[1]
        inputs = 2 + (1, legs, 0)[kind]
        never, whole = np.full(max(IMU, JOINT_SIZE * joints), math.nan), np.int64
        return cls(np.zeros((inputs, NUM_VALUES)), np.zeros(inputs, whole), np.zeros(inputs),
                   np.zeros(inputs, whole), never[:IMU].copy(),
                   never[:JOINT_SIZE * joints].reshape(JOINT_SIZE, joints).copy(),
                   np.full((legs, FORCE_SIZE) if kind == 1 else (1, legs), math.nan),
                   np.array([joints, kind, 0]), np.arange(joints), mount, limits,
                   np.array([weight]), np.zeros(IMU_STATE_SIZE), np.zeros((legs, 1)),
                   np.zeros(legs))


@jit
def _check_feet(senses, sensors, legs, k, gap):
    """Return the verdict on an input of the feet, and for how long its numbers may repeat, s."""
    foot, loads, forces = k - 2, senses.feet[0], sensors.foot_forces[0]
    indices, heavy, weight = senses.indices, senses.heavy, senses.weight[0]
    if senses.counts[1] == 1:
        # Its frame turns with the leg, but the length of the force is the same in every frame.
        force = senses.feet[foot]
        load = math.sqrt(force[0]**2 + force[1]**2 + force[2]**2)
        senses.loads[foot] = load
        return (check_loads(senses.loads[foot:foot + 1], indices[:1], weight, gap, heavy[foot],
                            forces[foot:foot + 1]), 0.0 if load else MAX_FLIGHT_TIME)
    if senses.counts[1] == 2:
        angles, rpy = sensors.joint_positions[0], sensors.rpy[0]
        loads_of(legs.rows, legs.columns, angles, senses.joints[2], rpy[0], rpy[1], senses.loads)
        return (check_loads(senses.loads, indices[:len(forces)], weight, gap, heavy[0], forces),
                0.0)
    unloaded = True
    for load in loads:
        unloaded = unloaded and load == 0.0
    return (check_loads(loads, indices[:len(forces)], weight, gap, heavy[0], forces),
            MAX_FLIGHT_TIME if unloaded else 0.0)


@jit_entry
def check_inputs(senses, sensors, legs, now, moving):
    """Check the messages that have come, and fill sensors with the plausible values.

    Args:
        senses: Senses.
        sensors: SensorData of one run.
        legs: LegArrays; without rows where efforts are not the contacts.
        now: s, on the clock of the messages' stamps.
        moving: whether the robot should move, so that no measurement may stay the same.

    """
    for k in range(len(senses.news)):
        if senses.news[k] == 0:
            continue
        monitor, patience = senses.monitors[k], 0.0 if moving else math.inf
        verdict, gap = senses.unreadable[k], min(now - monitor[LAST_VALID], 1.0)
        if verdict == 0 and k == 0:
            # Means go on while messages are refused.
            verdict = check_imu(senses.imu, min(now - monitor[LAST_MESSAGE], 1.0), moving,
                                senses.mount, senses.memory, sensors.rpy[0],
                                sensors.angular_velocity[0], sensors.acceleration[0])
        elif verdict == 0 and k == 1:
            limits = senses.limits
            verdict = check_joints(senses.joints[0], senses.joints[1],
                                   senses.indices[:senses.counts[0]], limits[0], limits[1],
                                   limits[2], sensors.joint_positions[0],
                                   sensors.joint_velocities[0])
            if verdict == 0 and senses.counts[1] == 2:
                verdict, _ = _check_feet(senses, sensors, legs, k, gap)
        elif verdict == 0:
            verdict, rests = _check_feet(senses, sensors, legs, k, gap)
            patience = max(patience, rests)
        note(monitor, now, senses.stamps[k], senses.news[k] == 1, verdict, patience)
        senses.news[k] = 0


#: Indices of a loop's state. REQUESTED: whether feedback is requested; OFF_TIME: time for which
#: its fraction has been 0, s; FRACTION: of the correction that acts; PROGRESS, GOOD_TIME: see
#: fade; AGREEMENT: mean fraction of legs whose contacts agree with the gait; NUM_FAILED: number of
#: inputs that are out; MOUNT: index of the IMU's mount in leg_rates.MOUNT_TEXTS;
#: CONTACTS_DISAGREE: whether contacts disagree; ACTIVE: whether feedback acts. STATE_SIZE is the
#: number of these.
(REQUESTED, OFF_TIME, FRACTION, PROGRESS, GOOD_TIME, AGREEMENT, NUM_FAILED, MOUNT,
 CONTACTS_DISAGREE, ACTIVE, STATE_SIZE) = range(11)
#: Indices of an instant. DT: length of the tick, s; TIME: time, s; RAMP: of the ramp, 0 to 1;
#: PHASE: cycles; BLEND: fraction of the gait that is entered; FREQUENCY: of strides, Hz;
#: SWITCHING: whether the gait changes; ROLL, and pitch and yaw behind it: of the body against its
#: feet, rad.
DT, TIME, RAMP, PHASE, BLEND, FREQUENCY, SWITCHING, ROLL = range(8)


class Instant(NamedTuple):
    """Present state of the pattern, commands, and the outputs for the pattern.

    Attributes:
        numbers: see DT to ROLL.
        gaits: keys of the gait that is left and of the gait that is entered, shape (2,).
        command: speeds forward and to the left, m/s, and yaw rate, rad/s.
        scale: factor of the stride frequency, shape (1,); filled.
        trim: added to the strides, shape (legs,); filled.

    """

    numbers: np.ndarray
    gaits: np.ndarray
    command: np.ndarray
    scale: np.ndarray
    trim: np.ndarray

    @classmethod
    def empty(cls, legs: int, scale: np.ndarray) -> 'Instant':
        """Return zeros for a number of legs, with an array for ``scale``."""
        return cls(np.zeros(ROLL + 3), np.zeros(2, dtype=np.int64), np.zeros(3), scale,
                   np.zeros(legs))


@jit
def _slot(tables, key):
    for k in range(len(tables.keys)):
        if tables.keys[k] == key:
            return k
    return -1


@jit
def _compare_contacts(loop, slot):
    """Update the faults that interrupt the feedback; return whether there are any."""
    numbers, state, monitors, tables = (
        loop.instant.numbers, loop.state, loop.senses.monitors, loop.tables)
    dt, out = numbers[DT], 0
    for k in range(len(monitors)):
        out += is_out(monitors[k], numbers[TIME])
    state[NUM_FAILED], state[MOUNT], state[CONTACTS_DISAGREE] = out, 0.0, 0.0
    if out == 0:
        state[MOUNT] = compare_rates(loop.legs, loop.sensors, dt, *loop.rates)
    wrong = out > 0 or state[MOUNT] > 0.0 or not tables.copied[slot]
    if wrong or numbers[RAMP] < 1.0 or numbers[SWITCHING] > 0.0:
        state[AGREEMENT] = 1.0
        return wrong
    row = int(numbers[PHASE] * NUM_PHASES) % NUM_PHASES
    state[AGREEMENT] = agreement(loop.sensors.foot_forces[0], TOUCHDOWN_LOAD * loop.legs.weight,
                                 tables.swinging[slot, row], min(dt * numbers[FREQUENCY], 1.0),
                                 state[AGREEMENT])
    state[CONTACTS_DISAGREE] = state[AGREEMENT] < MIN_AGREEMENT
    return state[CONTACTS_DISAGREE] > 0.0


class LoopData(NamedTuple):
    """Inputs, state and outputs of the closed loop of one robot, as compiled code takes them.

    Attributes:
        legs: of the robot.
        tables: of its gaits.
        gains: of the laws.
        memory: of one run, changed in place.
        senses: of the robot.
        sensors: of one run, filled.
        planned: of which angles are given, rad, shape (1, joints).
        rates: memory and scratch of compare_rates.
        instant: of the pattern.
        state: see REQUESTED and what follows it.
        corrected: angles, rad, shape (1, joints); filled.
        odometry: of the base, advanced in place.
        position: target angles within the limits, rad, shape (1, joints).
        sent: angles to send, which virtual_stiffness and servo_gains move, rad, shape (1,
            joints); filled.
        servos: estimate of their gains, changed in place.

    """

    legs: LegArrays
    tables: GaitTables
    gains: Gains
    memory: Memory
    senses: Senses
    sensors: SensorData
    planned: PlannedMotion
    rates: tuple[np.ndarray, ...]
    instant: Instant
    state: np.ndarray
    corrected: np.ndarray
    odometry: Odometry
    position: np.ndarray
    sent: np.ndarray
    servos: servo_gains.ServoEstimate

    @classmethod
    def of(cls, feedback: Feedback, senses: Senses, sensors: SensorData, instant: Instant,
           angles: np.ndarray, goal: np.ndarray, odometry: Odometry, position: np.ndarray
           ) -> 'LoopData':
        """Return those of one robot; angles before and goal after the correction, (joints,)."""
        planned = PlannedMotion.zeros(1, goal.size)._replace(angles=angles[None])
        legs = feedback.geometry.arrays
        return cls(legs, feedback.tables, feedback.gains, feedback.memory, senses, sensors,
                   planned, rates_memory(len(legs.rows)), instant, np.zeros(STATE_SIZE),
                   goal[None], odometry, position[None], position[None].copy(),
                   servo_gains.ServoEstimate.begin(1, goal.size))


@jit
def close(loop):
    """Correct a tick's planned angles by the measurements.

    Args:
        loop: LoopData, changed in place.

    Returns:
        0 for no correction, 1 for one, and 2 for none from now on, so that memory is to be reset.

    """
    legs, tables, memory, senses, sensors = (
        loop.legs, loop.tables, loop.memory, loop.senses, loop.sensors)
    planned, instant, state, out = loop.planned, loop.instant, loop.state, loop.corrected
    numbers, trim = instant.numbers, instant.trim
    dt, level = numbers[DT], numbers[RAMP]
    enabled, wrong = state[REQUESTED] > 0.0, False
    if enabled or state[OFF_TIME] <= DECAY_TIME:
        check_inputs(senses, sensors, legs, numbers[TIME], level > 0.0)
        old, new = _slot(tables, instant.gaits[0]), _slot(tables, instant.gaits[1])
        new = max(new, 0)
        old = new if old < 0 else old
        wrong = _compare_contacts(loop, new)
        state[PROGRESS], state[GOOD_TIME] = fade(
            state[PROGRESS], state[GOOD_TIME], enabled and not wrong, dt)
        state[FRACTION] = state[PROGRESS]**2 * (3.0 - 2.0 * state[PROGRESS])
        state[OFF_TIME] = 0.0 if state[FRACTION] > 0.0 else state[OFF_TIME] + dt
    if state[OFF_TIME] > DECAY_TIME and (wrong or not enabled):
        # Nothing is fed back: measurements from before the gap mean nothing after it.
        closed, state[ACTIVE], memory.stiff[0] = state[ACTIVE] > 0.0, 0.0, False
        memory.kp_scale[0], instant.scale[0], trim[:], out[0] = 1.0, 1.0, 0.0, planned.angles[0]
        return 2 if closed and wrong else 0
    planned.gaits[0, 0], planned.gaits[0, 1], planned.mix[0] = old, new, numbers[BLEND]
    planned.phase[0], turn, heading = numbers[PHASE], instant.command[2], planned.heading
    planned.velocity[0, 0], planned.velocity[0, 1] = instant.command[0], instant.command[1]
    planned.lean[0] = numbers[ROLL:]
    planned.turn[0], yaw = turn, sensors.rpy[0, 2] - planned.lean[0, 2]
    if state[FRACTION] > 0.0 and level > 0.0:
        # Without a commanded turn the heading is kept; with one it advances.
        ahead = (heading[0] + turn * dt - yaw + math.pi) % (2.0 * math.pi) - math.pi
        heading[0] = yaw + min(max(ahead, -MAX_HEADING_ERROR), MAX_HEADING_ERROR)
    else:
        heading[0] = yaw
    age = senses.monitors[1, AGE]
    tick(legs, tables, loop.gains, memory, sensors, planned,
         (dt, state[FRACTION] * level, level, math.inf if math.isnan(age) else age), out)
    instant.scale[0], trim[:], state[ACTIVE] = memory.frequency_scale[0], memory.stride[0], 1.0
    return 1


@jit
def finish(loop):
    """Finish a corrected tick, once limits hold its angles: odometry, and the angles to send.

    Args:
        loop: LoopData, changed in place.

    """
    memory, sensors, dt = loop.memory, loop.sensors, loop.instant.numbers[DT]
    if loop.state[ACTIVE] > 0.0:
        advance_odometry(loop.odometry, loop.legs, sensors, memory.velocity[0], memory.contact[0],
                         dt)
    else:
        lose_odometry(loop.odometry, dt)
    loop.sent[:] = loop.position
    if loop.gains.virtual_stiffness:
        virtual_stiffness.stretch(loop.sent, sensors.joint_positions, memory.stiff, loop.gains,
                                  loop.senses.limits)
    if loop.gains.servo_gains and loop.gains.servo_kp > 0.0:
        senses = loop.senses
        fresh = senses.counts[2] and senses.monitors[1, LAST_VALID] == loop.instant.numbers[TIME]
        servo_gains.restore(
            loop.sent, (sensors.joint_positions, sensors.joint_velocities, senses.joints[2:]),
            loop.servos, (memory.kp_scale, memory.stiff_for),
            (loop.gains.servo_kp, loop.gains.servo_kd), senses.limits,
            (dt, bool(fresh), loop.state[FRACTION]))

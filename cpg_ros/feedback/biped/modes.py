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

"""Modes of a biped, compiled: standing, shifting the weight, walking, changes of the gait."""

import math
from typing import NamedTuple

from cpg_ros.dynamics.integration.compilation import jit, jit_entry
from cpg_ros.dynamics.integration.memory import call_at, number_at, whole_at
from cpg_ros.feedback.biped.gains import BipedMemory, SHIFT, STAND, WALK
from cpg_ros.feedback.biped.links import Links
from cpg_ros.feedback.biped.stepping import HOPS, RUNS, WALKS
from cpg_ros.feedback.biped.support import Arms, swing_arms
from cpg_ros.feedback.biped.tick import tick
from cpg_ros.motion.core import Net, Track
import numpy as np

#: SHIFT_TIME: duration of the shift of the weight to the second foot before the first step, s;
#: FIRST_STEP_TIME: time from the begin of the shift to the first step, s.
SHIFT_TIME, FIRST_STEP_TIME = 0.8, 1.0
#: RISE_SPEED: speed at which a crouching robot stands up, m/s.
RISE_SPEED = 0.2
#: A walk ends on two feet when the centre of mass is slower than twice STOP_SPEED, m/s, and the
#: error of the capture point is below STOP_DCM_ERROR, m.
STOP_SPEED, STOP_DCM_ERROR = 0.15, 0.05
#: RUN_TO_WALK_RATIO: speed at which a run may become a walk, as a multiple of the fastest walk.
RUN_TO_WALK_RATIO = 1.2
#: START_PHASES: phase of the first leg's flexor, cycles, at which WALKS, RUNS and HOPS begin.
START_PHASES = 0.75, 0.0, 0.5
#: STOP_SLOT: place among the gaits of the walk with which a run stops; NUM_SLOTS: places: for
#: that one, the gait in force, the gait wanted, the one requested, and a free one.
STOP_SLOT, NUM_SLOTS = 0, 5
#: Indices of functions: they move a network by some strides, and put it on its orbit at a phase.
MOVE, RESEED = range(2)
#: Where a network's struct has its phase, and the addresses of the legs' phases and of the state.
PHASE_OFFSET, LEGS_OFFSET = Track.phase.offset, Track.legs.offset
STATE_OFFSET = Track.net.offset + Net.now.offset

#: State of a biped's feedback. mode: STAND, SHIFT or WALK; gait, goal, requested: place among the
#: gaits of the one in force, the one wanted, and the one requested last; faults: how often the
#: network left its orbit and was put back; time: in the mode, s; walks: whether it is to walk;
#: ready: whether the heading is known.
STATE = np.dtype([*((name, np.int64) for name in ('mode', 'gait', 'goal', 'requested', 'faults')),
                  ('time', float), ('walks', np.bool_), ('ready', np.bool_)])


class ServoArrays(NamedTuple):
    """The servos of the legs, in ``robot.order``, shape (joints,) each.

    Attributes:
        rows: index of each joint among the links'.
        indices: among the legs' torques, leg by leg.
        kp: N m/rad.
        effort: N m.
        torques: requested, N m, within the effort; filled.
        positions: the same as targets, rad; filled.

    """

    rows: np.ndarray
    indices: np.ndarray
    kp: np.ndarray
    effort: np.ndarray
    torques: np.ndarray
    positions: np.ndarray


class BipedArrays(NamedTuple):
    """The feedback of a biped, as arrays for compiled code.

    Attributes:
        links: of the robot.
        gaits: GAIT in each place, shape (NUM_SLOTS,).
        arms: of the robot.
        servos: of the robot.
        functions: addresses of C functions, see MOVE and RESEED.
        memory: of the laws.
        velocities: forward and left, m/s, and rate of turning, rad/s: commanded, and within what
            the gait in force can do, shape (2, 3).
        state: STATE, shape (1,).

    """

    links: Links
    gaits: np.ndarray
    arms: Arms
    servos: ServoArrays
    functions: np.ndarray
    memory: BipedMemory
    velocities: np.ndarray
    state: np.ndarray


@jit
def stand_anew(laws, state, weight, crouch):
    """Reset the laws to a stand, as after a fall; the weight in N, crouch as of LAWS."""
    laws.velocity[:] = laws.turning[:] = laws.loads[:] = laws.wanted[:] = 0.0
    laws.phases[:] = laws.dcm_error[:] = laws.reaction[:] = laws.before[:] = 0.0
    laws.center[:] = laws.lift_off[:] = laws.target[:] = 0.0
    laws.soles[:], laws.path[:], laws.fractions[:] = 0.0, 0.0, 0.5
    laws.heading = laws.integral = laws.ground = laws.roll_error = laws.left_speed = 0.0
    laws.swinging[:] = laws.landed[:] = False
    laws.force[0], laws.force[1], laws.force[2] = 0.0, 0.0, weight
    laws.clock[0], laws.clock[1], laws.crouch = 1.0, 0.0, crouch
    state.mode, state.time, state.ready = STAND, 0.0, False


@jit
def accept_request(gaits, functions, state):
    """Accept the gait requested last; a new frequency of the same gait applies at once."""
    requested, now = gaits[state.requested], gaits[state.gait]
    same = requested.name == now.name and state.gait == state.goal
    state.goal = state.requested
    if same:
        call_at(functions[RESEED], requested.track, number_at(now.track + PHASE_OFFSET))
        state.gait = state.goal


@jit
def _stops(gaits, state):
    """Return whether to come to a stand, on request or to change the gait."""
    return not state.walks or (state.gait != state.goal and (
        gaits[state.goal].kind == HOPS or gaits[state.gait].kind == HOPS))


@jit
def _read_clock(gait, laws):
    """Fill the legs' phases, counted from lift-off."""
    legs = whole_at(gait.track + LEGS_OFFSET)
    for leg in range(2):
        laws.phases[leg] = (number_at(legs + 8 * leg) + 0.5 * (1.0 - gait.duty)) % 1.0


@jit
def _ends(gait, laws, half):
    """Return whether to stand now: in a walk once it is slow, in a hop at the lowest point."""
    if gait.kind == HOPS:
        return laws.before[0] < half + 0.5 <= laws.phases[0]
    target, center, error = laws.wanted, laws.center[1], laws.dcm_error
    both = (not (laws.swinging[0] or laws.swinging[1])
            and laws.fractions[0] > 0.0 and laws.fractions[1] > 0.0)
    return (gait.kind == WALKS and both and max(abs(target[0]), abs(target[1])) < 1e-6
            and max(abs(center[0]), abs(center[1])) < 2.0 * STOP_SPEED
            and max(abs(error[0]), abs(error[1])) < STOP_DCM_ERROR)


@jit
def _change(gaits, functions, laws, soles, state, half):
    """Change between walk and run in the middle of a swing."""
    kind, slot = gaits[state.gait].kind, state.goal
    if _stops(gaits, state):
        slot = STOP_SLOT if kind == RUNS else state.gait
    target = gaits[slot]
    if slot == state.gait or target.kind == HOPS:
        return
    if kind == RUNS:
        velocity, heading = laws.center[1], laws.heading
        forward = velocity[0] * math.cos(heading) + velocity[1] * math.sin(heading)
        if forward > RUN_TO_WALK_RATIO * target.fast:
            return
    for leg in range(2):
        if laws.swinging[leg] and laws.before[leg] < half <= laws.phases[leg]:
            # There its flexor peaks, in any gait; swings begin from the other sole in a walk.
            sign, sole = 1.0 if kind == WALKS else -1.0, soles[1 - leg]
            for k in range(3):
                laws.lift_off[leg, k] += sign * sole[k]
            laws.ground = sole[2]
            call_at(functions[RESEED], target.track, 0.5 * leg)
            state.gait = slot
            _read_clock(target, laws)
            laws.clock[0], laws.clock[1] = 1.0, 0.0
            return


@jit
def _go_on(gaits, functions, laws, soles, state):
    """Read the clock of the gait in force, and end or change the gait when due."""
    gait = gaits[state.gait]
    half = 0.5 * (1.0 - gait.duty)
    laws.before[:] = laws.phases
    _read_clock(gait, laws)
    if _stops(gaits, state) and _ends(gait, laws, half):
        state.mode, state.time = STAND, 0.0
    elif gait.kind != HOPS:
        _change(gaits, functions, laws, soles, state, half)


@jit
def _start(gaits, functions, laws, soles, state):
    """Start the clock.

    A walk begins in the middle of both feet's stance, before the first one lifts off, a run
    in the middle of the second foot's, a hop in that of both.
    """
    gait, state.mode = gaits[state.gait], WALK
    laws.wanted[:], laws.integral = 0.0, 0.0
    laws.clock[0], laws.clock[1] = 1.0, 0.0
    laws.lift_off[:] = soles
    laws.ground = 0.5 * (soles[0, 2] + soles[1, 2])
    call_at(functions[RESEED], gait.track, START_PHASES[gait.kind])
    _go_on(gaits, functions, laws, soles, state)


@jit
def _choose(gaits, functions, laws, soles, state, dt):
    """Change mode and gait when due, and read the clock."""
    if state.mode == WALK:
        _go_on(gaits, functions, laws, soles, state)
        return
    state.time += dt
    laws.crouch = max(0.0, laws.crouch - RISE_SPEED * dt)
    if state.mode == STAND:
        state.gait = state.goal
    if not state.walks:
        state.mode, state.time = STAND, 0.0
    elif state.mode == STAND:
        if laws.crouch == 0.0:
            state.mode, state.time = SHIFT, 0.0
    elif state.time >= FIRST_STEP_TIME:
        _start(gaits, functions, laws, soles, state)


@jit
def _limit(gaits, velocities, state):
    """Limit the commanded velocity to the speeds of the gait in force and of the next one."""
    velocities[1] = 0.0
    if not _stops(gaits, state):
        now, goal = gaits[state.gait], gaits[state.goal]
        velocities[1] = velocities[0]
        velocities[1, 0] = min(max(velocities[0, 0], now.slow, goal.slow), now.fast, goal.fast)


@jit_entry
def advance(biped, sensors, dt):
    """Advance by one tick, and fill torques and targets of the servos.

    Args:
        biped: BipedArrays, changed in place.
        sensors: SensorData of one run, joints in the order of the links.
        dt: since the last time, s.

    """
    gaits, memory, functions, state = biped.gaits, biped.memory, biped.functions, biped.state[0]
    laws = memory.laws[0]
    if state.requested != state.goal:
        accept_request(gaits, functions, state)
    if not state.ready:
        laws.heading, state.ready = sensors.rpy[0, 2], True
    _choose(gaits, functions, laws, memory.pose.soles, state, dt)
    _limit(gaits, biped.velocities, state)
    gait = gaits[state.gait]
    tick(biped.links, gait, memory, sensors, biped.velocities[1], state.mode,
         (dt, min(state.time / SHIFT_TIME, 1.0), gait.kind))
    if state.mode == WALK:
        strides = laws.clock[1] + laws.clock[0] * gait.frequency * dt
        if call_at(functions[MOVE], gait.track, strides) == 0:
            state.faults += 1
            call_at(functions[RESEED], gait.track, number_at(gait.track + PHASE_OFFSET))
    # In a run the same swing costs more than it saves.
    swing_arms(biped.arms, state.gait, whole_at(gait.track + STATE_OFFSET),
               state.mode == WALK and gait.kind == WALKS, dt)
    servos, size = biped.servos, memory.torque.shape[1]
    for k in range(len(servos.kp)):
        torque, most = memory.torque[servos.indices[k] // size, servos.indices[k] % size], (
            servos.effort[k])
        # One that is not a number stays so.
        if abs(torque) > most:
            torque = math.copysign(most, torque)
        servos.torques[k] = torque
        servos.positions[k] = torque / servos.kp[k] + sensors.joint_positions[0, servos.rows[k]]

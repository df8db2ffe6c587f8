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

"""Modes of a balanced biped, compiled: it balances, holds a pose, or recovers from a fault."""

import math
from typing import NamedTuple

from cpg_ros.dynamics.integration.compilation import jit, jit_entry
from cpg_ros.dynamics.integration.memory import call_at
from cpg_ros.feedback.biped import substitutes
from cpg_ros.feedback.biped.gains import SHIFT, STAND, WALK
from cpg_ros.feedback.biped.modes import accept_request, advance, stand_anew
from cpg_ros.feedback.biped.stepping import swing_fraction, WALKS
from cpg_ros.feedback.biped.substitutes import FEET, IMU, JOINTS, LastStride, Substitutes
from cpg_ros.feedback.biped.support import swing_arms
from cpg_ros.feedback.closed_loop import check_inputs, TIME
from cpg_ros.feedback.estimate import SensorData
from cpg_ros.feedback.input_checks import FAULT, is_out, LAST_STAMP, LAST_VALID, RECOVERY_TIME
from cpg_ros.motion.strides import smoothstep
import numpy as np

#: FALLEN_LEAN: lean of the base, rad, above which the robot has fallen; FALLEN_HEIGHT: height of
#: the centre of mass, as a fraction of the wanted one, below which it has fallen.
FALLEN_LEAN, FALLEN_HEIGHT = 1.0, 0.6
#: The robot is on its feet, and balance begins, if all of these hold for a time of STEADY_TIME, s:
#: MAX_STAND_LEAN: largest lean of the base, rad, in the stand; MAX_CROUCH_LEAN: the same in the
#: crouch; MAX_POSE_ERROR: largest distance of a joint from the pose, rad; MIN_FEET_LOAD: least
#: fraction of the weight on the feet.
MAX_STAND_LEAN, MAX_CROUCH_LEAN, MAX_POSE_ERROR = 0.2, 0.5, 0.35
MIN_FEET_LOAD, STEADY_TIME = 0.4, 0.04
#: STAND_TIME: duration of the way back into the stand, s; CROUCH_TIME: duration of the way into
#: the crouch, s.
STAND_TIME, CROUCH_TIME = 0.3, 0.45
#: SETTLE_TIME: time in the stand before it crouches, s; STOP_TIMEOUT: longest time after the
#: failure of an input in which it comes to a stand, s.
SETTLE_TIME, STOP_TIMEOUT = 0.3, 4.0
#: COM_OFFSET: how far the centre of mass is behind the middle of the soles in a crouch from a
#: walk, m.
COM_OFFSET = 0.025
#: PASSING_PHASES: begin and end, as fractions of a swing, of the time in which the body passes
#: over the foot that stands: the best time to crouch without any sensor.
PASSING_PHASES = 0.38, 0.6
#: MAX_LOAD_RATIO: ratio of the swinging foot's load to the other's above which loads contradict
#: the gait.
MAX_LOAD_RATIO = 4.0
#: While both feet stand, each with a fraction of MIN_SOLE_LOAD of the weight, soles that are not
#: level for COMPARISON_TIME, s, contradict: MAX_SOLE_ANGLE: largest angle between them by the
#: joints; MAX_SOLE_LEAN: largest lean by IMU and joints, rad.
MAX_SOLE_ANGLE, MAX_SOLE_LEAN, MIN_SOLE_LOAD, COMPARISON_TIME = 0.16, 0.1, 0.12, 0.06
#: Largest deviation from the mean over MEAN_TIME, s, meanwhile: MAX_SOLE_TWIST: of the angle
#: between the soles while the weight shifts; MAX_LEAN_CHANGE: of their lean, rad; LEVEL_TIME: time
#: for which they are level in a crouch before the IMU counts again, s.
MAX_SOLE_TWIST, MAX_LEAN_CHANGE, MEAN_TIME, LEVEL_TIME = 0.015, 0.05, 1.0, 1.0
#: TOPPLING_LEAN: lean of a robot that holds the stand, rad, above which it topples.
TOPPLING_LEAN = 0.05
#: BLIND_AGE: age of IMU and joints, s, from which on nothing balances a walk: its last stride is
#: repeated; BLIND_AGE_FAILED: the same where an input has failed already.
BLIND_AGE, BLIND_AGE_FAILED = 0.025, 0.015
#: A joint was moved by hand, or its sensor failed, if it moves from one tick to the next by more
#: than MAX_JUMP, rad, plus MAX_JOINT_SPEED, rad/s, times the time between.
MAX_JUMP, MAX_JOINT_SPEED = 0.15, 40.0
#: TAKEOVER_TIME: duration of the transition from the angles that are held to those of balance, s.
TAKEOVER_TIME = 0.1
#: MAX_SIDE_SPEED: largest speed sideways, m/s; MAX_YAW_RATE: largest yaw rate, rad/s.
MAX_SIDE_SPEED, MAX_YAW_RATE = 0.2, 0.5
#: FAULT_TEXTS: how an input contradicts the others, by number, 0 for not; then the numbers.
FAULT_TEXTS = ('', '{joint} jumped', '{joint} is stuck',
          'the soles are {apart:.2f} rad from parallel by the joints, or turn against each other, '
          'while both feet stand: encoder offsets or names of joints',
          'the contacts do not go with the gait',
          'the soles lean by IMU and joints while both feet stand: the mounting of the IMU, its '
          'signs, a push, or ground too steep')
JOINT_JUMPED, JOINT_STUCK, SOLES_UNEVEN, CONTACTS_DISAGREE, SOLES_LEAN = range(1, 6)
#: Indices of functions of the pattern's core: move on without balance, go over to that, and move
#: the joints to the goal.
ADVANCE, RELEASE, REACH = range(3)
#: Rows of the poses: the stand, the crouch, what a crouch out of a walk adds to it at first, and
#: the angles from which the present transition began.
REST, CROUCH, CROUCH_OFFSET, START = range(4)

#: State of a balanced pattern; angles in rad, times in s, and of inertial unit, joints and feet in
#: this order.
#:
#: Known of the inputs: ages: time since the last valid values came; latencies: since they were
#: measured; used: the ages that count; seen: whether there are values; failed: whether an input is
#: out; waiting: whether one that is out has never been valid; refused: whether messages came of
#: which none was valid; gap: how old the joints were at the last tick; good: for how long inputs
#: have been valid; unseen: whether nothing tells how the robot moves.
#:
#: Doubts: doubts: how each input contradicts the others, 0 for not; suspect: joint whose
#: measurement is not used, -1 for none; contrary: for how long a swinging foot has borne more than
#: the other; tilts: lean of the soles, the same low-passed, and the usual one; uneven, level: for
#: how long they have not been, and have been, level, where uneven is negative until they are
#: judged; settles: time until they are compared; apart: angle between them as they were doubted;
#: leant: whether the IMU was doubted.
#:
#: Requests: wanted: whether to balance; enabled: whether to walk; lowers: whether to end in a
#: crouch; anew: whether to judge the inputs anew; command: speeds forward and to the left, m/s,
#: and yaw rate, rad/s.
#:
#: The robot: balancing: whether feedback bears it; known: whether it ever did; fallen; falls: how
#: often; crouching: whether it crouches or is on its way there; holds: whether it holds a pose;
#: low: whether that is the crouch; braces: whether that came from a walk; time: for how long it is
#: held; stood: for how long the robot has been on its feet; fraction: of the transition to
#: balance; waited: for how long it has stood to crouch; failing: for how long it is to stop;
#: blind: whether it gives up in a walk; depth: how much lower the crouch is, m; weight: of the
#: robot, N.
STATE = np.dtype([
    *((name, float, 3) for name in ('ages', 'latencies', 'used', 'command')),
    ('tilts', float, (3, 2, 2)), ('doubts', np.int64, 3),
    *((name, float) for name in (
        'stood', 'contrary', 'gap', 'uneven', 'level', 'settles', 'good', 'time', 'waited',
        'failing', 'fraction', 'depth', 'weight', 'apart')),
    ('falls', np.int64), ('suspect', np.int64),
    *((name, np.bool_) for name in (
        'wanted', 'enabled', 'lowers', 'anew', 'seen', 'failed', 'refused', 'waiting', 'balancing',
        'fallen', 'crouching', 'holds', 'low', 'known', 'braces', 'blind', 'unseen', 'leant'))])


class Watch(NamedTuple):
    """State of a balanced pattern beside its feedback, as arrays for compiled code.

    Attributes:
        measured: SensorData of one run, joints in the feedback's order.
        filled: the same, with substitutes for missing measurements.
        stride: the last stride of a walk.
        joints: at the last tick, rad, how far they moved since, rad, and for how long they have
            not, s, shape (3, joints of all).
        poses: see REST, rad, shape (4, joints).
        goal, position: of the pattern, rad, shape (joints,).
        indices: of the joints of ``robot.order`` among these, shape (joints,).
        functions: addresses, see ADVANCE.
        core: address of the pattern's core.
        track: address of the network in the core, shape (1,).
        stall: time of a stall that the core knows of, s, shape (1,).
        state: STATE, shape (1,).

    """

    measured: SensorData
    filled: Substitutes
    stride: LastStride
    joints: np.ndarray
    poses: np.ndarray
    goal: np.ndarray
    position: np.ndarray
    indices: np.ndarray
    functions: np.ndarray
    core: int
    track: np.ndarray
    stall: np.ndarray
    state: np.ndarray


_smooth = jit(smoothstep)


@jit
def _release(state):
    """Stop balancing."""
    state.balancing, state.stood = False, 0.0


@jit
def _fall(state):
    """Record a fall; all inputs are checked again once the robot is on its feet."""
    _release(state)
    state.crouching, state.fallen, state.leant = False, True, False
    state.contrary, state.doubts[:] = 0.0, 0
    state.falls += 1


@jit
def _doubted(state):
    """Return whether an input contradicts the others."""
    return state.doubts[IMU] > 0 or state.doubts[JOINTS] > 0 or state.doubts[FEET] > 0


@jit
def _passes(gait, laws):
    """Return whether the body is above the stance foot."""
    for leg in range(2):
        fraction = laws.phases[leg] / swing_fraction(gait)
        if laws.swinging[leg] and PASSING_PHASES[0] < fraction < PASSING_PHASES[1]:
            return True
    return False


@jit
def _leaps(joints, now, state, dt):
    """Update how far joints moved; return how many jumped, and the last of these."""
    count, last = 0, -1
    for k in range(len(now)):
        joints[1, k], joints[0, k] = abs(now[k] - joints[0, k]), now[k]
        if joints[1, k] > MAX_JUMP + MAX_JOINT_SPEED * (state.gap + dt):
            count, last = count + 1, k
    return count, last


@jit
def _doubt_joints(rows, joints, state, walks, leaps, dt):
    """Doubt a joint that jumps alone, or that does not move in a walk; leaps as of _leaps."""
    (count, wrong), reason = leaps, JOINT_JUMPED
    for k in range(joints.shape[1]):
        before = joints[2, k] if walks else 0.0
        joints[2, k] = 0.0 if joints[1, k] > 0.0 else before + dt
    if count == 0:
        reason = JOINT_STUCK
        for row in rows:
            if joints[2, row] > STEADY_TIME:
                count, wrong = count + 1, row
    if count == 1 and state.doubts[JOINTS] == 0:
        state.suspect, state.doubts[JOINTS] = wrong, reason


@jit
def _doubt_soles(links, measured, filled, state, mode, dt):
    """Doubt joints or IMU if the soles are not level while both feet stand.

    The soles of a robot that is pushed lean, too: it crouches, and as they are level there,
    the IMU counts again.
    """
    loads, used = measured.foot_forces[0], state.used
    if state.fallen or (state.balancing and mode == WALK):
        state.settles = SETTLE_TIME
        return
    if max(used[IMU], used[JOINTS], used[FEET]) > substitutes.MAX_EXTRAPOLATION or (
            min(loads[0], loads[1]) < MIN_SOLE_LOAD * state.weight):
        return
    tilts, smooth, usual = state.tilts[0], state.tilts[1], state.tilts[2]
    substitutes.sole_tilts(links, measured, filled, tilts)
    state.settles -= dt
    if state.settles > 0.0:
        smooth[:] = usual[:] = tilts
        return
    shifts = state.balancing and mode == SHIFT
    for leg in range(2):
        for k in range(2):
            smooth[leg, k] += min(dt / COMPARISON_TIME, 1.0) * (tilts[leg, k] - smooth[leg, k])
            if not shifts:
                usual[leg, k] += min(dt / MEAN_TIME, 1.0) * (tilts[leg, k] - usual[leg, k])
    first = smooth[0, 0] - usual[0, 0], smooth[0, 1] - usual[0, 1]
    second = smooth[1, 0] - usual[1, 0], smooth[1, 1] - usual[1, 1]
    off = math.hypot(tilts[0, 0] - tilts[1, 0], tilts[0, 1] - tilts[1, 1])
    apart = off > MAX_SOLE_ANGLE or (
        shifts and math.hypot(first[0] - second[0], first[1] - second[1]) > MAX_SOLE_TWIST)
    leaning = 0.5 * max(math.hypot(tilts[0, 0] + tilts[1, 0], tilts[0, 1] + tilts[1, 1]),
                        MAX_SOLE_LEAN / MAX_LEAN_CHANGE
                        * math.hypot(first[0] + second[0], first[1] + second[1]))
    uneven = apart or leaning > MAX_SOLE_LEAN
    state.uneven = state.uneven + dt if uneven or state.uneven < 0.0 else 0.0
    state.level = state.level + dt if state.crouching and not uneven else 0.0
    if state.level > LEVEL_TIME and state.leant:
        state.leant, state.doubts[IMU] = False, 0
    if state.uneven <= COMPARISON_TIME or _doubted(state):
        return
    if apart:
        state.doubts[JOINTS], state.apart = SOLES_UNEVEN, off
    else:
        state.doubts[IMU], state.leant = SOLES_LEAN, True


@jit
def _doubt_feet(gait, laws, loads, state, dt):
    """Doubt contacts that contradict the walk."""
    swung = stood = 0.0
    for leg in range(2):
        if laws.swinging[leg]:
            swung += loads[leg]
        else:
            stood += loads[leg]
    contrary = state.used[FEET] < substitutes.MAX_EXTRAPOLATION and _passes(gait, laws) and (
        swung > MAX_LOAD_RATIO * stood)
    state.contrary = state.contrary + dt if contrary else 0.0
    if state.contrary > STEADY_TIME and state.doubts[FEET] == 0:
        state.doubts[FEET] = CONTACTS_DISAGREE


@jit
def _discount(state):
    """Treat inputs that contradict the others as faulty."""
    if not _doubted(state):
        state.suspect = -1
    for k in range(3):
        if state.doubts[k] > 0 and (k != JOINTS or state.suspect < 0):
            state.used[k] = max(
                state.used[k], substitutes.MAX_EXTRAPOLATION + substitutes.ADOPTION_TIME)


@jit
def _lean(rpy):
    """Return the angle of the base to the vertical, rad."""
    return math.acos(min(max(math.cos(rpy[0]) * math.cos(rpy[1]), -1.0), 1.0))


@jit
def _is_near(joints, rows, pose, indices):
    """Return whether the joints of the legs are near a pose, rad."""
    off = 0.0
    for k in range(len(indices)):
        off = max(off, abs(joints[rows[k]] - pose[indices[k]]))
    return off < MAX_POSE_ERROR


@jit
def _ready_to_balance(state, lean, near, load, leaps, dt):
    """Update what is known of the robot; return whether it stands on its feet again.

    Args:
        state: STATE, changed in place.
        lean: of the base, rad.
        near: whether the joints are near the pose that is held.
        load: on both feet, N.
        leaps: how many joints have moved further than they can.
        dt: s.

    """
    if state.balancing:
        if lean > FALLEN_LEAN:
            _fall(state)
        elif leaps > 1:
            # A person moves more than one joint.
            _release(state)
        return False
    if state.crouching and lean > FALLEN_LEAN and (
            state.leant or not (state.failed or _doubted(state))):
        # A push has felled it, which made the soles lean or the IMU show no gravity.
        _fall(state)
    if state.good < RECOVERY_TIME or state.lowers:
        state.stood = 0.0
        return False
    stands = lean < (MAX_CROUCH_LEAN if state.crouching else MAX_STAND_LEAN) and near and (
        load > MIN_FEET_LOAD * state.weight)
    if TOPPLING_LEAN < lean < MAX_STAND_LEAN and not (stands or state.fallen or state.crouching):
        # Its feet do not show that it stands.
        state.crouching = True
    state.stood = state.stood + dt if stands and leaps == 0 else 0.0
    return state.stood >= STEADY_TIME


@jit
def _sense(biped, watch, dt):
    """Check the measurements, substitute missing ones, and update the state of the robot."""
    state, measured, filled, joints = watch.state[0], watch.measured, watch.filled, watch.joints
    laws, mode, gait = biped.memory.laws[0], biped.state[0].mode, biped.gaits[biped.state[0].gait]
    leaps = _leaps(joints, measured.joint_positions[0], state, dt)
    state.gap = state.used[JOINTS]
    if state.balancing:
        _doubt_joints(biped.servos.rows, joints, state, mode == WALK, leaps, dt)
    _doubt_soles(biped.links, measured, filled, state, mode, dt)
    if state.balancing and mode == WALK and gait.kind == WALKS:
        _doubt_feet(gait, laws, measured.foot_forces[0], state, dt)
    _discount(state)
    substitutes.fill(biped.links, measured, state, biped.memory, filled, dt)
    sensors = filled.sensors
    near = _is_near(sensors.joint_positions[0], biped.servos.rows,
                    watch.poses[CROUCH if state.low else REST], watch.indices)
    load = sensors.foot_forces[0, 0] + sensors.foot_forces[0, 1]
    if _ready_to_balance(state, _lean(sensors.rpy[0]), near, load, leaps[0], dt):
        stand_anew(laws, biped.state[0], state.weight, state.depth if state.crouching else 0.0)
        state.balancing, state.fallen, state.fraction, state.known = True, False, 0.0, True
        if state.crouching:
            # Soles rock while the robot rises.
            state.uneven, state.crouching = -MEAN_TIME, False


@jit
def _gives_up(gait, mode, laws, state, dt):
    """Return whether to stop balancing and crouch now.

    A crouch that begins in a walk waits for the moment at which the body is over the foot
    that stands.
    """
    stops = state.good < RECOVERY_TIME
    if not (stops or state.lowers or state.unseen):
        state.waited, state.failing, state.blind = 0.0, 0.0, False
        return not state.seen
    state.failing += dt
    state.waited = state.waited + dt if mode == STAND else 0.0
    state.blind = state.blind or state.unseen or (stops and state.failing > STOP_TIMEOUT)
    return (not state.seen or state.waited > SETTLE_TIME
            or (state.blind and (mode != WALK or _passes(gait, laws))))


@jit
def _decide(gait, mode, laws, state, dt):
    """Decide between balance and crouch."""
    oldest = min(max(state.used[IMU], state.latencies[IMU]),
                 max(state.used[JOINTS], state.latencies[JOINTS]))
    # Nothing tells how the robot moves.
    state.unseen = oldest > (BLIND_AGE_FAILED if state.failed else BLIND_AGE)
    wrong = state.failed or _doubted(state)
    state.good = 0.0 if wrong else state.good + dt
    if state.balancing and _gives_up(gait, mode, laws, state, dt):
        # First, as another thread may ask whether it has come to rest.
        state.time, state.crouching, state.braces = 0.0, True, mode == WALK
        _release(state)
    measured = state.known or state.refused or state.seen
    if not (state.balancing or state.fallen) and (state.lowers or (wrong and measured)):
        state.braces, state.crouching = state.braces and state.crouching, True


@jit
def _read_command(velocity, state):
    """Fill the commanded velocity, m/s and rad/s, shape (3,); return whether the robot walks."""
    walks = state.enabled and not (state.good < RECOVERY_TIME or state.lowers)
    velocity[:] = state.command
    if not walks:
        velocity[:] = 0.0
    velocity[1] = min(max(velocity[1], -MAX_SIDE_SPEED), MAX_SIDE_SPEED)
    velocity[2] = min(max(velocity[2], -MAX_YAW_RATE), MAX_YAW_RATE)
    return walks


@jit
def _go_over(target, start, goal, indices, state, dt):
    """Fill the goal with angles on the way to those of balance; return False after a fall."""
    for angle in target:
        if not math.isfinite(angle):
            _fall(state)
            return False
    state.fraction = min(1.0, state.fraction + dt / TAKEOVER_TIME)
    for k in range(len(indices)):
        begin = start[indices[k]]
        goal[indices[k]] = begin + state.fraction * (target[k] - begin)
    return True


@jit
def _balance(biped, watch, dt):
    """Fill the goal with the angles that balance requests; return False after a fall."""
    state, own, laws = watch.state[0], biped.state[0], biped.memory.laws[0]
    own.walks = _read_command(biped.velocities[0], state)
    if state.holds:
        state.holds = False
        watch.poses[START] = watch.position
    advance(biped, watch.filled.sensors, dt)
    target, soles = biped.servos.positions, biped.memory.pose.soles
    if state.unseen:
        substitutes.replay(watch.stride, laws.phases[0], target)
    if not _go_over(target, watch.poses[START], watch.goal, watch.indices, state, dt):
        return False
    height = laws.center[0, 2] - min(soles[0, 2], soles[1, 2])
    if height < FALLEN_HEIGHT * (biped.gaits[own.gait].height - laws.crouch):
        _fall(state)
    return True


@jit
def _hold(poses, position, goal, state, dt):
    """Fill the goal with the angles of the stand or the crouch, or those on the way to them."""
    pose, start = poses[CROUCH if state.crouching else REST], poses[START]
    duration = CROUCH_TIME if state.crouching else STAND_TIME
    if not state.holds or state.crouching != state.low:
        state.holds, state.low, state.time = True, state.crouching, 0.0
        start[:] = position
        for k in range(len(pose)):
            if abs(pose[k] - start[k]) > MAX_JUMP:
                state.settles = duration + SETTLE_TIME
    state.time += dt
    fraction, bracing = _smooth(min(state.time / duration, 1.0)), 0.0
    if state.crouching and state.braces:
        bracing = _smooth(min(max(2.0 - state.time / CROUCH_TIME, 0.0), 1.0))
    for k in range(len(pose)):
        end = pose[k] + bracing * poses[CROUCH_OFFSET, k]
        goal[k] = start[k] + fraction * (end - start[k])


@jit_entry
def balance(biped, watch, dt):
    """Advance by one tick of dt in s; BipedArrays and Watch are changed in place."""
    state, own, functions = watch.state[0], biped.state[0], watch.functions
    laws = biped.memory.laws[0]
    if not state.wanted:
        swing_arms(biped.arms, own.gait, 0, False, dt)
        begins = state.holds or state.balancing
        state.holds = state.balancing = state.crouching = False
        call_at(functions[RELEASE if begins else ADVANCE], watch.core, dt)
        return
    state.gap += watch.stall[0]
    watch.stall[0] = 0.0
    if state.anew:
        state.anew = False
        if not state.balancing:
            state.doubts[:] = 0
    if own.requested != own.goal:
        accept_request(biped.gaits, biped.functions, own)
    state.used[:] = state.ages
    if state.seen:
        _sense(biped, watch, dt)
    _decide(biped.gaits[own.gait], own.mode, laws, state, dt)
    if not (state.balancing and state.seen and _balance(biped, watch, dt)):
        swing_arms(biped.arms, own.gait, 0, False, dt)
        _hold(watch.poses, watch.position, watch.goal, state, dt)
    gait = biped.gaits[own.gait]
    watch.track[0] = gait.track
    call_at(functions[REACH], watch.core, dt)
    if state.balancing and not (state.unseen and own.mode == WALK and gait.kind == WALKS):
        substitutes.record(watch.stride, own.mode, gait.kind, laws.phases[0], watch.position,
                           watch.indices)


@jit
def read_measurements(senses, sensors, legs, numbers, rows, watch):
    """Check new messages, and update a balanced pattern's measurements and input state.

    Args:
        senses: Senses of the robot.
        sensors: SensorData of one run, joints as the messages have them; filled.
        legs: see check_inputs.
        numbers: see closed_loop.NOW.
        rows: place of each of these joints in the feedback's order.
        watch: Watch, changed in place.

    """
    state, now, measured, inputs = watch.state[0], numbers[TIME], watch.measured, len(senses.news)
    if not state.wanted:
        return
    check_inputs(senses, sensors, legs, now, state.enabled)
    failed = waiting = refused = False
    for k in range(inputs):
        monitor = senses.monitors[k]
        never = monitor[LAST_VALID] == -math.inf
        if is_out(monitor, now):
            failed, waiting = True, waiting or never
        refused = refused or (never and monitor[FAULT] != 0.0)
        if k < FEET:
            state.ages[k], state.latencies[k] = now - monitor[LAST_VALID], 0.0
            if not math.isnan(monitor[LAST_STAMP]):
                state.latencies[k] = max(now - monitor[LAST_STAMP], 0.0)
    # The oldest of the feet's inputs counts; with efforts as contacts, that of the joints.
    state.ages[FEET] = now - senses.monitors[JOINTS, LAST_VALID] if inputs == FEET else 0.0
    for k in range(FEET, inputs):
        state.ages[FEET] = max(state.ages[FEET], now - senses.monitors[k, LAST_VALID])
    for k in range(len(rows)):
        measured.joint_positions[0, rows[k]] = sensors.joint_positions[0, k]
        measured.joint_velocities[0, rows[k]] = sensors.joint_velocities[0, k]
    measured.foot_forces[:], measured.rpy[:] = sensors.foot_forces, sensors.rpy
    measured.angular_velocity[:] = sensors.angular_velocity
    measured.acceleration[:] = sensors.acceleration
    state.failed, state.refused = failed, refused
    state.waiting, state.seen = waiting, not waiting

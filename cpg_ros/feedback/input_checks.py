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

"""Plausibility checks of sensor messages before the feedback uses them.

They are rules of thumb for legged robots. A value that is far too large counts as a fault only if
it lasts longer than a stumble.
"""

import math

from cpg_ros.dynamics.integration.compilation import jit, jit_entry
from cpg_ros.feedback.kinematics import GRAVITY
import numpy as np

# Monitoring of the feedback's inputs: whether each is valid, or since when it is not.

#: MAX_SILENCE: time without a valid message, s, after which an input is out.
MAX_SILENCE = 0.05
#: MAX_STAMP_OFFSET: largest difference of a message's stamp from the clock, s, in either
#: direction.
MAX_STAMP_OFFSET = 0.1
#: Largest age of measurements when they are used, s, below the delay at which the robot falls in
#: simulation. MAX_AGE: in the gaits of a quadruped, which falls with an IMU that is 28 ms late,
#: also for moments; MAX_AGE_BALANCE: in a balanced walk, low-passed.
MAX_AGE, MAX_AGE_BALANCE = 0.022, 0.012
#: AGE_FILTER: time constant of the low-pass of the age, s; AGE_HYSTERESIS: fraction of the largest
#: age below which a late input counts as good again.
AGE_FILTER, AGE_HYSTERESIS = 0.1, 0.9
#: FADE: duration of the transition from full feedback to none and back, s; RECOVERY_TIME: time for
#: which all inputs have to be good before feedback returns, s.
FADE, RECOVERY_TIME = 0.15, 0.3


#: Indices of a monitor's values, times in s. Instants of LAST_VALID: the last valid message;
#: LAST_CHANGE: the last change of values; LAST_MESSAGE: the last message; LAST_STAMP: the stamp of
#: the last valid one; LAST_UPDATE: the last update of its age; FAILED_SINCE: the failure of the
#: input. AGE: low-passed age; TOO_OLD: whether it is too large; FAULT: verdict on the last
#: message; STAMP_AGE: age of its stamp; AGE_LIMIT: largest age; PEAK_HOLD: whether the age rises
#: at once, and only falls as low-passed. NUM_VALUES: how many values these are.
(LAST_VALID, LAST_CHANGE, LAST_MESSAGE, LAST_STAMP, LAST_UPDATE, AGE, FAILED_SINCE, TOO_OLD,
 FAULT, STAMP_AGE, AGE_LIMIT, PEAK_HOLD, NUM_VALUES) = range(13)


@jit
def note(monitor, now, stamp, same, verdict, patience):
    """Record a message.

    Args:
        monitor: numbers of an input, see above.
        now: s.
        stamp: of the message, on the same clock, s; nan if it has none.
        same: whether its numbers equal those of the last one.
        verdict: on the numbers, an index into FAULT_TEXTS.
        patience: longest time for which the same numbers may repeat, s.

    """
    monitor[LAST_MESSAGE] = now
    if not same:
        monitor[LAST_CHANGE] = now
    elif verdict in (0, NO_GRAVITY) and now > monitor[LAST_CHANGE] + patience:
        verdict = REPEATED
    if not math.isnan(stamp) and not abs(now - stamp) <= MAX_STAMP_OFFSET:
        monitor[STAMP_AGE], verdict = now - stamp, MISSTAMPED
    monitor[FAULT] = verdict
    if verdict == 0:
        monitor[LAST_VALID], monitor[LAST_STAMP] = now, stamp


@jit
def is_out(monitor, now):
    """Update the low-passed age of the measurements, s; return whether the input is out."""
    stale, late = now - monitor[LAST_VALID] > MAX_SILENCE, False
    if stale:
        # After a gap the low-pass starts anew: earlier ages do not matter.
        monitor[AGE], monitor[TOO_OLD] = math.nan, 0.0
    elif not math.isnan(monitor[LAST_STAMP]):
        age = max(now - monitor[LAST_STAMP], 0.0)
        if math.isnan(monitor[AGE]):
            monitor[AGE] = age
        else:
            fraction = min((now - monitor[LAST_UPDATE]) / AGE_FILTER, 1.0)
            monitor[AGE] += fraction * (age - monitor[AGE])
            if monitor[PEAK_HOLD]:
                monitor[AGE] = max(monitor[AGE], age)
        monitor[LAST_UPDATE] = now
        late = monitor[AGE] > monitor[AGE_LIMIT] * (AGE_HYSTERESIS if monitor[TOO_OLD] else 1.0)
        monitor[TOO_OLD] = late
    if not (late or stale):
        monitor[FAILED_SINCE] = math.nan
    elif math.isnan(monitor[FAILED_SINCE]):
        monitor[FAILED_SINCE] = now
    return late or stale


class InputMonitor:
    """Monitor of one input: age, and faults of its messages.

    Attributes:
        name: of the input.
        numbers: see LAST_VALID and the constants after it.
        other: fault of messages that no check could read.

    """

    def __init__(self, name: str, latest: float = math.inf, numbers: np.ndarray | None = None,
                 peaks: bool = True) -> None:
        """Monitor an input.

        Args:
            name: of the input.
            latest: age up to which measurements are valid, s.
            numbers: to be used, see LAST_VALID and what follows it, shape (NUM_VALUES,).
            peaks: whether a larger age counts at once, as gaits fall that are late for moments;
                else as low-passed.

        """
        self.name, self._latest, self._peaks, self.other = name, latest, peaks, ''
        self.numbers = np.empty(NUM_VALUES) if numbers is None else numbers
        self.restart()

    def restart(self) -> None:
        """Forget all messages."""
        self.numbers[:] = math.nan
        self.numbers[[LAST_VALID, LAST_CHANGE, LAST_MESSAGE]] = -math.inf
        self.numbers[[TOO_OLD, FAULT, STAMP_AGE]] = 0.0
        self.numbers[[AGE_LIMIT, PEAK_HOLD]] = self._latest, self._peaks

    @property
    def believed(self) -> float:
        """Time of arrival of the last valid message, s; -inf before the first one."""
        return float(self.numbers[LAST_VALID])

    @property
    def since(self) -> float:
        """Time at which it went out, s; nan while it is in."""
        return float(self.numbers[FAILED_SINCE])

    @property
    def age(self) -> float:
        """Age of the newest measurement when it is used, by its stamp, low-passed, s, or nan."""
        return float(self.numbers[AGE])

    def fault(self, now: float) -> str:
        """Return why the input is out, or ''."""
        is_out(self.numbers, now)
        return self.reason

    @property
    def reason(self) -> str:
        """Why it was out at the last check, or ''."""
        wrong, late = int(self.numbers[FAULT]), self.numbers[STAMP_AGE]
        if math.isnan(self.numbers[FAILED_SINCE]):
            return ''
        if self.numbers[TOO_OLD]:
            return (f'the measurement is {1e3 * self.age:.0f} ms old when it is used, more than '
                    f'feedback.max_delay, {1e3 * self._latest:.0f} ms')
        if wrong == MISSTAMPED:
            return (f'stamps {late:.2f} s old' if late > 0.0 else
                    f'stamps {-late:.2f} s ahead: are the clocks of both computers the same?')
        if wrong == UNREADABLE:
            return self.other
        return FAULT_TEXTS[wrong] or ('no message yet' if self.believed == -math.inf else
                                   'no messages')


@jit
def fade(way, good, valid, dt):
    """Return the progress of the feedback's fade, and how long inputs are valid, dt s later.

    Args:
        way: 0 to 1; its smooth step is the fraction of the feedback.
        good: how long all inputs have been valid, s.
        valid: whether they are.
        dt: s.

    """
    good = good + dt if valid else 0.0
    if good >= RECOVERY_TIME or (valid and way >= 1.0):
        return min(1.0, way + dt / FADE), good
    # Also where a good message comes between bad ones.
    return max(0.0, way - dt / FADE), good


#: FAULT_TEXTS: faults of a message, by the number that the checks return; 0 is none.
FAULT_TEXTS = ('', 'numbers that are not finite', 'an orientation whose length is not 1',
            'no orientation (its covariance begins with -1)', 'an impossible angular velocity',
            'an impossible acceleration',
            'an orientation and an angular velocity that contradict each other',
            'a joint far beyond its limits', 'an impossible speed of a joint',
            'impossible loads on the feet',
            'an acceleration that does not show gravity, 9.81 m/s^2 upward along the stated '
            'vertical, as an IMU at rest does: wrong units, signs or mounting, or gravity removed',
            'the same numbers again and again', '', '')
#: Indices of the last verdicts. NO_GRAVITY: an acceleration without it; REPEATED: the same values;
#: MISSTAMPED: a stamp far from the clock; UNREADABLE: another layout.
NO_GRAVITY, REPEATED, MISSTAMPED, UNREADABLE = 10, 11, 12, 13
#: MAX_RATE_CHANGE: largest change of the angular velocity between two messages, rad/s, and
#: MAX_ANGULAR_ACCELERATION: what the time between them adds, rad/s^2.
MAX_RATE_CHANGE, MAX_ANGULAR_ACCELERATION = 5.0, 1000.0
#: QUATERNION_TOLERANCE: largest difference of a quaternion's length from 1; MAX_ANGULAR_VELOCITY:
#: largest angular velocity, rad/s; MAX_ACCELERATION: largest acceleration, m/s^2, and
#: SHOCK_FILTER: time constant of its low-pass, s.
QUATERNION_TOLERANCE, MAX_ANGULAR_VELOCITY = 0.1, 35.0
MAX_ACCELERATION, SHOCK_FILTER = 4.0 * GRAVITY, 0.05
#: MAX_VERTICAL_ERROR: largest difference between the vertical and the integrated angular velocity,
#: rad; VERTICAL_MEMORY: time constant of the integral, s; MAX_GAP: longest time between messages,
#: s, over which they are compared; RELOCATION_ANGLE: difference in one message, rad, from which on
#: the base was put elsewhere.
MAX_VERTICAL_ERROR, VERTICAL_MEMORY, MAX_GAP, RELOCATION_ANGLE = 0.15, 0.2, 0.05, 0.3
#: MAX_MISMATCH: mean square of that difference, as a fraction of the motion's, above which
#: orientation and angular velocity contradict each other; MISMATCH_RECOVERY: fraction below which
#: they agree again; MISMATCH_FILTER: time constant of the mean, s; MIN_MOTION: RMS motion, rad,
#: above which they are compared.
MAX_MISMATCH, MISMATCH_RECOVERY, MISMATCH_FILTER, MIN_MOTION = 0.6, 0.2, 0.5, 0.01
#: Distance of the mean acceleration from gravity, m/s^2. GRAVITY_ERROR_STANDING,
#: GRAVITY_ERROR_WALKING: largest one while the robot stands and walks; GRAVITY_ERROR_RECOVERY:
#: below it, the acceleration is right again.
GRAVITY_ERROR_STANDING, GRAVITY_ERROR_WALKING, GRAVITY_ERROR_RECOVERY = 2.5, 6.0, 2.0
#: GRAVITY_FILTER_STANDING, GRAVITY_FILTER_WALKING: time constant of that mean, s, while the robot
#: stands and walks; GRAVITY_CHECK_DELAY: time after the first message, s, from which on it is
#: judged.
GRAVITY_FILTER_STANDING, GRAVITY_FILTER_WALKING, GRAVITY_CHECK_DELAY = 0.3, 1.0, 0.25
#: LIMIT_MARGIN: how far a joint may be beyond its limits, rad; MAX_SPEED_RATIO: largest speed of a
#: joint, as a multiple of its speed limit.
LIMIT_MARGIN, MAX_SPEED_RATIO = 0.3, 3.0
#: MAX_LOAD: largest load of all feet, low-passed with SHOCK_FILTER, as a multiple of the weight;
#: MIN_FOOT_LOAD: least load of one foot, likewise.
MAX_LOAD, MIN_FOOT_LOAD = 4.0, -0.5
#: IMU: number of values of a sensor_msgs/Imu. IMU_STATE_SIZE: values of the memory of its check,
#: with their indices: 0-2 acceleration, 3-5 vertical, 6-8 its recent change by the orientation and
#: 9-11 by the angular velocity, 12 mean square of their difference and 13 of both, 14-16 mean
#: acceleration less gravity, 17 time so far, 18 whether that mean is too large, 19 whether
#: orientation and angular velocity contradict each other, 20 time since the vertical last changed,
#: 21-23 the last angular velocity.
IMU, IMU_STATE_SIZE = 37, 24


@jit
def turned_by(mount, x, y, z):
    """Return a vector turned by a quaternion, x y z w."""
    a, b, c, w = mount[0], mount[1], mount[2], mount[3]
    d, e, f = 2.0 * (b * z - c * y), 2.0 * (c * x - a * z), 2.0 * (a * y - b * x)
    return (x + w * d + b * f - c * e, y + w * e + c * d - a * f, z + w * f + a * e - b * d)


@jit
def _contradicts(up, turning, memory):
    """Return whether the change of the vertical contradicts the angular velocity, base's frame."""
    if up[0] == memory[3] and up[1] == memory[4] and up[2] == memory[5]:
        # A driver may repeat an orientation, or its last message.
        return memory[19] > 0.0
    dt, memory[20] = memory[20], 0.0
    # A vector that is constant in the world turns the opposite way in the base's frame.
    turned = (up[1] * turning[2] - up[2] * turning[1], up[2] * turning[0] - up[0] * turning[2],
              up[0] * turning[1] - up[1] * turning[0])
    comparable, parted, moved, leap = memory[17] > 0.0 and dt < MAX_GAP, 0.0, 0.0, 0.0
    for k in range(3):
        leap += (up[k] - memory[3 + k] - dt * turned[k])**2
    # A base that is put elsewhere says nothing about the IMU: compare anew from here on.
    leaps = comparable and leap > RELOCATION_ANGLE**2
    if leaps:
        comparable, memory[12], memory[13], memory[19] = False, 0.0, 0.0, 0.0
    if not comparable:
        # The mean acceleration begins anew, too.
        memory[14:19] = 0.0
    stays = 1.0 - min(dt / VERTICAL_MEMORY, 1.0)
    for k in range(3):
        stated = stays * memory[6 + k] + up[k] - memory[3 + k]
        measured = stays * memory[9 + k] + dt * turned[k]
        memory[3 + k] = up[k]
        memory[6 + k], memory[9 + k] = (stated, measured) if comparable else (0.0, 0.0)
        parted += (memory[6 + k] - memory[9 + k])**2
        moved += memory[6 + k]**2 + memory[9 + k]**2
    fraction = min(dt / MISMATCH_FILTER, 1.0)
    memory[12] += fraction * (parted - memory[12])
    memory[13] += fraction * (moved - memory[13])
    if memory[13] > MIN_MOTION**2:
        if memory[12] > MAX_MISMATCH * memory[13]:
            memory[19] = 1.0
        elif memory[12] < MISMATCH_RECOVERY * memory[13]:
            memory[19] = 0.0
    return leaps or memory[19] > 0.0 or math.sqrt(parted) > MAX_VERTICAL_ERROR


@jit
def _is_off_gravity(up, acceleration, moving, dt, memory):
    """Return whether the mean acceleration, m/s^2, is far from gravity along the vertical."""
    # One message after a gap, such as the first, says no more than any other.
    dt = min(dt, MAX_GAP)
    memory[17] += dt
    filter_time = GRAVITY_FILTER_WALKING if moving else GRAVITY_FILTER_STANDING
    fraction = min(dt / min(filter_time, memory[17]), 1.0)
    square = 0.0
    for k in range(3):
        memory[14 + k] += fraction * (acceleration[k] - GRAVITY * up[k] - memory[14 + k])
        square += memory[14 + k]**2
    off = math.sqrt(square)
    largest = GRAVITY_ERROR_WALKING if moving else GRAVITY_ERROR_STANDING
    if memory[17] > GRAVITY_CHECK_DELAY and off > largest:
        memory[18] = 1.0
    elif off < GRAVITY_ERROR_RECOVERY:
        memory[18] = 0.0
    return memory[18] > 0.0


@jit_entry
def check_imu(values, dt, moving, mount, memory, rpy, angular_velocity, acceleration):
    """Fill the last three arguments if a message is plausible; return an index into FAULT_TEXTS.

    Args:
        values: numbers of a sensor_msgs/Imu in its order, shape (IMU,).
        dt: since the last one, s.
        moving: whether the robot walks.
        mount: orientation of the IMU in the base's frame, x y z w, shape (4,).
        memory: shape (IMU_STATE_SIZE,), zeros at first; overwritten.
        rpy: roll, pitch and yaw of the base, rad, shape (3,).
        angular_velocity: of the base in its own frame, rad/s, shape (3,).
        acceleration: accelerometer's reading in the base's frame, m/s^2, shape (3,).

    """
    memory[20] += dt
    for k in (0, 1, 2, 3, 13, 14, 15, 25, 26, 27):
        if not math.isfinite(values[k]):
            return 1
    if values[4] == -1.0:
        return 3
    x, y, z, w = values[0], values[1], values[2], values[3]
    if abs(math.sqrt(x * x + y * y + z * z + w * w) - 1.0) > QUATERNION_TOLERANCE:
        return 2
    # The base's orientation is the IMU's after the inverse of the mount.
    a, b, c, d = -mount[0], -mount[1], -mount[2], mount[3]
    x, y, z, w = (w * a + x * d + y * c - z * b, w * b - x * c + y * d + z * a,
                  w * c + x * b - y * a + z * d, w * d - x * a - y * b - z * c)
    turning = turned_by(mount, values[13], values[14], values[15])
    felt = turned_by(mount, values[25], values[26], values[27])
    jump = 0.0
    for k in range(3):
        jump += (turning[k] - memory[21 + k])**2
        memory[21 + k] = turning[k]
    # A single message with another angular velocity is a spike, and not what the base does.
    if (math.sqrt(turning[0]**2 + turning[1]**2 + turning[2]**2) > MAX_ANGULAR_VELOCITY
            or (memory[17] > 0.0
                and math.sqrt(jump) > MAX_RATE_CHANGE + MAX_ANGULAR_ACCELERATION * dt)):
        return 4
    hard = 0.0
    for k in range(3):
        memory[k] += min(dt / SHOCK_FILTER, 1.0) * (felt[k] - memory[k])
        hard += memory[k] * memory[k]
    if math.sqrt(hard) > MAX_ACCELERATION:
        return 5
    up = (2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y))
    contradicts = _contradicts(up, turning, memory)
    if _is_off_gravity(up, felt, moving, dt, memory):
        return NO_GRAVITY
    if contradicts:
        return 6
    rpy[0] = math.atan2(up[1], up[2])
    rpy[1] = math.asin(min(max(-up[0], -1.0), 1.0))
    rpy[2] = math.atan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))
    for k in range(3):
        angular_velocity[k], acceleration[k] = turning[k], felt[k]
    return 0


@jit_entry
def check_joints(positions, velocities, indices, lower, upper, fastest, angles, rates):
    """Fill angles and rates if they are plausible; return an index into FAULT_TEXTS.

    Args:
        positions: of a message, in its order, rad.
        velocities: the same, rad/s.
        indices: index of each joint in the message, shape (joints,).
        lower: smallest angles, rad, shape (joints,).
        upper: largest angles, the same.
        fastest: largest speeds, rad/s, the same.
        angles: filled, rad, shape (joints,).
        rates: filled, rad/s, shape (joints,).

    """
    for k in range(len(indices)):
        angle, rate = positions[indices[k]], velocities[indices[k]]
        if not math.isfinite(angle + rate):
            return 1
        if not lower[k] - LIMIT_MARGIN <= angle <= upper[k] + LIMIT_MARGIN:
            return 7
        if abs(rate) > MAX_SPEED_RATIO * fastest[k]:
            return 8
    for k in range(len(indices)):
        angles[k], rates[k] = positions[indices[k]], velocities[indices[k]]
    return 0


@jit_entry
def check_loads(loads, indices, weight, dt, memory, forces):
    """Fill forces if they are plausible; return an index into FAULT_TEXTS.

    Args:
        loads: of the feet, N, in any order.
        indices: index of each foot among them, shape (legs,).
        weight: of the robot, N.
        dt: since the last ones, s.
        memory: shape (1,), zeros at first; overwritten.
        forces: N, shape (legs,).

    """
    whole = 0.0
    for load in loads:
        if not math.isfinite(load):
            return 1
        if load < MIN_FOOT_LOAD * weight:
            return 9
        whole += load
    memory[0] += min(dt / SHOCK_FILTER, 1.0) * (whole - memory[0])
    if memory[0] > MAX_LOAD * weight:
        return 9
    for k in range(len(indices)):
        forces[k] = loads[indices[k]]
    return 0


@jit_entry
def agreement(loads, least, swinging, fraction, before):
    """Return the low-passed fraction of legs, 0 to 1, whose contacts agree with the gait.

    Args:
        loads: of the feet, N, shape (legs,).
        least: smallest load of a foot on the ground, N.
        swinging: whether each leg should swing, shape (legs,).
        fraction: weight of the new value in the mean.
        before: previous mean.

    """
    same = 0
    for leg in range(len(loads)):
        same += (loads[leg] > least) != swinging[leg]
    return before + fraction * (same / len(loads) - before)

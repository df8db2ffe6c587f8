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

"""Servo gains: estimate the servos' true gains, and send targets that give the expected torques.

A servo with the gains kp' and kd' turns its joint, at q, by tau = kp' (theta - q) - kd' dq/dt.
From measured torques tau, least squares with forgetting (Ljung and Soderstrom 1983) finds the
ratios kp'/kp and kd'/kd to the gains that the gaits were made for, the same for all joints. It
tries the targets sent 0 to MAX_LAG s, and fewer than NUM_LAGS ticks, earlier; the lag with the
least residual is the time from sending a target to measuring its effect. The target
theta' = q + (kp (theta - q) + (kd' - kd) dq/dt) / kp',
with q extrapolated over the lag, makes the torque that the gait expects.
"""

import math
from typing import NamedTuple

from cpg_ros.dynamics.integration.compilation import jit, jit_entry
from cpg_ros.feedback.laws.law import Gain, Law, limited
import numpy as np

LAW = Law(
    'servo_gains', "estimate the servos' gains from the efforts in joint_states, and shift the "
    'targets so that the torques are those of servo_kp and servo_kd', True,
    gains={
        'servo_kp': Gain(0.0, 10000.0, '', 'proportional gain of the servos that the gaits were '
                         'made for, in N m/rad; 0 for unknown, which switches servo_gains off'),
        'servo_kd': Gain(0.0, 1000.0, '', 'their damping gain, in N m s/rad; likewise')})

#: NUM_LAGS, MAX_LAG: delays of a target's effect are below NUM_LAGS ticks, and at most MAX_LAG, s.
NUM_LAGS, MAX_LAG = 32, 0.03
#: MEMORY: time constant of the forgetting, s; MIN_TIME: time of motion that is needed, s;
#: MIN_SPEED: RMS speed of the joints, rad/s, from which on they tell the gains.
MEMORY, MIN_TIME, MIN_SPEED = 2.0, 1.0, 0.5
#: MAX_RESIDUAL: fraction of the torques' mean square that may stay unexplained; MIN_INDEPENDENCE:
#: least determinant, as a fraction of the diagonal's product.
MAX_RESIDUAL, MIN_INDEPENDENCE = 0.04, 0.05
#: LOWEST, HIGHEST: ratios that are accepted. HOLD_TIME: for how long ratios stay in use, s, when
#: measurements contradict them, as those of a push do, in which torques reach the motors' limits.
LOWEST, HIGHEST, HOLD_TIME = 0.4, 2.5, 5.0
#: Logarithms of ratios, either way. NEAR: that of a ratio up to which gains count as right; FAR:
#: from which on a ratio counts whole.
NEAR, FAR = 0.14, 0.22
#: DOUBLING_TIME: time in which the ratio in use may change by a factor of 2, s.
DOUBLING_TIME = 1.0
#: MAX_SHIFT: largest shift of a target, rad; MAX_STEP: what a target may move in a tick beyond the
#: joint's speed limit, rad, less than what bridges refuse.
MAX_SHIFT, MAX_STEP = 0.5, 0.04


class ServoEstimate(NamedTuple):
    """Estimate of the gains of the servos of robots; the first axis is the run.

    Attributes:
        targets: those last sent, in a ring, rad, shape (runs, NUM_LAGS, joints).
        scales: factors of kp requested with them, shape (runs, NUM_LAGS).
        newest: index of the last ones, below 0 before the first, shape (1,).
        sums: of each lag, of e^2, e w and e tau with e = kp (theta - q) and w = -kd dq/dt, shape
            (runs, NUM_LAGS, 3).
        common: sums of w^2, w tau and tau^2, and the time that they last, s, shape (runs, 4).
        estimated: ratios of kp and kd, lag in s, and fraction of the torques' mean square that
            is not explained, shape (runs, 4).
        applied: ratios of kp and kd and lag in s that act, and for how long none were valid, s,
            shape (runs, 4).

    """

    targets: np.ndarray
    scales: np.ndarray
    newest: np.ndarray
    sums: np.ndarray
    common: np.ndarray
    estimated: np.ndarray
    applied: np.ndarray

    @classmethod
    def begin(cls, runs: int, joints: int) -> 'ServoEstimate':
        """Return that of robots whose servos are as expected."""
        estimate = cls(np.zeros((runs, NUM_LAGS, joints)), np.ones((runs, NUM_LAGS)),
                       np.zeros(1, dtype=np.int64), np.zeros((runs, NUM_LAGS, 3)),
                       np.zeros((runs, 4)), np.ones((runs, 4)), np.ones((runs, 4)))
        estimate.restart()
        return estimate

    def restart(self) -> None:
        """Forget everything."""
        self.newest[0] = -1
        self.sums[:] = self.common[:] = 0.0
        self.estimated[:] = 1.0
        self.applied[:] = 1.0, 1.0, 0.0, 0.0


@jit
def _solve(sums, common):
    """Return the ratios of kp and kd by least squares, and the sum of squares that stays."""
    product = sums[0] * common[0]
    determinant = product - sums[1]**2
    if not determinant > MIN_INDEPENDENCE * product:
        return 1.0, 1.0, math.inf
    kp = (sums[2] * common[0] - common[1] * sums[1]) / determinant
    kd = (sums[0] * common[1] - sums[1] * sums[2]) / determinant
    return kp, kd, common[2] - kp * sums[2] - kd * common[1]


@jit
def _learn(servos, run, angles, rates, efforts, expected, dt):
    """Take new measurements of a run, dt in s after the last ones, shape (joints,) or more."""
    common, estimated, newest = servos.common[run], servos.estimated[run], servos.newest[0]
    joints, speed, total = servos.targets.shape[2], 0.0, 0.0
    for k in range(joints):
        speed += rates[k]**2
        total += angles[k] + rates[k] + efforts[k]
    if not math.isfinite(total) or speed < joints * MIN_SPEED**2:
        return
    keep = math.exp(-dt / MEMORY)
    for k in range(4):
        common[k] *= keep
    common[3] += dt
    for k in range(joints):
        damping = -expected[1] * rates[k]
        common[0] += damping**2
        common[1] += damping * efforts[k]
        common[2] += efforts[k]**2
    least = math.inf
    for lag in range(min(NUM_LAGS, int(MAX_LAG / dt) + 1)):
        row, sums = (newest - lag) % NUM_LAGS, servos.sums[run, lag]
        kp = expected[0] * servos.scales[run, row]
        for k in range(3):
            sums[k] *= keep
        for k in range(joints):
            error = kp * (servos.targets[run, row, k] - angles[k])
            sums[0] += error**2
            sums[1] -= error * expected[1] * rates[k]
            sums[2] += error * efforts[k]
        kp_ratio, kd_ratio, residual = _solve(sums, common)
        if residual < least:
            least = residual
            estimated[0], estimated[1], estimated[2] = kp_ratio, kd_ratio, lag * dt
            estimated[3] = residual / max(common[2], 1e-9)


@jit
def _target(ratio):
    """Return a ratio if it differs much from 1, 1 if it differs little, between in between."""
    share = min(max((abs(math.log(ratio)) - NEAR) / (FAR - NEAR), 0.0), 1.0)
    return ratio**share if share > 0.0 else 1.0


@jit
def _use(servos, run, dt):
    """Let the applied ratios approach the estimated ones, if these are valid."""
    estimated, applied = servos.estimated[run], servos.applied[run]
    valid = (servos.common[run, 3] >= MIN_TIME and estimated[3] < MAX_RESIDUAL
             and LOWEST <= estimated[0] <= HIGHEST and LOWEST <= estimated[1] <= HIGHEST)
    applied[3] = 0.0 if valid else applied[3] + dt
    if 0.0 < applied[3] < HOLD_TIME:
        return
    if valid:
        applied[2] += limited(estimated[2] - applied[2], dt * MAX_LAG / DOUBLING_TIME)
    for k in range(2):
        target = _target(estimated[k]) if valid else 1.0
        applied[k] *= math.exp(limited(math.log(target / applied[k]),
                                    dt * math.log(2.0) / DOUBLING_TIME))


@jit_entry
def restore(targets, measured, servos, stiffness, expected, limits, instant):
    """Shift targets so that servos make the expected torques, in place.

    Args:
        targets: angles within all limits, rad, shape (runs, joints).
        measured: angles in rad, speeds in rad/s and torques in N m of the joints, shape (runs,
            joints) or more each.
        servos: ServoEstimate, changed in place.
        stiffness: factor of kp, and for how long servos stay stiff after a push, s, each of shape
            (runs,).
        expected: servo_kp and servo_kd.
        limits: lowest and highest angles, rad, and largest speeds, rad/s, shape (3, joints) or
            more.
        instant: dt in s, whether the measurements are new, and the fraction of all corrections.

    """
    dt, fresh, fraction = instant
    angles, rates, efforts = measured
    newest = servos.newest[0]
    if newest < 0:
        newest = servos.newest[0] = 0
        for run in range(targets.shape[0]):
            servos.targets[run, :] = targets[run]
    row = (newest + 1) % NUM_LAGS
    for run in range(targets.shape[0]):
        # After a push, torques reach the motors' limits.
        if fresh and stiffness[1][run] == 0.0:
            _learn(servos, run, angles[run], rates[run], efforts[run], expected, dt)
        _use(servos, run, dt)
        before, applied = servos.targets[run, newest], servos.applied[run]
        kp_ratio, kd_ratio = applied[0], applied[1]
        if kp_ratio != 1.0 or kd_ratio != 1.0:
            by_rate = (kd_ratio - 1.0) * expected[1] / (kp_ratio * stiffness[0][run] * expected[0])
            for k in range(targets.shape[1]):
                angle = angles[run, k] + applied[2] * rates[run, k]
                shift = ((1.0 / kp_ratio - 1.0) * (targets[run, k] - angle)
                         + by_rate * rates[run, k])
                angle = targets[run, k] + limited(fraction * shift, MAX_SHIFT)
                angle = before[k] + limited(angle - before[k], limits[2, k] * dt + MAX_STEP)
                targets[run, k] = min(max(angle, limits[0, k]), limits[1, k])
        servos.targets[run, row], servos.scales[run, row] = targets[run], stiffness[0][run]
    servos.newest[0] = row

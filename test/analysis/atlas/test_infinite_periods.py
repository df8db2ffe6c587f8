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

"""Curves on which a period grows without bound, against closed forms and AUTO-07p."""

from pathlib import Path

from cpg_ros.analysis.atlas.chart import chart_of
from cpg_ros.analysis.atlas.fold_curves import infinite_periods
from cpg_ros.dynamics.continuation import continue_orbit
from cpg_ros.dynamics.solve_orbit import solve_orbit, solve_preset
from cpg_ros.networks.registry import find_network, PRESETS
import numpy as np
import pytest

SUPPORT = Path(__file__).parents[2] / 'support'


def curves(chart, orbit):
    """Follow the ends of the branch through an orbit along the second axis."""
    branch = continue_orbit(orbit, chart.second.line, chart.second.low, chart.second.high)
    return infinite_periods(chart, orbit_gait(orbit), branch,
                            chart.first.line.value(orbit.network))


def orbit_gait(orbit):
    return next(gait for gait in orbit.network.gaits()
                if orbit.network.symmetry(gait) == orbit.symmetry)


def own(name, over):
    """Return the plane and the hop of a network of the tests' own."""
    file = str(SUPPORT / f'{name}.py')
    network = find_network(file)()
    return chart_of(file, network, over, (9, 9)), solve_orbit(network, 'hop')


def test_a_saddle_node_on_the_circle_is_where_the_angle_comes_to_rest():
    (curve,) = curves(*own('pausing_legs', [('b', (0.5, 1.5)), ('a', (0.3, 3.0))]))
    assert str(curve) == 'SNIC of hop'
    b, a = curve.points.T
    assert a == pytest.approx(b, abs=1e-5)
    assert b.min() < 0.51 and b.max() > 1.49 and (np.diff(b) > 0.0).all()


def test_a_homoclinic_orbit_is_where_the_energy_is_that_of_the_saddle():
    """The curve is c + d b = 0, with b = 2."""
    (curve,) = curves(*own('lingering_legs', [('d', (-0.02, 0.02)), ('c', (-0.15, 0.06))]))
    assert str(curve) == 'homoclinic of hop'
    d, c = curve.points.T
    assert c == pytest.approx(-2.0 * d, abs=1e-8)
    assert d.min() < -0.0199 and d.max() > 0.0199


def test_the_quadrupeds_pronk_ends_where_auto_has_it():
    preset = PRESETS['quadruped']['pronk']
    chart = chart_of('quadruped', preset.network, [('xi', (-0.002, 0.002)),
                                                   ('alpha=beta', (0.2, 0.4))], (9, 9))
    (curve,) = curves(chart, solve_preset(preset))
    assert curve.kind == 'homoclinic'
    xi, alpha = curve.points.T
    assert np.interp(0.0, xi, alpha) == pytest.approx(0.3484239174, abs=1e-9)
    assert len(xi) > 10

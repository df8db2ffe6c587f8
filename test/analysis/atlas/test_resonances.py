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

"""Strong resonances of torus points, where multipliers are known in closed form."""

from pathlib import Path

from cpg_ros.analysis.atlas.chart import chart_of
from cpg_ros.analysis.atlas.orbit_curves import Edge, orbit_curves
from cpg_ros.dynamics.solve_orbit import solve_orbit
from cpg_ros.networks.registry import find_network
import numpy as np
import pytest
from scipy.optimize import brentq

SUPPORT = Path(__file__).parents[2] / 'support'
FILE, HALF = str(SUPPORT / 'septic_legs.py'), str(SUPPORT / 'half_turns.py')
K, OMEGA = 0.2, 6.0


def test_resonances_are_where_the_angle_says():
    """The walk's disturbances in which both legs move alike, in the frame that turns with it.

    ``eta' = (2 k + s + 2 i kappa) eta + s conj(eta)`` with s = rho f'(rho), f the polynomial: a
    torus is born at s = -2 k, with the frequency 2 sqrt(kappa^2 - k^2) of eta over the walk's
    omega - kappa. At kappa = k both multipliers are 1.
    """
    network = find_network(FILE)
    rho = brentq(lambda rho: 2.0 * K + rho * (-1.0 - 3.0 * rho**2), 0.0, 5.0, xtol=1e-15)
    mu = K + rho + rho**3
    chart = chart_of(FILE, network(1.0, OMEGA, K, 1.0, -1.0, 0.0),
                     [('kappa', (0.05, 1.0)), ('mu', (0.3, 1.2))], (9, 9))
    orbit = solve_orbit(network(mu + 0.1, OMEGA, K, 0.8, -1.0, 0.0), 'walk')
    here, there = ((np.array([0.8, mu + way]) - chart.low) / chart.size for way in (0.1, -0.1))
    (curve,) = orbit_curves((chart, 'walk', [Edge(
        here, there, orbit(np.arange(65) / 65 * orbit.period).tolist(), orbit.period)]))
    assert curve.kind == 'torus'
    found = {point.kind: point.values for point in curve.codimension_two}
    assert len(found) == len(curve.codimension_two)
    wanted = {'1:1 resonance': K, **{f'1:{n} resonance': brentq(
        lambda kappa, n=n: 2.0 * np.sqrt(kappa**2 - K**2) - (OMEGA - kappa) / n, K, OMEGA)
        for n in (3, 4)}}
    assert found.keys() == wanted.keys()
    for kind, kappa in wanted.items():
        assert found[kind] == pytest.approx((kappa, mu), abs=1e-9)


def test_a_torus_curve_ends_where_both_multipliers_are_minus_one():
    """1:2: growth = -h, nu = omega / 2 + m; beyond, the pair is real and periods double."""
    network = find_network(HALF)
    h, m, omega = 0.6, 0.5, 6.0
    chart = chart_of(HALF, network(-1.0, 3.8, m, h, 0.4, omega),
                     [('nu', (3.2, 3.9)), ('growth', (-0.9, -0.3))], (9, 9))
    orbit = solve_orbit(network(-0.8, 3.8, m, h, 0.4, omega), 'hop')
    assert orbit.period == pytest.approx(2.0 * np.pi / omega)
    here, there = ((np.array([3.8, -h + way]) - chart.low) / chart.size for way in (-0.1, 0.1))
    found = orbit_curves((chart, 'hop', [Edge(
        here, there, orbit(np.arange(65) / 65 * orbit.period).tolist(), orbit.period)]))
    (curve,) = (one for one in found if one.kind == 'torus')
    (point,) = curve.codimension_two
    assert point.kind == '1:2 resonance'
    assert point.values == pytest.approx((omega / 2.0 + m, -h), abs=1e-8)

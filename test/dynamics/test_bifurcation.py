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

"""Torus, period-doubling and branch points of branches against AUTO-07p and by other routes."""

from functools import cache

from branch_switching import switch_branch
from cpg_ros.dynamics.continuation import bifurcations, continue_orbit
from cpg_ros.dynamics.floquet import multipliers
from cpg_ros.dynamics.integration.simulate import simulate
from cpg_ros.dynamics.mesh.solve import from_path
from cpg_ros.dynamics.solve_orbit import solve_preset
from cpg_ros.networks.library.biped import Biped
from cpg_ros.networks.library.delayed import Delayed
from cpg_ros.networks.library.quadruped import Quadruped
from cpg_ros.networks.network import ParameterLine
from cpg_ros.networks.registry import PRESETS
import numpy as np
import pytest


@cache
def pace():
    branch = continue_orbit(solve_preset(PRESETS['quadruped']['pace']),
                            ParameterLine.parse('alpha=beta', Quadruped), 0.05, 0.52)
    return branch, bifurcations(branch)


def test_the_pace_has_two_torus_points():
    # AUTO-07p's, ntst 60, ncol 4.
    branch, found = pace()
    assert [one.value for one in found if one.kind == 'torus'] == pytest.approx(
        [0.2221317, 0.1417523], abs=1e-6)
    # A pair each time.
    counts = [[int((np.abs(multipliers(branch.at(value + gap)[0]).transverse) > 1.0).sum())
               for gap in (-1e-4, 1e-4)] for value in (0.2221317, 0.1417523)]
    assert all(one != other and (one - other) % 2 == 0 for one, other in counts)


def test_multipliers_at_the_points_lie_on_the_unit_circle():
    for one in pace()[1]:
        assert abs(one.multiplier) == pytest.approx(1.0, abs=1e-5)
        known = multipliers(one.point.orbit)
        own = np.concatenate([known.within, known.transverse])
        assert np.abs(own - one.multiplier).min() < 1e-9
        assert (one.kind == 'torus') == (abs(one.multiplier.imag) > 1e-3)


def test_the_hop_doubles_its_period_where_the_walk_ends():
    line = ParameterLine.parse('w_a', Biped)
    walk = continue_orbit(solve_preset(PRESETS['biped']['walk']), line, -1.0, 0.4)
    assert walk.ends[0].why == 'symmetry'
    last = walk.points[0].orbit
    hop = from_path(last.network, last.network.symmetry('two_legged_hop'),
                    lambda theta: last(0.5 * theta * last.period), 0.5 * last.period)
    value = walk.ends[0].value
    branch = continue_orbit(hop, line, value - 0.05, value + 0.05)
    doubled = [one for one in bifurcations(branch) if one.kind == 'period doubling']
    # The walk turns back a little beyond.
    assert min(abs(one.value - value) for one in doubled) < 1e-3
    # There the walk leaves: left and right, flexor and extensor half a cycle apart.
    (point,) = (one for one in doubled if abs(one.value - value) < 1e-3)
    leaving = switch_branch(point, line, -1.0, 0.4, most=4)
    assert dict(leaving.points[0].orbit.symmetry.shifts) == dict(
        last.network.symmetry('walk').shifts)
    assert leaving.points[0].orbit.period == pytest.approx(2.0 * hop.period, rel=1e-3)


def delayed_residual(orbit):
    # Equation 1.1 of Liu & Zhang written out, at instants that are no nodes.
    a, b, c, d, tau = orbit.network.as_dict().values()
    times = (np.arange(501) + np.sqrt(0.5)) * (orbit.period / 501)
    x, past = orbit(times), orbit(times - tau)
    rates = (a * x + b * np.tanh(x) + d * np.tanh(np.roll(x, 2, axis=1))
             + c * np.tanh(past[:, [1, 0, 3, 2, 5, 4, 7, 6]]))
    return np.abs(orbit.derivative(times) - rates).max()


def unevenness(orbit):
    # How far a cycle is from being its own negative half a cycle later.
    times = np.arange(128) / 128 * orbit.period
    return np.sqrt(np.mean((orbit(times) + orbit(times + 0.5 * orbit.period))**2))


@pytest.mark.parametrize('preset, name', [('walk', 'tau'), ('liu2024_pace', 'd')])
def test_a_branch_leaves_a_gait_with_a_delay(preset, name):
    line = ParameterLine.parse(name, Delayed)
    branch = continue_orbit(solve_preset(PRESETS['delayed'][preset]), line, 0.2, 4.0, most=30)
    point = next(one for one in bifurcations(branch) if one.kind == 'branch point'
                 and one.value > 0.3)
    leaving = switch_branch(point, line, 0.2, 4.0, most=6)
    near, far = (one.orbit for one in leaving.points[1:3])
    assert max(map(delayed_residual, (near, far))) < 1e-9
    # A pitchfork: what breaks the symmetry x -> -x grows by the square root of the way.
    assert unevenness(point.point.orbit) < 1e-9 < 1e-3 < unevenness(near)
    assert not near.symmetry.odd
    values = leaving.values[1:3]
    squares = np.array([unevenness(near), unevenness(far)])**2
    begin = values[0] - squares[0] * np.diff(values)[0] / np.diff(squares)[0]
    assert begin == pytest.approx(point.value, abs=0.05 * abs(values[0] - point.value))


def test_a_simulation_keeps_to_the_branch_that_leaves():
    line = ParameterLine.parse('tau', Delayed)
    branch = continue_orbit(solve_preset(PRESETS['delayed']['liu2024_pace']), line, 0.58, 0.8,
                            most=30)
    point = next(one for one in bifurcations(branch) if one.kind == 'branch point')
    orbit = switch_branch(point, line, 0.58, 0.8, most=6).points[-1].orbit
    run = simulate(orbit.network, orbit, orbit.period, orbit.network.delay / 400, progress=False)
    # Disturbances grow three times in a period: errors of the method stay small.
    assert run.x == pytest.approx(orbit(run.t), abs=1e-7)

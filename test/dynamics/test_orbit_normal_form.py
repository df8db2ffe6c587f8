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

"""Normal forms of bifurcating orbits: closed forms, the branches that leave, and simulation."""

from dataclasses import replace

from branch_switching import mode, switch_branch
from cpg_ros.dynamics.continuation import bifurcations, continue_orbit
from cpg_ros.dynamics.floquet import multipliers
from cpg_ros.dynamics.integration.simulate import simulate
from cpg_ros.dynamics.mesh.solve import from_path
from cpg_ros.dynamics.orbit_normal_form import orbit_normal_form
from cpg_ros.dynamics.solve_orbit import solve_from_path, solve_preset
from cpg_ros.networks.library.biped import Biped
from cpg_ros.networks.network import ParameterLine
from cpg_ros.networks.registry import NETWORKS, PRESETS
from depth import in_depth
from late_two_rhythms import LateTwoRhythms
import numpy as np
import pytest
from scipy.spatial import cKDTree
from two_rhythms import TwoRhythms


def normal_form_at(point):
    return orbit_normal_form(point.point.orbit, point.multiplier, point.part)


def hop(network):
    """The gait without the second rhythm: a circle of radius 1, both legs alike."""
    def path(theta):
        turn = 2.0 * np.pi * theta[:, None]
        one = np.hstack([np.cos(turn), np.sin(turn), 0.0 * turn, 0.0 * turn])
        return np.repeat(one, 2, axis=1)
    return solve_from_path(network, network.symmetry('hop'), path, 2.0 * np.pi / network.omega)


@pytest.mark.parametrize('alpha', [0.4, 1.1])
@pytest.mark.parametrize('kind', [TwoRhythms, LateTwoRhythms])
def test_a_torus_has_the_closed_form(kind, alpha):
    """Soft where alpha + e kappa < 0: of the second rhythm in itself, alpha > 0, both are hard."""
    network = kind(alpha=alpha)
    begins = network.begins()[0]
    branch = continue_orbit(hop(replace(network, growth=begins - 0.1)),
                            ParameterLine.parse('growth', kind), begins - 0.2, begins + 0.2)
    (point,) = (one for one in bifurcations(branch) if one.kind == 'torus')
    assert point.value == pytest.approx(begins, abs=1e-6)
    found = normal_form_at(point)
    # The two of the pair do not come in an order: z may turn either way.
    wanted = network.cubic()
    assert found.cubic.real == pytest.approx(wanted.real, rel=1e-5)
    assert abs(found.cubic.imag) == pytest.approx(abs(wanted.imag), rel=1e-5)
    assert found.soft == (found.verdict == 'supercritical') == (wanted.real < 0.0)


def point_of(network, preset, line, near):
    along = ParameterLine.parse(line, NETWORKS[network])
    known = solve_preset(PRESETS[network][preset])
    here = along.value(known.network)
    branch = continue_orbit(known, along, *sorted((here, near + 0.02 * np.sign(near - here))))
    return branch, min(bifurcations(branch), key=lambda one: abs(one.value - near))


def disturbance(orbit, point):
    """The disturbance of an orbit near a point, of which the largest component is 1 at most."""
    critical = mode(orbit, point.part, point.multiplier)
    size = np.abs(critical(np.arange(500) / 500)).max()
    return lambda theta: critical(theta) / size


def fraction_of(orbit, base, mode, cycles):
    """How much of a disturbance an orbit has beside another: by least squares over a cycle."""
    theta = np.arange(240) / 240
    best = None
    for start in np.arange(0.0, 1.0, 1.0 / 240):
        y = orbit((theta + start) * orbit.period) - base(cycles * theta * base.period)
        basis = np.array([mode(cycles * theta).ravel(),
                          base.derivative(cycles * theta * base.period).ravel()]).T
        found, rest = np.linalg.lstsq(basis, y.ravel(), rcond=None)[:2]
        if best is None or rest[0] < best[0]:
            best = rest[0], abs(found[0])
    return best[1]


def beside_a_branch(branch, point, leaving, cycles):
    """c by the orbits that leave: ``z^2 = -lambda / c``, lambda the growth of z along a branch."""
    critical, squares, ratios = 1.0 if cycles == 1 else -1.0, [], []
    for beside in leaving.points[:2]:
        base = min(branch.at(beside.value), key=lambda one: abs(
            cycles * one.period - beside.orbit.period))
        known = multipliers(base)
        every = np.concatenate([known.within, known.transverse])
        growth = np.log(abs(every[np.abs(every - critical).argmin()])) / base.period
        squares.append(fraction_of(beside.orbit, base, disturbance(base, point), cycles)**2)
        ratios.append(-growth / squares[-1])
    # Carried on to z = 0, where the normal form holds.
    return ratios[0] - squares[0] * (ratios[1] - ratios[0]) / (squares[1] - squares[0])


@pytest.mark.parametrize(('network', 'preset', 'line', 'near', 'soft'), [
    ('delayed', 'walk', 'tau', 0.35218, False),
    ('biped', 'walk', 'w_a', -0.27684, True),
    *in_depth(('delayed', 'liu2024_pace', 'd', 0.77323, False),
              ('biped', 'walk', 'w_a', 0.27693, False))])
def test_a_branch_leaves_as_the_normal_form_has_it(network, preset, line, near, soft):
    branch, point = point_of(network, preset, line, near)
    found = normal_form_at(point)
    assert found.soft == soft and abs(found.cubic.imag) < 1e-6 * abs(found.cubic)
    leaving = switch_branch(point, branch.along, *sorted((near - 0.1, near + 0.1)), most=4)
    assert beside_a_branch(branch, point, leaving, 1) == pytest.approx(found.cubic.real, rel=0.04)


def test_the_walk_leaves_the_hop_as_the_normal_form_has_it():
    """Of twice the period: the biped's hop where the walk ends."""
    line = ParameterLine.parse('w_a', Biped)
    walk = continue_orbit(solve_preset(PRESETS['biped']['walk']), line, -1.0, 0.4)
    last, value = walk.points[0].orbit, walk.ends[0].value
    hop = from_path(last.network, last.network.symmetry('two_legged_hop'),
                    lambda theta: last(0.5 * theta * last.period), 0.5 * last.period)
    branch = continue_orbit(hop, line, value - 0.05, value + 0.05)
    (point,) = (one for one in bifurcations(branch) if one.kind == 'period doubling')
    found = normal_form_at(point)
    leaving = switch_branch(point, line, -1.0, 0.4, most=4)
    assert beside_a_branch(branch, point, leaving, 2) == pytest.approx(found.cubic.real, rel=0.04)


def test_where_a_torus_is_hard_disturbances_grow_beyond_its_size_only():
    """Of the biped's run, where it is stable: sqrt(-lambda / c) divides what comes back."""
    branch, point = point_of('biped', 'run', 'w_a', -0.53281)
    cubic = normal_form_at(point).cubic.real
    assert point.kind == 'torus' and cubic > 0.0
    for gap in (0.0008, -0.0008):
        orbit = branch.at(point.value + gap)[0]
        known = multipliers(orbit)
        if known.attracts:
            break
    growth = np.log(known.leading) / orbit.period
    size = np.sqrt(-growth / cubic)
    mode = disturbance(orbit, point)
    curve = cKDTree(orbit(np.linspace(0.0, orbit.period, 40000)))
    for fraction in (0.75, 1.25):
        start = orbit(np.zeros(1))[0] + 2.0 * fraction * size * mode(np.zeros(1))[0]
        run = simulate(orbit.network, start, 50.0 * orbit.period, orbit.period / 1000,
                       progress=False)
        # Ten cycles at either end, in which the disturbance turns once or more.
        begin, end = (curve.query(part)[0].max() for part in (run.x[:10000], run.x[-10000:]))
        assert (end > 1.2 * begin) if fraction > 1.0 else (end < 0.85 * begin)

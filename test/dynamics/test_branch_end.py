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

"""Branches of periodic orbits: a law they follow, where they end, and what is refused."""

from cpg_ros.common.errors import InputError
from cpg_ros.dynamics import arclength
from cpg_ros.dynamics.arclength import NoOrbit
from cpg_ros.dynamics.continuation import continue_orbit
from cpg_ros.dynamics.solve_orbit import solve_preset
from cpg_ros.networks.library.biped import Biped
from cpg_ros.networks.library.quadruped import Quadruped
from cpg_ros.networks.network import ParameterLine
from cpg_ros.networks.registry import NETWORKS, PRESETS
from depth import in_depth
import numpy as np
import pytest


class Cubic:
    """x^3 - x = p, with a period of 1: two folds, at x = -+1/sqrt(3)."""

    def product(self, one, other):
        return float(one @ other)

    def step(self, z, border):
        x, period, p = z
        matrix = np.array([[3.0 * x**2 - 1.0, 0.0, -1.0], [0.0, 1.0, 0.0], border])
        right = np.array([[p - x**3 + x, 0.0], [1.0 - period, 0.0], [0.0, 1.0]])
        return np.linalg.solve(matrix, right).T

    def amplitude(self, z):
        return 1.0

    def renewed(self, z, border, again):
        return None


@pytest.mark.parametrize('step', [0.01, 0.1])
def test_the_folds_of_a_cubic(step):
    places, start = [], arclength.resolve_point(Cubic(), np.array([-1.5, 1.0, -1.5**3 + 1.5]),
                                                arclength.fixed_unknown(3, -1))
    folds, why = arclength.continue_curve(start, -3.0, 1.0,
                                          lambda place: places.append(place) or '',
                                          longest_step=step, most=1000)
    assert why == 'bound' and places[-1].value == 1.0
    assert [places[k].z[0] for k in folds] == pytest.approx([-3**-0.5, 3**-0.5], abs=1e-8)
    x = np.array([place.z[0] for place in places])
    assert (np.diff(x) > 0.0).all() and np.diff(x).max() <= 1.01 * step
    assert np.allclose(x**3 - x, [place.value for place in places], 0.0, 1e-12)


@pytest.mark.parametrize(('gait', 'value', 'exact'), [
    # AUTO-07p's homoclinic value of the pronk; the trot's lower end has T 3390 at -0.8516742.
    ('pronk', 0.3484239174, 1e-9), ('trot', -0.8517, 5e-5)])
def test_ends_where_the_period_grows_without_bound(gait, value, exact):
    preset = PRESETS['quadruped'][gait]
    branch = continue_orbit(solve_preset(preset), ParameterLine.parse('alpha=beta', Quadruped),
                            -1.5, 1.0, longest=200.0)
    (end,) = (end for end in branch.ends if end.why == 'period')
    assert end.value == pytest.approx(value, abs=exact)
    assert str(end) == f'homoclinic end near {end.value:.7g}, period grows'
    if gait == 'trot':
        (orbit,) = branch.at(-0.85167420)
        assert orbit.period == pytest.approx(3390.0, rel=1e-3)


def test_a_fold_at_a_point_of_the_branch_is_no_obstacle():
    # One point came out at the fold itself, where the rate has either sign.
    branch = continue_orbit(solve_preset(PRESETS['biped']['walk']),
                            ParameterLine.parse('current', Biped), 0.0, 1.0, most=100)
    assert branch.ends[0].why == 'period' and branch.ends[1].why == 'rest'
    assert branch.folds
    for fold in branch.folds:
        assert abs(fold.curve_point.rate) < 1e-6


@pytest.mark.parametrize('lines', [25, *in_depth(100)])
def test_random_lines_end_in_branches_or_are_refused(lines):
    draw = np.random.default_rng(20261122)
    ended = 0
    for _ in range(lines):
        name = draw.choice(list(PRESETS))
        preset = PRESETS[name][draw.choice(list(PRESETS[name]))]
        kind = NETWORKS[name]
        line = ParameterLine.parse(str(draw.choice([*kind.groups, *kind.parameters()])), kind)
        value = line.value(preset.network)
        try:
            branch = continue_orbit(solve_preset(preset), line, value - draw.uniform(0.01, 2.0),
                                    value + draw.uniform(0.01, 2.0), most=4)
        except (NoOrbit, InputError):
            continue
        assert {end.why for end in branch.ends} <= {
            'rest', 'symmetry', 'period', 'bound', 'steps', 'steep', 'lost'}
        ended += 1
    assert ended > 0.4 * lines


@pytest.mark.parametrize(('name', 'text', 'low', 'high', 'words'), [
    ('pace', 'alpha=-beta', -1.0, 1.0, 'not on the line alpha=-beta'),
    ('pace', 'alpha=beta', 0.3, 1.0, 'alpha=beta 0.2 is not from 0.3 to 1'),
    ('walk', 'w_21', -1.0, 1.0, 'w_21 breaks the symmetry: it needs .*w_21.* to be equal')])
def test_refusals(name, text, low, high, words):
    network = 'biped' if 'w_' in text else 'quadruped'
    orbit = solve_preset(PRESETS[network][name])
    with pytest.raises(ValueError, match=words):
        continue_orbit(orbit, ParameterLine.parse(text, NETWORKS[network]), low, high)

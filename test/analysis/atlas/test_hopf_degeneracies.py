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

"""Points on Hopf curves at which a second condition holds, against closed forms."""

from dataclasses import replace
from pathlib import Path

from cpg_ros.analysis.atlas.chart import chart_of
from cpg_ros.analysis.atlas.fold_curves import bautin_folds, distinct
from cpg_ros.analysis.atlas.hopf_curves import (
    ChartLine,
    curves_from,
    hopf_curves,
    hopf_degeneracies,
    hopf_starts,
    HopfStart,
    with_degeneracies,
)
from cpg_ros.dynamics.hopf import hopf_points
from cpg_ros.networks.registry import find_network, PRESETS
from depth import in_depth
import numpy as np
import pytest
from scipy.optimize import brentq

SUPPORT = Path(__file__).parents[2] / 'support'
TROT = PRESETS['delayed']['trot'].network
SEPTIC = {'mu': 1.0, 'omega': 6.0, 'k': -0.5, 'kappa': 0.3, 'a': -1.0, 'b': 1.0}


def own(name, over, **values):
    """Return the plane of a network of the tests' own."""
    file = str(SUPPORT / f'{name}.py')
    return chart_of(file, find_network(file)(**values), over, (9, 9))


def through_line(chart, gaits, axis=1, fraction=0.4):
    """Return the Hopf curves through one line along an axis."""
    axes = chart.first, chart.second
    fixed, along = axes[1 - axis], axes[axis]
    return curves_from(chart, hopf_starts(ChartLine(
        chart, gaits, axis, fixed.low + fraction * (fixed.high - fixed.low), along.low,
        along.high)))


def start(chart, gait, mode, values, omega):
    """Return a Hopf point that is known in closed form."""
    return HopfStart(gait, mode, np.append((np.array(values) - chart.low) / chart.size, omega))


@pytest.mark.parametrize('order', [1, *in_depth(-1)])
def test_a_bautin_point_is_where_the_cubic_coefficient_is_0(order):
    """Each class has its own: the walk's is at mu = k, the hop's at mu = -k."""
    chart = own('septic_legs', [('a', (-1.0, 1.3)), ('mu', (-1.0, 1.5))][::order], **SEPTIC)
    curves = through_line(chart, ('walk', 'hop'), axis=1 if order == 1 else 0)
    assert len(curves) == 2
    for curve in curves:
        (point,) = hopf_degeneracies(chart, curve)
        (gait,) = curve.gaits
        assert (point.kind, point.gait) == ('Bautin', gait)
        a, mu = point.values[::order]
        assert a == pytest.approx(0.0, abs=1e-10)
        assert mu == pytest.approx(-0.5 if gait == 'walk' else 0.5, abs=1e-10)
        assert point.omega == pytest.approx(5.7 if gait == 'walk' else 6.3, abs=1e-10)


@pytest.mark.parametrize('order', [1, *in_depth(-1)])
def test_the_fold_curve_that_a_bautin_point_bears_ends_in_a_cusp(order):
    """On the walk mu = k - a rho - b rho^2 + rho^3, with folds at a = 3 rho^2 - 2 b rho."""
    chart = own('septic_legs', [('a', (-1.0, 1.3)), ('mu', (-1.0, 1.5))][::order], **SEPTIC)
    (curve,) = through_line(chart, ('walk',), axis=1 if order == 1 else 0)
    (fold,) = bautin_folds((chart, with_degeneracies((chart, curve))))
    a, mu = fold.points.T[::order]
    rho = (1.0 - np.sqrt(np.maximum(1.0 + 3.0 * a, 0.0))) / 3.0
    assert len(a) > 6
    # At the cusp rho has no bounded slope by a.
    assert mu[:-1] == pytest.approx((-0.5 - a * rho - rho**2 + rho**3)[:-1], abs=1e-8)
    assert rho[0] == pytest.approx(0.0, abs=1e-10)
    assert [point.kind for point in fold.codimension_two] == ['Bautin', 'cusp']
    assert fold.codimension_two[1].values[::order] == pytest.approx(
        (-1.0 / 3.0, -0.5 + 1.0 / 27.0), abs=1e-8)
    # Met in another way as well, it is one curve.
    assert len(distinct(chart, [fold, fold])) == 1


def test_two_classes_cross_at_a_hopf_hopf_point():
    """The walk's pair is on the axis at mu = k, the hop's at mu = -k."""
    chart = own('septic_legs', [('k', (-1.0, 1.3)), ('mu', (-1.0, 1.5))], **SEPTIC)
    curves = through_line(chart, ('walk', 'hop'))
    assert len(curves) == 2
    for curve in curves:
        (point,) = hopf_degeneracies(chart, curve)
        assert point.kind == 'Hopf-Hopf'
        assert {point.gait, *point.other} == {'walk', 'hop'}
        assert point.values == pytest.approx((0.0, 0.0), abs=1e-10)
        assert {round(point.omega, 9), round(point.other_omega, 9)} == {5.7, 6.3}


def test_a_curve_that_ends_where_the_stand_folds_ends_in_a_bogdanov_takens_point():
    chart = own('folding_legs', [('m', (-0.5, 0.5)), ('n', (-1.0, 1.0))], m=0.1, n=0.2, c=1.0)
    (curve,) = curves_from(chart, [start(chart, 'hop', (0,), (0.16, 0.2), np.sqrt(0.6))])
    (point,) = hopf_degeneracies(chart, curve)
    assert point.kind == 'Bogdanov-Takens'
    assert point.values == pytest.approx((0.25, 0.5), abs=1e-9)


def test_a_zero_hopf_point_ends_the_curve_where_the_stand_folds():
    chart = own('folding_swing', [('m', (-0.5, 0.5)), ('n', (-1.0, 1.0))], m=0.1, n=0.2, c=1.0,
                omega=3.0)
    (curve,) = curves_from(chart, [start(chart, 'hop', (0,), (0.16, -0.2), 3.0)])
    (point,) = hopf_degeneracies(chart, curve)
    assert (point.kind, point.other) == ('zero-Hopf', ('hop',))
    assert point.values == pytest.approx((0.25, -0.5), abs=1e-9)
    assert point.omega == pytest.approx(3.0, abs=1e-9)


def test_a_pole_of_the_coefficient_is_no_bautin_point():
    """Twice the walk's frequency is the hop's where 4 (1 + 2 n) = 1 - 2 n, at n = -0.3."""
    chart = own('folding_legs', [('m', (-0.42, -0.2)), ('n', (-0.35, -0.1))], m=0.1, n=0.2, c=1.0)
    (curve,) = curves_from(chart, [start(chart, 'walk', (1,), (-0.24, -0.2), np.sqrt(0.6))])
    assert curve.points[:, 1].min() < -0.31
    assert curve.points[:, 1].max() > -0.18
    assert hopf_degeneracies(chart, curve) == ()


def born(c, mode, b=TROT.b, n=0):
    """Omega and tau_n of a class of the delayed network, of the fast wave."""
    j, k = mode
    whole = TROT.a + b + TROT.d * 1j**-j
    omega = whole.imag + np.sqrt(c * c - whole.real**2)
    turn = -np.angle((1j * omega - whole) / (c * (-1)**k)) % (2.0 * np.pi)
    return omega, (turn + 2.0 * np.pi * n) / omega


def test_with_a_delay_hopf_hopf_points_are_where_the_formulas_curves_meet():
    chart = chart_of('delayed', TROT, [('c', (4.0, 8.0)), ('tau', (0.2, 0.5))], (9, 9))
    (curve,) = through_line(chart, ('trot',), fraction=0.9)
    points = hopf_degeneracies(chart, curve)
    c = brentq(lambda c: born(c, (2, 1))[1] - born(c, (1, 1))[1], 6.0, 7.5, xtol=1e-14)
    (meeting,) = (point for point in points if point.kind == 'Hopf-Hopf')
    assert meeting.other == ('walk',)
    assert meeting.values == pytest.approx((c, born(c, (2, 1))[1]), abs=1e-9)
    assert meeting.other_omega == pytest.approx(born(c, (1, 1))[0], abs=1e-9)
    # The stand gives way to one in which all cells are equal where a + b + d + c = 0.
    (still,) = (point for point in points if point.kind == 'zero-Hopf')
    assert still.other == ('pronk',)
    assert still.values[0] == pytest.approx(-TROT.a - TROT.b - TROT.d, abs=1e-9)


def test_with_a_delay_0_is_a_double_root_at_a_bogdanov_takens_point():
    """lambda = A - c exp(-lambda tau) has it at A = c = 1/tau, A = a + b - d of the trot."""
    chart = chart_of('delayed', replace(TROT, tau=0.5), [('c', (0.1, 4.0)), ('a', (-3.0, 1.2))],
                     (9, 9))
    points = [point for curve in through_line(chart, ('trot',), fraction=0.6)
              for point in hopf_degeneracies(chart, curve)]
    (takens,) = (point for point in points if point.kind == 'Bogdanov-Takens')
    assert takens.values == pytest.approx((2.0, 2.0 - TROT.b + TROT.d), abs=1e-9)


def test_with_a_delay_the_trots_bautin_point_is_that_of_the_formula():
    """Re k2 = 0 of k2 ~ (a - i omega)/(1 + tau (i omega - A)): omega^2 tau = a (1 - A tau).

    The third derivative of tanh is -2 at 0, and b - d - c exp(-i omega tau) is i omega - a.
    """
    b = 5.5
    chart = chart_of('delayed', replace(TROT, b=b), [('c', (3.5, 6.0)), ('tau', (1.0, 3.0))],
                     (9, 9))
    whole = TROT.a + b - TROT.d

    def gap(c):
        omega, tau = born(c, (2, 1), b, n=1)
        return omega**2 * tau - TROT.a * (1.0 - whole * tau)

    c = brentq(gap, 4.0, 5.5, xtol=1e-14)
    found = [point.values for curve in through_line(chart, ('trot',), fraction=0.5)
             for point in hopf_degeneracies(chart, curve) if point.kind == 'Bautin']
    tau = born(c, (2, 1), b, n=1)[1]
    assert found == [pytest.approx((c, tau), abs=1e-9)]
    # There the normal form is degenerate, up to rounding, and nowhere else.
    for weight, degenerate in ((c, True), (c + 1e-6, False)):
        points = hopf_points(replace(TROT, b=b, c=weight), 'tau', tau - 0.01, tau + 0.01)
        assert [point.normal_form.degenerate for point in points
                if point.gait == 'trot'] == [degenerate]


@pytest.mark.deep
def test_a_curve_of_equal_classes_has_no_points_of_rounding():
    """Pace, bound and pronk of Matsuoka's share their roots; the rates have no curvature."""
    trot = PRESETS['matsuoka']['trot'].network
    chart = chart_of('matsuoka', trot, [('a', (1.0, 5.0)), ('beta', (1.0, 5.0))], (9, 9))
    (curve,) = hopf_curves(chart, trot.gaits())
    kinds = {point.kind for point in hopf_degeneracies(chart, curve)}
    assert not kinds & {'Bautin', 'Hopf-Hopf'}

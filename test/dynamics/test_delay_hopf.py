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

"""A network of this file, with a delay and two variables a cell, against its whole linearisation.

Three FitzHugh-Nagumo cells in a ring, each of which hears the one before it a delay ago.
"""

from dataclasses import dataclass, replace
from fractions import Fraction
from typing import ClassVar

from cpg_ros.common.errors import InputError
from cpg_ros.dynamics.equilibrium import equilibria, equilibrium
from cpg_ros.dynamics.hopf import first_hopf, hopf_points
from cpg_ros.dynamics.isotypic import blocks
from cpg_ros.dynamics.solve_orbit import solve_orbit
from cpg_ros.networks.definition import Range
from cpg_ros.networks.network import Network, ParameterLine
from cpg_ros.networks.registry import PRESETS
from cpg_ros.networks.symmetry import Group, Symmetry
from depth import in_depth
import numpy as np
import pytest

BEFORE = (2, 0, 1)
Z3 = Group(3, (('omega', (1, 2, 0)),))
GAITS = {'together': Fraction(0), 'wave': Fraction(1, 3)}


@dataclass(frozen=True)
class Ring(Network):
    """Weight of the coupling, threshold, speed of w, and the delay."""

    weight: float
    threshold: float
    speed: float
    lag: float

    name: ClassVar[str] = 'ring'
    cells: ClassVar[int] = 3
    states: ClassVar[tuple[str, ...]] = ('v', 'w')
    delay_parameter: ClassVar[str] = 'lag'
    longest_delay: ClassVar[float] = 50.0
    step: ClassVar[float] = 0.02
    ranges: ClassVar[dict[str, Range]] = {
        name: Range(-50.0, 50.0, name) for name in ('weight', 'threshold', 'speed', 'lag')}
    legs: ClassVar[dict[str, dict[str, tuple[int, ...]]]] = {
        'only': {'a': (1,), 'b': (2,), 'c': (3,)}}
    couplings: ClassVar[tuple[str, ...]] = ('weight',)
    usual_gait: ClassVar[str] = 'together'
    free: ClassVar[tuple[str, ...]] = ('weight',)
    line: ClassVar[str] = 'lag'

    @staticmethod
    def equations(cell, p):
        v, w = cell.now()
        heard, _ = cell.past(BEFORE)
        return v - v**3 / 3.0 - w + p.weight * heard, p.speed * (v + p.threshold - 0.8 * w)

    @classmethod
    def gaits(cls):
        return tuple(GAITS)

    def symmetry(self, gait):
        return Symmetry.of(Z3, {'omega': GAITS[gait]}, variables=2)

    @classmethod
    def presets(cls):
        return {}


RING = Ring(-0.7, 0.9, 0.3, 1.0)
LAG = ParameterLine(('lag',), (1.0,))


def rest_by_hand(ring):
    """Return the equilibrium, w eliminated: one cubic in v."""
    roots = np.roots([-1.0 / 3.0, 0.0, 1.0 + ring.weight - 1.25, -1.25 * ring.threshold])
    v = roots[np.abs(roots.imag) < 1e-9].real
    return np.stack([v, 1.25 * (v + ring.threshold)], axis=1)


def rightmost(ring, points=40):
    """Roots of the whole network: all six components on Chebyshev points of [-lag, 0]."""
    (v, _), = rest_by_hand(ring)
    k = np.arange(points + 1)
    x = np.cos(np.pi * k / points)
    c = np.where((k == 0) | (k == points), 2.0, 1.0) * (-1.0)**k
    slope = np.outer(c, 1.0 / c) / (x[:, None] - x + np.eye(points + 1))
    slope -= np.diag(slope.sum(axis=1))
    whole = np.kron(2.0 / ring.lag * slope, np.eye(6))
    whole[:6] = 0.0
    whole[:6, :6] = np.kron([[1.0 - v * v, -1.0], [ring.speed, -0.8 * ring.speed]], np.eye(3))
    whole[:3, -6:-3] = ring.weight * np.eye(3)[list(BEFORE)]
    roots = np.linalg.eigvals(whole)
    return roots[np.argsort(-roots.real)]


def test_the_equilibrium_is_the_cubic_s_root():
    assert equilibrium(RING) == pytest.approx(rest_by_hand(RING)[0], abs=1e-12)
    # A positive weight makes three of it.
    three = replace(RING, weight=1.5, threshold=0.1)
    assert equilibria(three) == pytest.approx(
        rest_by_hand(three)[np.argsort(rest_by_hand(three)[:, 0])], abs=1e-10)


@dataclass(frozen=True)
class Bent(Ring):
    """With a third power of w as well: the rates are linear in neither variable."""

    name: ClassVar[str] = 'bent'

    @staticmethod
    def equations(cell, p):
        v, w = cell.now()
        heard, _ = cell.past(BEFORE)
        return v - v**3 / 3.0 - w + p.weight * heard, p.speed * (v + p.threshold - w**3)


def test_equilibria_of_rates_that_are_linear_in_nothing():
    bent = Bent(1.5, 0.1, 0.3, 1.0)
    v = np.poly1d([1.0, 0.0, 0.0, -bent.threshold])
    balance = (1.0 + bent.weight) * v - v**3 / 3.0 - np.poly1d([1.0, 0.0])
    w = np.sort(balance.roots[np.abs(balance.roots.imag) < 1e-9].real)
    assert len(w) == 3
    # v rises with w.
    assert equilibria(bent) == pytest.approx(np.stack([v(w), w], axis=1), abs=1e-9)


def test_blocks_have_the_roots_of_the_whole_network():
    theirs = rightmost(RING)[:12]
    split = blocks(RING, equilibrium(RING))
    assert [block.gait for block in split] == ['together', 'wave', 'wave']
    assert [block.wave for block in split] == ['', 'B leads A', 'A leads B']
    ours = np.concatenate([block.roots(8) for block in split])
    for root in theirs:
        assert np.abs(ours - root).min() < 1e-9
    assert max(block.leading.real for block in split) == pytest.approx(theirs[0].real)


@pytest.mark.parametrize(('text', 'low', 'high'), [
    ('lag', 0.1, 30.0), *in_depth(('weight', -1.6, -0.3), ('threshold', 0.3, 1.3),
                                ('lag=-weight', 0.3, 2.0))])
def test_points_lie_where_the_whole_linearisation_crosses(text, low, high):
    line = ParameterLine.parse(text, Ring)
    points = hopf_points(RING, line, low, high)
    assert points and [point.value for point in points] == sorted(
        point.value for point in points)
    for point in points:
        roots = rightmost(point.network)
        assert np.abs(roots - 1j * point.omega).min() < 1e-8
        # Of a class that is its own conjugate, or of two that are one another's.
        others = np.delete(roots, [np.abs(roots - sign * 1j * point.omega).argmin()
                                   for sign in (1.0, -1.0)])
        assert point.unstable_roots == (others.real > 1e-7).sum()
        moved = []
        for side in (1.0, -1.0):
            there = rightmost(line.at(RING, point.value + side * 1e-5))
            near = 1j * point.omega + side * 1e-5 * point.normal_form.k1
            moved.append(there[np.abs(there - near).argmin()])
        assert (moved[0] - moved[1]) / 2e-5 == pytest.approx(point.normal_form.k1, rel=1e-5)
    # None is missed: between them the roots to the right stay as many, but for real ones.
    counts = [(roots := rightmost(line.at(RING, value)))[(roots.real > 0.0)
              & (np.abs(roots.imag) > 1e-6)].size for value in (low, high)]
    assert counts[1] - counts[0] == 2 * sum(point.direction for point in points)


def test_a_gait_is_born_at_the_first_of_its_points():
    for gait in RING.gaits():
        first = first_hopf(RING, gait)
        points = [point for point in hopf_points(RING, LAG, 0.0, 30.0)
                  if point.block.symmetry == RING.symmetry(gait) and point.direction > 0]
        assert (first is None) == (not points)
        if points:
            assert (first.value, first.omega) == pytest.approx(
                (points[0].value, points[0].omega), rel=1e-12)


def test_the_normal_form_predicts_the_exact_orbits():
    judged = 0
    for gait in RING.gaits():
        point = first_hopf(RING, gait)
        if point is None or not point.supercritical:
            continue
        theta, sizes, turns = np.arange(256) / 256, [], []
        far = 4e-4 / point.amplitude(point.value + point.normal_form.side)**2
        for mu in (far, far / 2.0):
            value = point.value + point.normal_form.side * mu
            orbit = solve_orbit(replace(RING, lag=value), gait)
            first = 2.0 * abs(np.mean(orbit.waveform(theta) * np.exp(-2j * np.pi * theta)))
            sizes.append(first / point.amplitude(value) - 1.0)
            turns.append(orbit.period / point.period(value) - 1.0)
        # Errors of first order in the distance, of second order in the period.
        assert abs(sizes[1]) < 4e-3 and sizes[1] / sizes[0] == pytest.approx(0.5, abs=0.05)
        assert turns[1] / turns[0] == pytest.approx(0.25, abs=0.05)
        judged += 1
    assert judged


def test_a_line_may_begin_where_delayed_cells_are_uncoupled():
    """At c = 0 they have no root by the delay."""
    network = PRESETS['delayed']['trot'].network
    points, beside = (hopf_points(network, 'c', low, 10.0) for low in (0.0, 0.25))
    assert points and [point.gait for point in points] == [point.gait for point in beside]
    for point in points:
        # The root i omega of one variable, for which |omega - A| = |c|.
        a = point.block.now[0, 0]
        assert abs(1j * point.omega - a) == pytest.approx(point.value, rel=1e-6)


def test_a_negative_delay_is_refused():
    with pytest.raises(InputError, match='lag from -1 to 2 makes lag negative'):
        hopf_points(RING, LAG, -1.0, 2.0)

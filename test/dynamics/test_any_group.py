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

"""Classes of any group of symmetries, Hopf points and equilibria, against the whole equations."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cache
from itertools import pairwise
from typing import ClassVar

from cpg_ros.dynamics.equilibrium import (
    all_equilibria,
    continue_equilibrium,
    equilibrium,
)
from cpg_ros.dynamics.floquet import multipliers
from cpg_ros.dynamics.hopf import hopf_points
from cpg_ros.dynamics.integration.simulate import simulate
from cpg_ros.dynamics.isotypic import blocks, everywhere, group_of, representations
from cpg_ros.dynamics.mesh.solve import from_path
from cpg_ros.dynamics.solve_orbit import branch_orbits
from cpg_ros.networks.library.delayed import Delayed
from cpg_ros.networks.library.quadruped import Quadruped
from cpg_ros.networks.network import Network, Preset, Range
from cpg_ros.networks.symmetry import Group, Symmetry
import numpy as np
import pytest
from scipy.optimize import brentq, fsolve

TURN, FLIP = (1, 2, 3, 0), (0, 3, 2, 1)
SQUARE = Group(4, (('turn', TURN), ('flip', FLIP)))
#: Two rings of four cells that a flip exchanges.
TWO_SQUARES = Group(8, (('turn', (1, 2, 3, 0, 7, 4, 5, 6)), ('flip', (4, 5, 6, 7, 0, 1, 2, 3))))
GROUPS = {
    'triangle': Group(3, (('turn', (1, 2, 0)), ('flip', (0, 2, 1)))),
    'triangle, six cells': Group(6, (('turn', (1, 2, 0, 4, 5, 3)), ('flip', (3, 5, 4, 0, 2, 1)))),
    'square': SQUARE, 'square, eight cells': TWO_SQUARES,
    'hexagon': Group(6, (('turn', (1, 2, 3, 4, 5, 0)), ('flip', (0, 5, 4, 3, 2, 1)))),
    'all of four': Group(4, (('turn', TURN), ('swap', (1, 0, 2, 3)))),
    'even of four': Group(4, (('turn', (1, 2, 0, 3)), ('pairs', (1, 0, 3, 2)))),
    'unlike pairs': Group(4, (('side', (1, 0, 3, 2)),)),
    'three and one': Group(4, (('turn', (1, 2, 0, 3)),)),
    'none': Group(3, ())}


class Ring(Network):
    """Four FitzHugh-Nagumo cells in a square: v' = v - v^3/3 - w + i + k (v_left + v_right)."""

    name = 'square'
    cells = 4
    states = ('v', 'w')
    readout = 'phase'
    step = 0.05
    legs: ClassVar = {'first': {f'leg{n}': (n,) for n in range(1, 5)}}
    usual_gait = 'walk'
    couplings = ('k',)
    free = ('i', 'k')
    line = 'i'
    span = (-0.5, 0.7)
    shifts: ClassVar = {
        'pronk': {'turn': 0, 'flip': 0}, 'trot': {'turn': Fraction(1, 2), 'flip': 0},
        'walk': {'turn': Fraction(1, 4)}, 'bound': {'turn flip': 0, 'turn^2': Fraction(1, 2)},
        'half_bound': {'flip': 0, 'turn^2': Fraction(1, 2)}}

    @staticmethod
    def equations(cell, p):
        v, w = cell.now()
        left, _ = cell.now(lambda number: number - 1)
        right, _ = cell.now(lambda number: number + 1)
        return (v - v**3 / 3.0 - w + p.i + p.k * (left + right), 0.08 * (v + 0.7 - 0.8 * w))

    @classmethod
    def gaits(cls):
        return tuple(cls.shifts)

    def symmetry(self, gait):
        return Symmetry.of(SQUARE, self.shifts[gait])

    @classmethod
    def presets(cls):
        return {'walk': Preset('walk', cls(0.3, -0.2))}


@dataclass(frozen=True)
class Square(Ring):
    i: float = 0.3
    k: float = -0.2

    ranges: ClassVar = {'i': Range(-3.0, 3.0, 'current'), 'k': Range(-2.0, 2.0, 'coupling')}


@dataclass(frozen=True)
class Unlike(Ring):
    """Two legs with a fast and a slow cell each, of which the slow one also has another input."""

    k: float = -0.2
    i: float = 0.3
    m: float = 0.2
    j_fast: float = 0.0
    j_slow: float = 0.1

    name = 'unlike'
    ranges: ClassVar = {name: Range(-2.0, 2.0, '') for name in ('k', 'i', 'm', 'j_fast', 'j_slow')}
    own_of_cells: ClassVar = {'j': ('j_fast',) * 2 + ('j_slow',) * 2}
    couplings = ('k', 'm')
    legs: ClassVar = {'ankle': {'left': (1, 3), 'right': (2, 4)}}
    shifts: ClassVar = {'walk': {'side': Fraction(1, 2)}, 'hop': {'side': 0}}

    @staticmethod
    def equations(cell, p):
        v, w = cell.now()
        other, _ = cell.now((1, 0, 3, 2))
        antagonist, _ = cell.now((2, 3, 0, 1))
        return (v - v**3 / 3.0 - w + p.i + p.j + p.k * other - p.m * antagonist,
                0.08 * (v + 0.7 - 0.8 * w))

    def symmetry(self, gait):
        return Symmetry.of(GROUPS['unlike pairs'], self.shifts[gait])

    @classmethod
    def presets(cls):
        return {'walk': Preset('walk', cls())}


def permuted(group, name, matrix):
    order = np.argsort(group.elements[name])
    return matrix[np.ix_(order, order)]


def apart(found, wanted):
    """Largest distance of each wanted number to the found one that is left for it."""
    assert len(found) == len(wanted)
    found, gaps = list(found), []
    for one in wanted:
        gaps.append(min(abs(np.array(found) - one)))
        found.pop(int(np.abs(np.array(found) - one).argmin()))
    return max(gaps)


def dense(network, state):
    """Eigenvalues of the whole network at a state of all cells."""
    return np.linalg.eigvals(network.jacobian(state))


def listed(split):
    return np.concatenate([block.roots(64).repeat(block.copies) for block in split])


@pytest.mark.parametrize('name', GROUPS)
def test_classes_of_a_group_hold_all_eigenvalues_of_what_commutes_with_it(name):
    group = GROUPS[name]
    split = representations(group, 1, False)
    matrix = np.random.default_rng(7).standard_normal((group.cells, group.cells))
    matrix = sum(permuted(group, element, matrix) for element in group.elements)
    found = []
    for one in split:
        small = one.columns.conj().T @ matrix @ one.columns
        # The disturbances of a class do not leave it.
        assert np.allclose(matrix @ one.columns, one.columns @ small, 0.0, 1e-9)
        assert np.allclose(one.columns.conj().T @ one.columns, np.eye(one.columns.shape[1]))
        found += [*np.linalg.eigvals(small)] * one.dimension
    assert apart(found, np.linalg.eigvals(matrix)) < 1e-6 * np.abs(matrix).max()
    # Of different classes, no disturbance of one is in another.
    assert all(np.abs(one.columns.conj().T @ other.columns).max() < 1e-9
               for one in split for other in split if one is not other)


def test_classes_of_a_square():
    # The permutation representation of D4 on four corners is A1 + B + E.
    assert [one.dimension for one in representations(SQUARE, 1, False)] == [1, 1, 2]
    # On eight cells it is the regular one: each as often as its dimension.
    split = representations(TWO_SQUARES, 1, False)
    assert [(one.dimension, one.columns.shape[1]) for one in split] == [(1, 1)] * 4 + [(2, 2)]


@pytest.mark.parametrize('network', [Square(0.3, -0.2), Square(0.1, 0.15), Unlike(),
                                     Unlike(0.3, 0.2, -0.3)])
def test_blocks_hold_all_roots_of_the_whole_network(network):
    rest = everywhere(network, equilibrium(network))
    assert np.abs(network.rates(rest)).max() < 1e-12
    found = fsolve(network.rates, rest + 1e-3, fprime=network.jacobian)
    assert np.abs(found - rest).max() < 1e-8
    assert apart(listed(blocks(network, rest)), dense(network, rest)) < 1e-9


@cache
def points_of(network):
    return hopf_points(network, 'i', -1.0, 1.5)


@pytest.mark.parametrize('network', [Square(0.3, -0.2), Square(0.1, 0.15), Unlike()])
def test_hopf_points_are_those_of_the_whole_network(network):
    def right(value):
        moved = replace(network, i=value)
        return int((dense(moved, everywhere(moved, equilibrium(moved))).real > 0.0).sum())

    points = points_of(network)
    assert len(points) >= 2
    for point in points:
        values = dense(point.network, point.state)
        close = np.abs(values - 1j * point.omega) < 1e-7
        assert close.sum() == point.block.copies
        others = values[~close & (np.abs(values + 1j * point.omega) > 1e-7)]
        assert point.unstable_roots == (others.real > 0.0).sum()
        assert right(point.value + 1e-5) - right(point.value - 1e-5) == (
            2 * point.direction * point.block.copies)
    # No further ones: the count does not change in between.
    values = [-1.0, *(point.value for point in points), 1.5]
    for low, high in pairwise(values):
        assert high - low < 1e-6 or right(low + 1e-6) == right(high - 1e-6)


def first_harmonic(orbit, cell):
    theta = np.arange(512) / 512
    return 2.0 * abs(np.exp(-2j * np.pi * theta) @ orbit(theta * orbit.period)[:, cell]) / 512


@pytest.mark.parametrize('gait', ['walk', 'bound', 'half_bound', 'trot'])
def test_gaits_branch_off_a_class_of_two_copies_as_their_normal_form_says(gait):
    # Of the class E three kinds of orbits branch off: a wave that runs round, neighbours in pairs,
    # and two cells half a cycle apart with two that move at twice the frequency.
    symmetry = Square().symmetry(gait)
    points = [moved for point in points_of(Square(0.1, 0.15 if gait != 'trot' else -0.2))
              if (moved := point.towards(symmetry)) is not None]
    assert points
    for point in points[:1]:
        assert point.block.copies == (1 if gait == 'trot' else 2)
        cell = int(np.abs(point.eigenvector[:4]).argmax())
        gaps = []
        for mu in (2e-5, 1e-5):
            value = point.value + point.normal_form.side * mu
            orbit = from_path(point.line.at(point.network, value), symmetry,
                              lambda theta, value=value, point=point: point.path(value, theta),
                              point.period(value))
            wanted = (2.0 * abs(point.eigenvector[cell])
                      * point.normal_form.radius(value - point.value))
            gaps.append([first_harmonic(orbit, cell) / wanted - 1.0,
                         orbit.period / point.period(value) - 1.0])
        assert np.abs(gaps).max() < 0.02
        # The error is of the next order: half as large at half the distance.
        assert np.allclose(gaps[0], 2.0 * np.array(gaps[1]), 0.1, 1e-5)


def test_orbits_of_unlike_cells_are_followed_from_their_hopf_points():
    network = Unlike()
    orbits = [orbit for _, along in branch_orbits(network, 'walk') for orbit in along]
    assert orbits
    for orbit in orbits:
        assert orbit.residual < 1e-8
        assert orbit.leads[[0, 1]] == pytest.approx([0.0, 0.5])
        # A simulation from the orbit stays there for a period, if nothing grows fast.
        if multipliers(orbit).leading < 10.0:
            run = simulate(network, orbit(np.zeros(1))[0], orbit.period, 0.01, progress=False)
            assert np.abs(run(orbit.period)[0] - run.x[0]).max() < 1e-5


EXAMPLE = Delayed(-4.5, 1.0, 6.5, -2.0, 0.4)


def test_the_pose_in_which_a_published_walk_freezes():
    # Fore and hind cells have different signs: -4.5 x + (1 + 2 + 6.5) tanh x = 0.
    found = {one.label: one for one in all_equilibria(EXAMPLE)}
    level = brentq(lambda x: -4.5 * x + 9.5 * np.tanh(x), 0.5, 5.0)
    frozen = found['<kappa, omega^2>']
    assert np.allclose(np.abs(frozen.state), level, 0.0, 1e-9)
    assert np.allclose(frozen.state * np.tile([1, 1, -1, -1], 2) * np.sign(frozen.state[0]),
                       level, 0.0, 1e-9)
    assert frozen.attracts and frozen.unstable == 0
    # It is where a simulation with a little noise at the start ends.
    rng = np.random.default_rng(3)
    run = simulate(EXAMPLE, 0.01 * rng.standard_normal(8), 400.0, 0.01, progress=False)
    assert np.abs(np.abs(run.x[-1]) - level).max() < 1e-6
    assert np.ptp(run.x[-100:], axis=0).max() < 1e-9


def orbit_of(network, state):
    """All images of a state under the network's symmetries."""
    signs = (1.0, -1.0) if network.symmetry(network.gaits()[0]).odd else (1.0,)
    images = []
    for element in group_of(network).elements.values():
        image = np.empty((network.variables, network.cells))
        image[:, list(element)] = state.reshape(network.variables, -1)
        images += [sign * image.ravel() for sign in signs]
    return images


INHIBITED = Square(-0.05, -0.6)


@pytest.mark.parametrize('network', [EXAMPLE, INHIBITED, Unlike(-0.9, 0.0, 0.6)])
def test_no_equilibrium_is_missed_that_other_code_finds(network):
    found = all_equilibria(network)
    rng = np.random.default_rng(11)
    seen = 0
    for start in rng.uniform(-3.0, 3.0, (150, network.components)):
        state, _, ok, _ = fsolve(network.rates, start, xtol=1e-12, full_output=True)
        if ok != 1 or np.abs(network.rates(state)).max() > 1e-10:
            continue
        seen += 1
        assert min(np.abs(one.state - image).max() for one in found
                   for image in orbit_of(network, state)) < 1e-6
    assert seen > 30
    for one in found:
        assert np.abs(network.rates(one.state)).max() < 1e-10
        fixed = [name for name, element in group_of(network).elements.items()
                 if np.allclose(one.state.reshape(network.variables, -1)[:, np.argsort(element)],
                                one.state.reshape(network.variables, -1), 0.0, 1e-6)]
        assert len(fixed) == len(one.group.elements)
        if not network.delay_parameter:
            values = dense(network, one.state)
            assert one.unstable == (values.real > 0.0).sum()
            assert apart(listed(one.blocks), values) < 1e-6


def test_a_square_of_cells_that_inhibit_each_other_freezes_in_a_pose():
    found = all_equilibria(INHIBITED)
    assert [(len(one.group.elements), one.attracts) for one in found] == [(8, False), (4, True)]


def test_pitchforks_of_the_delayed_network_lie_where_a_root_is_zero():
    # At rest -(a + b + d i^-j) = c (-1)^k: c is 5.5 for (0, 0) and 1.5 for (2, 0).
    rest = next(one for one in all_equilibria(EXAMPLE) if not one.state.any())
    branch = continue_equilibrium(rest, 'c', 1.0, 8.0)
    forks = {one.block.mode: one.value for one in branch.crossings if one.kind == 'pitchfork'}
    assert forks == {(0, 0): pytest.approx(5.5, abs=1e-9), (2, 0): pytest.approx(1.5, abs=1e-9)}
    hopf = [(one.value, one.omega) for one in branch.crossings if one.kind == 'Hopf']
    wanted = [(point.value, point.omega) for point in hopf_points(EXAMPLE, 'c', 1.0, 8.0)]
    assert np.allclose(hopf, wanted, 0.0, 1e-8)
    # The pose begins at the second, the equilibrium with equal cells at the first.
    for one, value in ((all_equilibria(EXAMPLE)[0], 5.5), (all_equilibria(EXAMPLE)[-1], 1.5)):
        assert one.state.any()
        crossings = continue_equilibrium(one, 'c', 1.0, 8.0).crossings
        turned = [other for other in crossings if other.value == pytest.approx(value, abs=1e-6)]
        assert [other.kind for other in turned] == ['pitchfork']
        for other in crossings:
            # By differences of the rates, with the delayed state equal to the state.
            rates = replace(EXAMPLE, c=other.value).rates
            steps = 1e-5 * np.eye(8)
            matrix = (rates(other.equilibrium.state + steps)
                      - rates(other.equilibrium.state - steps)) / 2e-5
            assert other.kind == 'Hopf' or np.linalg.svd(matrix)[1][-1] < 1e-6


def test_a_fold_of_the_stand():
    # alpha + gamma = 0.7071: see test_equilibrium.
    network = Quadruped(0.3, 0.3, 0.3, 0.3)
    low = all_equilibria(network)
    folds = {round(one.value, 6) for start in low for one in continue_equilibrium(
        start, 'gamma=delta', 0.2, 0.6).crossings if one.kind == 'fold'}
    assert any(0.407 < value < 0.4072 for value in folds)


@pytest.mark.parametrize('network', [INHIBITED, Unlike(-0.9, 0.0, 0.6)])
def test_the_number_of_unstable_roots_changes_at_the_crossings_only(network):
    copies: Callable = {'Hopf': 2, 'fold': 1, 'pitchfork': 1, 'branch point': 1}.get
    for start in all_equilibria(network)[:4]:
        branch = continue_equilibrium(start, 'i', -0.6, 0.6)
        for value, one in branch.points:
            moved = replace(network, i=value)
            assert np.abs(moved.rates(one.state)).max() < 1e-9
        counts = [int((dense(replace(network, i=value), one.state).real > 1e-9).sum())
                  for value, one in branch.points]
        changes = sum(abs(after - before) for before, after in pairwise(counts))
        crossed = sum(copies(one.kind) * one.block.copies for one in branch.crossings)
        assert changes <= crossed
        for one in branch.crossings:
            values = dense(one.equilibrium.network, one.equilibrium.state)
            assert min(abs(values - 1j * one.omega)) < 1e-5

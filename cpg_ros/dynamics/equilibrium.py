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

"""Equilibria that every symmetry of the network fixes, and all others.

The first are those of one cell of each orbit of cells (Buono & Golubitsky 2001, section 5.1);
where all cells are alike, of a cell that is its own input. Where its rates are linear in all
variables but one, x, they are ``f0(x) + F1(x) y``, couplings included, and equilibria are roots of
``det(f0, F1)`` in x, which has no poles.

Where cells differ at an equilibrium, the network freezes in a pose. Newton's method finds these in
the fixed-point space of each subgroup. A branch is followed by pseudo-arclength in the space of
its own symmetries, past folds; where a root of another class crosses 0, branches with less
symmetry begin.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cache, cached_property, lru_cache, partial
from itertools import pairwise

from cpg_ros.common.errors import CpgError, InputError, ShortRepr
from cpg_ros.dynamics.arclength import (
    continue_curve,
    correct_point,
    crossings,
    CurvePoint,
    fixed_unknown,
    locate,
    NoOrbit,
    predict_and_correct,
)
from cpg_ros.dynamics.isotypic import Block, blocks, everywhere, group_of
from cpg_ros.networks.equations import equations_of, Field, values_of
from cpg_ros.networks.network import Network, ParameterLine
from cpg_ros.networks.symmetry import Group, label, subgroups
import numpy as np

#: Grid of x on which equilibria are searched: dense where the cell's functions bend.
_TAIL = np.geomspace(3.0, 100.0, 400)[1:]
GRID = np.concatenate([-_TAIL[::-1], np.linspace(-3.0, 3.0, 2001), _TAIL])
#: Start states where there is no such x.
NUM_STARTS = 400
#: Relative change of the state in a step of the couplings; error of its prediction.
MAX_CHANGE, PREDICTION_TOLERANCE = 0.1, 0.01
#: Size at which an equilibrium has gone to infinity.
MAX_STATE = 1e3
#: Step of the coupling fraction; a shorter one means a fold.
MIN_COUPLING_STEP = 1e-5


class NoEquilibrium(CpgError):
    """The equilibrium cannot be continued from the uncoupled cells to these couplings."""


class Quotient(Field[Network]):
    """A network with one cell of each class, now and a delay ago."""

    def __init__(self, network: Network, classes: np.ndarray | None = None) -> None:
        """Prepare for a network, with all of its couplings.

        Args:
            network: parameters.
            classes: of equal cells, shape (cells,); by default the orbits of the network's group.

        """
        super().__init__(network, group_of(network).orbits if classes is None else classes)
        self._whole = self._p
        equations = self._equations
        self._coupled = [equations.by_cell.get(row, (row,))[0] in network.couplings
                         for row in equations.rows]

    def take(self, cell: int) -> None:
        """Take the parameters of a cell, from 0, for all."""
        self._whole = self._p = [value[[cell]] if value.ndim else value
                                 for value in values_of(self.network)]

    def set_coupling(self, fraction: float) -> None:
        """Multiply all couplings by a fraction."""
        self._p = [fraction * value if coupled else value
                   for value, coupled in zip(self._whole, self._coupled, strict=True)]

    def together(self, states: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return rates, (..., variables), and their Jacobian, if all cells move together."""
        rates, now, past = self.linearised(states)
        return rates, now + past if past.size else now

    def push(self, state: np.ndarray) -> np.ndarray:
        """Return the derivative of the rates by the coupling fraction, shape (variables,)."""
        out = np.zeros(state.size)
        slopes = self._equations.by_parameter(self._arguments(state, None), self._p)
        for (v, r), slope in slopes.items():
            if self._coupled[r]:
                out[v * self.size:(v + 1) * self.size] += slope * self._whole[r]
        return out

    def newton(self, state: np.ndarray, most: int = 8) -> np.ndarray | None:
        """Solve for an equilibrium near a state by Newton's method; None if it fails."""
        return next(iter(self.newton_from_all(state[None], most)), None)

    def newton_from_all(self, states: np.ndarray, most: int = 50) -> np.ndarray:
        """Return the equilibria that Newton's method reaches from states, shape (n, variables)."""
        arrived = [states[:0]]
        sizes = np.full(len(states), np.inf)
        with np.errstate(all='ignore'):
            for _ in range(most):
                rates, slopes = self.together(states)
                sound = np.linalg.det(slopes) != 0.0
                moves = np.linalg.solve(slopes[sound], rates[sound, :, None])[..., 0]
                states = states[sound] - moves
                sizes = np.abs(moves).max(axis=1) / (1.0 + np.abs(states).max(axis=1))
                arrived.append(states[sizes < 1e-14])
                under_way = (sizes >= 1e-14) & (sizes < 1e3)
                states, sizes = states[under_way], sizes[under_way]
                if not len(states):
                    break
        return np.concatenate([*arrived, states[sizes < 1e-11]])


def odd(network: Network) -> bool:
    """Return whether the network has the symmetry x -> -x."""
    return network.symmetry(network.gaits()[0]).odd


def named(network: Network, cell: np.ndarray) -> dict[str, float]:
    """Name the variables of a cell of each orbit: variable, and cell if several -> value."""
    orbits = np.unique(group_of(network).orbits, return_index=True)[1]
    names = [name if cell.size == network.variables else f'{name}{first + 1}'
             for name in network.states for first in orbits[:cell.size // network.variables]]
    return dict(zip(names, map(float, cell), strict=True))


def equilibria(network: Network) -> np.ndarray:
    """Find the equilibria that all symmetries fix, by ascending first variable.

    These are all with x from -100 to 100 where all cells are alike and the rates are linear in all
    variables but an x; otherwise those that Newton's method reaches from many states.

    Returns:
        States of a cell of each orbit, shape (n, variables orbits).

    Raises:
        InputError: a parameter is not finite.

    """
    _check(network)
    return _found(Quotient(network))


def _found(cell: Quotient) -> np.ndarray:
    scanned = _scanned(type(cell.network)) if cell.size == 1 else None
    if scanned is None:
        reached = cell.newton_from_all(_scattered(cell.kept.size))
    else:
        solved = [cell.newton(start) for start in _roots(cell, scanned)]
        reached = np.array([state for state in solved if state is not None])
    states: list[np.ndarray] = []
    while len(reached):
        states.append(reached[0])
        reached = reached[~np.isclose(reached, reached[0], 1e-9, 1e-9).all(axis=1)]
    return np.array(sorted(states, key=tuple)).reshape(-1, cell.kept.size)


@cache
def _scanned(network: type[Network]) -> int | None:
    """Return the index of a variable x such that the rates are linear in all others, or None."""
    equations = equations_of(network)
    with np.errstate(all='ignore'):
        # Only the pattern of the derivatives matters.
        second = equations.higher(2, [np.array(0.0)] * len(equations.arguments),
                                  [np.array(1.0)] * len(equations.rows))
    pairs = [{equations.arguments[k].variable for k in indices} for _, *indices in second]
    return next((x for x in range(network.variables) if all(x in pair for pair in pairs)), None)


def _roots(cell: Quotient, scanned: int) -> Iterator[np.ndarray]:
    """Return the states close to those at which ``f0 + F1 y`` vanishes for a y."""
    n = cell.kept.size
    others = [k for k in range(n) if k != scanned]

    def terms(x: np.ndarray) -> np.ndarray:
        """f0 and F1, side by side, shape (..., n, n)."""
        states = np.zeros((n, *np.shape(x), n))
        states[..., scanned] = x
        for k, other in enumerate(others):
            states[k + 1, ..., other] = 1.0
        rates = cell.rates(states)
        rates[1:] -= rates[0]
        return np.moveaxis(rates, 0, -1)

    def balance(x: np.ndarray) -> np.ndarray:
        return np.linalg.det(terms(x))

    for x in crossings(lambda x: float(balance(np.array(x))), GRID, balance(GRID)):
        matrix = terms(np.array(x))
        state = np.full(n, x)
        if others:
            state[others] = np.linalg.lstsq(matrix[:, 1:], -matrix[:, 0], rcond=None)[0]
        yield state


def _scattered(n: int, count: int = NUM_STARTS) -> np.ndarray:
    rng = np.random.default_rng(0)
    return rng.uniform(-1.0, 1.0, (count, n)) * rng.choice([1.0, 3.0, 30.0], (count, 1))


def equilibrium(network: Network) -> np.ndarray:
    """Find the equilibrium that continues that of the uncoupled cells, (variables orbits,).

    All couplings grow from 0 to their values (Buono & Golubitsky 2001, proposition 5.1). Diffusive
    coupling does not move it; with the symmetry x -> -x it is 0.

    Raises:
        NoEquilibrium: it ends in a fold, or the uncoupled cell has several equilibria, or none.
        InputError: a parameter is not finite.

    """
    if odd(network):
        return np.zeros(network.variables)
    _check(network)
    if not network.rests:
        raise NoEquilibrium('an uncoupled cell oscillates from any state: there is no equilibrium')
    rest = network.at_rest()
    if rest is not None:
        return rest
    cell = Quotient(network)
    cell.set_coupling(0.0)
    state = _uncoupled(replace(  # type: ignore[type-var]
        network, **dict.fromkeys(network.couplings, 0.0)), tuple(cell.kept[:cell.size]))
    fraction, step, grow = 0.0, 0.25, 2.0
    slope = cell.together(state)[1]
    while fraction < 1.0:
        step = min(step, 1.0 - fraction)
        change = -step * np.linalg.solve(slope, cell.push(state))
        size, new = 1.0 + np.abs(state).max(), None
        cell.set_coupling(fraction + step)
        if np.abs(change).max() <= MAX_CHANGE * size:
            new = cell.newton(state + change)
        ahead = slope if new is None else cell.together(new)[1]
        # Beyond a fold the determinant has the other sign.
        if (new is not None and np.abs(new - state - change).max() <= PREDICTION_TOLERANCE * size
                and np.linalg.det(ahead) * np.linalg.det(slope) > 0.0):
            state, slope = new, ahead
            fraction, step, grow = fraction + step, grow * step, 2.0
        else:
            cell.set_coupling(fraction)
            step, grow = 0.5 * step, 1.0
        if step < MIN_COUPLING_STEP < 1.0 - fraction or size > MAX_STATE:
            how = 'in a fold' if size <= MAX_STATE else 'to infinity'
            listed = ', '.join(f'{name} {value:.4f}' for name, value
                               in named(network, state).items())
            raise NoEquilibrium(f'the equilibrium is lost {how} at {fraction:.4f} of the '
                                f'couplings, {listed}')
    return state


@lru_cache(maxsize=64)
def _uncoupled(alone: Network, cells: tuple[int, ...]) -> np.ndarray:
    """Return the states of some uncoupled cells, (variables cells,)."""
    rest = []
    for first in cells:
        cell = Quotient(alone, np.zeros(alone.cells, dtype=int))
        cell.take(first)
        states = _found(cell)
        if len(states) != 1:
            raise NoEquilibrium(f'an uncoupled cell has {len(states)} equilibria: none is '
                                'continued')
        rest.append(states[0])
    return np.array(rest).T.ravel()


def _check(network: Network) -> None:
    for name, value in network.as_dict().items():
        if not np.isfinite(value):
            raise InputError(f'{name} is {value}')


# All equilibria, and their branches.

#: Starts of Newton's method in each fixed-point space.
NUM_SUBSPACE_STARTS = 100
#: Relative difference of equal states, and of those next to a pitchfork; root over the largest
#: that is 0.
STATE_TOLERANCE, PITCHFORK_TOLERANCE, ROOT_TOLERANCE = 1e-6, 1e-3, 1e-7
#: Rate of the value along a branch, and part of a root over the largest, that is not 0.
NONZERO_THRESHOLD = 1e-4
#: Points of a branch in either direction; step over the range of the parameter.
MAX_POINTS, MAX_STEP = 200, 0.05


@dataclass(frozen=True, eq=False, repr=False)
class Equilibrium(ShortRepr):
    """A state at which a network rests.

    Attributes:
        network: parameters.
        state: of all cells, shape (components,).
        group: of the symmetries that fix the state.

    """

    network: Network
    state: np.ndarray
    group: Group

    def _summary(self) -> str:
        return f'{self.network.name}, fixed by {self.label}, {self.unstable} unstable roots'

    @property
    def label(self) -> str:
        """Name of the group, by generators."""
        return label(self.group, tuple(self.group.elements))

    @cached_property
    def blocks(self) -> tuple[Block, ...]:
        """The linearisation, by class of the symmetries that fix the state."""
        return blocks(self.network, self.state, self.group)

    @property
    def unstable(self) -> int:
        """Number of roots with positive real part."""
        return sum(len(block.right_of(0.0)) * block.copies for block in self.blocks)

    @property
    def leading(self) -> complex:
        """Rightmost root, 1/model time; one of a conjugate pair."""
        return max((block.leading for block in self.blocks), key=lambda root: root.real)

    @property
    def attracts(self) -> bool | None:
        """Whether small disturbances decay; None: cannot tell, as a root is 0 up to rounding."""
        scale = max(np.abs(block.now).max() for block in self.blocks)
        root = self.leading.real
        return None if abs(root) <= ROOT_TOLERANCE * scale else root < 0.0


def _images(network: Network, state: np.ndarray) -> Iterator[tuple[str, np.ndarray]]:
    """Yield the images of a state by the network's symmetries, with x -> -x if it has it."""
    mirrored = odd(network)
    for name, element in group_of(network).elements.items():
        image = np.empty_like(state).reshape(network.variables, -1)
        image[:, list(element)] = state.reshape(network.variables, -1)
        yield name, image.ravel()
        if mirrored:
            yield '', -image.ravel()


def _equal(one: np.ndarray, other: np.ndarray, same: float = STATE_TOLERANCE) -> bool:
    return bool(np.abs(one - other).max() <= same * (1.0 + np.abs(one).max()))


def at_state(network: Network, state: np.ndarray) -> Equilibrium:
    """Return the equilibrium at a state of all cells, with the symmetries that fix it."""
    symmetries = [name for name, image in _images(network, state) if name and _equal(image, state)]
    return Equilibrium(network, state, group_of(network).subgroup(tuple(symmetries)))


def all_equilibria(network: Network) -> list[Equilibrium]:
    """Find the equilibria of a network, one of each set that its symmetries map to one another.

    Those that all symmetries fix come from ``equilibria``, the others from Newton's method at many
    states: some may be missed. The most symmetric ones come first.

    Args:
        network: parameters.

    Raises:
        InputError: a parameter is not finite.

    """
    if not network.rests:
        return []
    group, results = group_of(network), list[Equilibrium]()
    synchronous = everywhere(network, equilibria(network))
    middle = synchronous[0] if len(synchronous) else np.zeros(network.components)
    for names in reversed(subgroups(group)):
        cell = Quotient(network, group.subgroup(names).orbits)
        starts = _scattered(cell.kept.size, NUM_SUBSPACE_STARTS)
        starts = np.concatenate([starts, middle[cell.kept] + starts
                                 * (1.0 + np.abs(middle[cell.kept])) / 3.0])
        reached = [*synchronous] if names == tuple(group.elements) else [
            *cell.newton_from_all(starts)[:, cell.columns]]
        for state in reached:
            if np.isfinite(state).all() and not any(
                    _equal(other.state, image) for other in results
                    for _, image in _images(network, state)):
                results.append(at_state(network, state))
    return results


@dataclass(frozen=True, eq=False, repr=False)
class EquilibriumCurve(ShortRepr):
    """Equilibria along a line: unknowns are a state of the quotient, 1 for a period, the value.

    Attributes:
        network: any on the line.
        group: of the symmetries that fix the states.
        along: the line.
        scale: of the value.
        size: of the states.

    """

    network: Network
    group: Group
    along: ParameterLine
    scale: float
    size: float

    def _quotient(self, z: np.ndarray) -> Quotient:
        return Quotient(self.along.at(self.network, float(z[-1])), self.group.orbits)

    def _weights(self, size: int) -> np.ndarray:
        weights = np.full(size, self.size**-2.0 / (size - 2))
        weights[-2:] = 1.0, self.scale**-2.0
        return weights

    def product(self, first: np.ndarray, second: np.ndarray) -> float:
        """Mean over the components plus value."""
        return float(self._weights(first.size) * first @ second)

    def step(self, z: np.ndarray, border: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Newton's increment normal to the border, and the tangent."""
        cell, n = self._quotient(z), z.size - 2
        rates, slopes = cell.together(z[:n])
        matrix, right = np.zeros((n + 2, n + 2)), np.zeros((n + 2, 2))
        matrix[:n, :n] = slopes
        matrix[:n, -1] = cell.by_parameter(z[:n]) @ self.along.direction(self.network)
        matrix[n, n] = 1.0
        matrix[-1] = self._weights(z.size) * border
        right[:n, 0], right[-1, 1] = -rates, 1.0
        increment, tangent = np.linalg.solve(matrix, right).T
        return increment, tangent

    def amplitude(self, z: np.ndarray) -> float:
        """Return 1: equilibria have no birth."""
        return 1.0

    def renewed(self, z: np.ndarray, border: np.ndarray, again: bool) -> None:
        """Return None: a state needs no finer discretisation."""

    def orbit(self, z: np.ndarray) -> Equilibrium:
        """Return the equilibrium of a solution."""
        cell = self._quotient(z)
        return Equilibrium(cell.network, z[:-2][cell.columns], self.group)


@dataclass(frozen=True, eq=False, repr=False)
class Crossing(ShortRepr):
    """A point of a branch at which roots cross the imaginary axis.

    Attributes:
        kind: 'fold', 'pitchfork', 'branch point' or 'Hopf'.
        value: of the parameters.
        equilibrium: there.
        block: of the critical class.
        omega: of the critical roots, 0 unless they are a pair.

    """

    kind: str
    value: float
    equilibrium: Equilibrium
    block: Block
    omega: float

    def _summary(self) -> str:
        return f'{self.kind} at {self.value:.7g}'


@dataclass(frozen=True, eq=False, repr=False)
class EquilibriumBranch(ShortRepr):
    """Equilibria along a line of parameters.

    Attributes:
        along: the line.
        points: values and equilibria, in order along the branch.
        crossings: where their number of unstable roots changes, in the same order.

    """

    along: ParameterLine
    points: tuple[tuple[float, Equilibrium], ...]
    crossings: tuple[Crossing, ...]

    def _summary(self) -> str:
        return f'{len(self.points)} equilibria, ' + ', '.join(map(str, self.crossings))


def continue_equilibrium(start: Equilibrium, line: ParameterLine | str, low: float, high: float
                         ) -> EquilibriumBranch:
    """Follow an equilibrium along a line of parameters, both ways and past folds.

    Args:
        start: on the line, with a value from low to high.
        line: line of parameters, or its text.
        low: least value.
        high: greatest value.

    Raises:
        NoOrbit: the start is no equilibrium, or not isolated.

    """
    line = ParameterLine.of(line, type(start.network))
    symmetries = {*start.group.names}.intersection(
        *(group_of(line.at(start.network, value)).names for value in (low, high)))
    group = start.group.subgroup(tuple(name for name, element in start.group.elements.items()
                                       if element in symmetries))
    size = float(np.abs(start.state).max()) or 1.0
    curve = EquilibriumCurve(start.network, group, line, high - low, size)
    cell = Quotient(start.network, group.orbits)
    z = np.concatenate([start.state[cell.kept], [1.0, line.value(start.network)]])
    first = correct_point(curve, z, fixed_unknown(z.size, -1))
    if first is None:
        raise NoOrbit('the equilibrium is not isolated')
    halves = []
    for begin in (first.reversed(), first):
        points = [begin]

        def visit(point: CurvePoint, points: list[CurvePoint] = points) -> str:
            points.append(point)
            return ''

        folds, _ = continue_curve(begin, low, high, visit, longest_step=MAX_STEP, most=MAX_POINTS)
        crossings: list[Crossing] = []
        ends = [(point, point.curve.orbit(point.z)) for point in points]
        for k, (last, now) in enumerate(pairwise(ends)):
            crossings += _crossings(last, now)
            crossings += [_fold(now[0], begin)] if k in folds else []
        halves.append(([(point.value, one) for point, one in ends], crossings))
    (back, before), (ahead, after) = halves
    return EquilibriumBranch(
        line, tuple(back[:0:-1] + ahead), tuple(before[::-1] + after))


def _crossings(*ends: tuple[CurvePoint, Equilibrium]) -> list[Crossing]:
    """Return the crossings between two neighbouring points of a branch, without folds."""
    crossings: list[Crossing] = []
    (last, _), (point, _) = ends
    reach = last.curve.product(last.tangent, point.z - last.z)
    for which, pair in enumerate(zip(*(one.blocks for _, one in ends), strict=True)):
        for rank in range(*sorted(len(block.right_of(0.0)) for block in pair)):
            def root(there: CurvePoint, at: tuple[int, int] = (which, rank)) -> float:
                return float(there.curve.orbit(there.z).blocks[at[0]].roots(at[1] + 1)[-1].real)

            try:
                there = locate(root, partial(predict_and_correct, last), 0.0, reach, 1e-12 * reach)
            except (NoOrbit, ValueError):
                # Beside a fold rounding decides on the sign.
                continue
            crossings += _crossing(there, which, rank)
    return crossings


def _crossing(point: CurvePoint, which: int, rank: int) -> Iterator[Crossing]:
    equilibrium: Equilibrium = point.curve.orbit(point.z)
    block = equilibrium.blocks[which]
    root, values = complex(block.roots(rank + 1)[-1]), block.representation.values
    along = point.rate * fixed_unknown(point.z.size, -1)
    if abs(root.imag) > NONZERO_THRESHOLD * np.abs(block.now).max():
        if root.imag > 0.0:
            yield Crossing('Hopf', point.value, equilibrium, block, root.imag)
    elif point.curve.product(along, along) > NONZERO_THRESHOLD**2:
        mirrored = block.copies == 1 and (values.real.min() < 0.0 or (
            block.symmetry.odd and np.abs(equilibrium.state).max() <= STATE_TOLERANCE))
        yield Crossing('pitchfork' if mirrored else 'branch point', point.value, equilibrium,
                       block, 0.0)


def _fold(point: CurvePoint, begin: CurvePoint) -> Crossing:
    """Return what happens where a branch turns round: at a pitchfork it begins."""
    images = [[_equal(image, one.state, PITCHFORK_TOLERANCE)
               for _, image in _images(one.network, one.state)]
              for one in (point.curve.orbit(point.z), begin.curve.orbit(begin.z))]
    equilibrium = point.curve.orbit(point.z)
    return Crossing('pitchfork' if sum(images[0]) > sum(images[1]) else 'fold', point.value,
                    equilibrium, equilibrium.blocks[0], 0.0)

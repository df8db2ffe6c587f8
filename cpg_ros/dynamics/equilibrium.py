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

"""Equilibria at which all cells are equal.

Every symmetry of the network fixes them (Buono & Golubitsky 2001, section 5.1), so they are the
equilibria of a cell that is its own input. Where its rates are linear in all variables but one, x,
they are ``f0(x) + F1(x) y``, couplings included, and equilibria are roots of ``det(f0, F1)`` in x,
which has no poles.
"""

from collections.abc import Iterator
from dataclasses import replace
from functools import cache, lru_cache

from cpg_ros.common.errors import CpgError, InputError
from cpg_ros.dynamics.arclength import crossings
from cpg_ros.networks.equations import equations_of, Field
from cpg_ros.networks.network import Network
import numpy as np

#: Grid of x on which equilibria are searched: dense where the cell's functions bend.
_FAR = np.geomspace(3.0, 100.0, 400)[1:]
GRID = np.concatenate([-_FAR[::-1], np.linspace(-3.0, 3.0, 2001), _FAR])
#: Start states where there is no such x.
STARTS = 400
#: LONGEST: largest relative change of the state in a step; MISS: largest error of its prediction.
LONGEST, MISS = 0.1, 0.01
#: Size at which an equilibrium has gone to infinity.
FURTHEST = 1e3
#: Shortest step of the coupling fraction; a shorter one means a fold.
SHORTEST = 1e-5


class NoEquilibrium(CpgError):
    """The equilibrium cannot be continued from the uncoupled cells to these couplings."""


class Quotient(Field[Network]):
    """A network with all cells equal: a cell that is its own input, now and a delay ago.

    If cells differ in a parameter, the first cell's value counts.
    """

    def __init__(self, network: Network) -> None:
        """Prepare for a network, with all of its couplings."""
        super().__init__(network, np.zeros(network.cells, dtype=int))
        self._whole = self._p = [value.flat[0] for value in self._p]
        equations = self._equations
        self._coupled = [equations.by_cell.get(row, (row,))[0] in network.couplings
                         for row in equations.rows]

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
                out[v] += (slope * self._whole[r]).item()
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


def everywhere(network: Network, cell: np.ndarray) -> np.ndarray:
    """Return the network's state with all cells in one state, shape (..., components)."""
    return np.repeat(cell, network.cells, axis=-1)


def odd(network: Network) -> bool:
    """Return whether the network has the symmetry x -> -x."""
    return network.symmetry(network.gaits()[0]).odd


def named(network: Network, cell: np.ndarray) -> dict[str, float]:
    """Name the variables of a cell: variable -> value."""
    names = network.states
    return dict(zip(names, map(float, cell), strict=True))


def equilibria(network: Network) -> np.ndarray:
    """Find equilibria with equal cells, states of a cell by ascending first variable.

    These are all with x from -100 to 100 where the rates are linear in all variables but an x;
    otherwise those that Newton's method reaches from many states.

    Returns:
        States, shape (n, variables).

    Raises:
        InputError: a parameter is not finite.

    """
    _check(network)
    cell, scanned = Quotient(network), _scanned(type(network))
    if scanned is None:
        reached = cell.newton_from_all(_scattered(network.variables))
    else:
        solved = [cell.newton(start) for start in _roots(cell, scanned)]
        reached = np.array([state for state in solved if state is not None]
                           ).reshape(-1, network.variables)
    states: list[np.ndarray] = []
    while len(reached):
        states.append(reached[0])
        reached = reached[~np.isclose(reached, reached[0], 1e-9, 1e-9).all(axis=1)]
    return np.array(sorted(states, key=tuple)).reshape(-1, network.variables)


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


def _scattered(n: int) -> np.ndarray:
    rng = np.random.default_rng(0)
    return rng.uniform(-1.0, 1.0, (STARTS, n)) * rng.choice([1.0, 3.0, 30.0], (STARTS, 1))


def equilibrium(network: Network) -> np.ndarray:
    """Find the equilibrium that continues that of the uncoupled cells, shape (variables,).

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
        network, **dict.fromkeys(network.couplings, 0.0)))
    fraction, step, grow = 0.0, 0.25, 2.0
    slope = cell.together(state)[1]
    while fraction < 1.0:
        step = min(step, 1.0 - fraction)
        change = -step * np.linalg.solve(slope, cell.push(state))
        size, new = 1.0 + np.abs(state).max(), None
        cell.set_coupling(fraction + step)
        if np.abs(change).max() <= LONGEST * size:
            new = cell.newton(state + change)
        ahead = slope if new is None else cell.together(new)[1]
        # Beyond a fold the determinant has the other sign.
        if (new is not None and np.abs(new - state - change).max() <= MISS * size
                and np.linalg.det(ahead) * np.linalg.det(slope) > 0.0):
            state, slope = new, ahead
            fraction, step, grow = fraction + step, grow * step, 2.0
        else:
            cell.set_coupling(fraction)
            step, grow = 0.5 * step, 1.0
        if step < SHORTEST < 1.0 - fraction or size > FURTHEST:
            how = 'in a fold' if size <= FURTHEST else 'to infinity'
            listed = ', '.join(f'{name} {value:.4f}' for name, value
                               in named(network, state).items())
            raise NoEquilibrium(f'the stand is lost {how} at {fraction:.4f} of the couplings, '
                                f'{listed}')
    return state


@lru_cache(maxsize=64)
def _uncoupled(alone: Network) -> np.ndarray:
    states = equilibria(alone)
    if len(states) != 1:
        raise NoEquilibrium(f'an uncoupled cell has {len(states)} equilibria: none is the stand')
    return states[0]


def _check(network: Network) -> None:
    for name, value in network.as_dict().items():
        if not np.isfinite(value):
            raise InputError(f'{name} is {value}')

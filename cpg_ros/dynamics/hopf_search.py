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

"""All Hopf points of a network's equilibrium along a line of parameters.

Where the delay alone moves they are known in closed form. Elsewhere the real parts of each class's
rightmost roots are looked at on a grid, and where they change their sign is refined.
"""

from collections.abc import Callable
from functools import cache
from itertools import pairwise

from cpg_ros.dynamics.delay_crossings import delay_crossings
from cpg_ros.dynamics.equilibrium import equilibrium, NoEquilibrium
from cpg_ros.dynamics.hopf_point import crossing_at, HopfPoint, ON_AXIS
from cpg_ros.dynamics.isotypic import Block, block_at, blocks, classes
from cpg_ros.dynamics.sign_changes import crossings
from cpg_ros.errors import InputError
from cpg_ros.networks.equations import equations_of
from cpg_ros.networks.network import Network
from cpg_ros.networks.parameter_line import ParameterLine
import numpy as np

#: Values of the parameters at which the equilibrium is looked at before crossings are refined.
GRID = 241
#: With a delay, how many roots of a class are followed beside those that are to the right of the
#: axis somewhere on the grid.
SPARE = 2


def hopf_points(network: Network, line: ParameterLine | str, low: float, high: float
                ) -> list[HopfPoint]:
    """Find all Hopf points of the equilibrium between two values of parameters, by rising value.

    Values at which the network has no equilibrium are passed over. Where not the delay alone
    moves, points closer to one another than (high - low)/240 are distinguished only where a pair
    crosses twice in the same class.

    Args:
        network: the other parameters.
        line: the parameters that move, or their text: 'tau', 'alpha=-beta', or a group.
        low: least value, in the parameter's unit.
        high: greatest value, in the parameter's unit.

    Raises:
        NoEquilibrium: it exists nowhere on the way.
        InputError: low is not below high, no such parameter, one is not finite, the delay would be
            negative, or the weights have not the symmetry of the network.

    """
    if not (np.isfinite(low) and np.isfinite(high) and low < high):
        raise InputError(f'low {low} must be less than high {high}')
    line = ParameterLine.of(line, type(network))
    if not network.rests:
        equilibrium(network)
    delay = network.delay_parameter
    if min(line.at(network, value).delay for value in (low, high)) < 0.0:
        raise InputError(f'{line} from {low:g} to {high:g} makes {delay} negative')
    if line.names == (delay,) and delay not in equations_of(type(network)).rows:
        return _by_delay(network, line, low, high)
    return _on_grid(network, line, low, high)


def hopf_at(network: Network, line: ParameterLine, mode: tuple[int, ...], omega: float
            ) -> HopfPoint:
    """Return a Hopf point whose place is known.

    Args:
        network: at the point.
        line: the parameters by which the pair crosses.
        mode: the critical class.
        omega: about that of the critical root i omega, to tell it from others of its block.

    """
    rest = equilibrium(network)
    block = block_at(network, rest, mode)
    # Its real part is zero but for rounding, unless the caller was wrong by more.
    roots = block.right_of(-1e-3)
    root = roots[np.abs(roots - 1j * omega).argmin()]
    return HopfPoint(network, line, line.value(network), block, float(root.imag), rest)


def _by_delay(network: Network, line: ParameterLine, low: float, high: float) -> list[HopfPoint]:
    rest, found = equilibrium(network), []
    for block in blocks(network, rest):
        for omega, tau in delay_crossings(block.now, block.past):
            turn = 2.0 * np.pi / omega
            found += [crossing_at(block, line, rest, omega, tau, n) for n in range(
                max(0, int(np.ceil((low - tau) / turn))), int(np.floor((high - tau) / turn)) + 1)]
    return sorted(found, key=lambda point: point.value)


def _on_grid(network: Network, line: ParameterLine, low: float, high: float) -> list[HopfPoint]:
    @cache
    def split(value: float) -> tuple[Block, ...]:
        """Return the blocks; none where there is no equilibrium."""
        there = line.at(network, value)
        try:
            return blocks(there, equilibrium(there))
        except NoEquilibrium:
            return ()

    @cache
    def roots(value: float, which: int, count: int) -> np.ndarray:
        if not split(value):
            return np.full(count, np.nan, dtype=complex)
        return split(value)[which].roots(count)

    grid = _with_edges([float(value) for value in np.linspace(low, high, GRID)],
                       lambda value: bool(split(value)))
    if not any(split(value) for value in grid):
        equilibrium(line.at(network, low))
    found: list[HopfPoint] = []
    for which in range(len(classes(network))):
        count = _followed([split(value)[which] for value in grid if split(value)])
        known: list[tuple[float, float]] = []
        for rank in range(count):
            def real_part(value: float, at: tuple[int, int, int] = (which, count, rank)) -> float:
                return float(roots(value, *at[:2])[at[2]].real)

            for value in crossings(real_part, np.array(grid)):
                # Two roots of a block may cross together; each is met twice then.
                for root in roots(value, which, count):
                    omega = float(root.imag)
                    if (abs(root.real) <= ON_AXIS < omega
                            and not any(np.allclose((value, omega), one) for one in known)):
                        known.append((value, omega))
                        found.append(hopf_at(line.at(network, value), line,
                                             split(value)[which].mode, omega))
    # Points that symmetry puts in one place differ by rounding.
    return sorted(found, key=lambda point: (round(point.value, 9), point.omega, point.mode))


def _followed(along: list[Block]) -> int:
    """How many roots of a class can cross on the grid: without a delay, all."""
    if not any(one.past.any() for one in along):
        return along[0].network.variables
    return SPARE + max(len(one.right_of(0.0)) for one in along)


def _with_edges(grid: list[float], exists: Callable[[float], bool]) -> list[float]:
    """Add the last places before and the first ones after those where nothing exists."""
    whole = grid[:1]
    for left, right in pairwise(grid):
        if exists(left) != exists(right):
            inside, outside = (left, right) if exists(left) else (right, left)
            for _ in range(20):
                middle = 0.5 * (inside + outside)
                inside, outside = (middle, outside) if exists(middle) else (inside, middle)
            if left < inside < right:
                whole.append(inside)
        whole.append(right)
    return whole

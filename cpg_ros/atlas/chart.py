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

"""The plane of an atlas: two lines of parameters, their ranges, and the grid on them."""

from dataclasses import dataclass
from typing import Any

from cpg_ros.errors import InputError
from cpg_ros.networks.network import Network
from cpg_ros.networks.parameter_line import ParameterLine
from cpg_ros.networks.registry import find_network, reference
import numpy as np

#: Points of the coarse grid are this many apart, a power of 2.
COARSE = 8


@dataclass(frozen=True)
class Axis:
    """A line of parameters and the values on it: ``tau=0.2:2``."""

    line: ParameterLine
    low: float
    high: float
    count: int

    @property
    def values(self) -> np.ndarray:
        """Evenly from low to high, shape (count,)."""
        return np.linspace(self.low, self.high, self.count)


@dataclass(frozen=True)
class Chart:
    """A plane of networks.

    Attributes:
        network: name or file, as find_network takes it.
        base: all parameters, of which those on the axes do not matter.
        first: the axis whose values make rows.
        second: the axis along which orbits are continued in a row.

    """

    network: str
    base: dict[str, float]
    first: Axis
    second: Axis

    @property
    def low(self) -> np.ndarray:
        """Lower ends of both axes, shape (2,)."""
        return np.array([self.first.low, self.second.low])

    @property
    def size(self) -> np.ndarray:
        """Lengths of both axes, shape (2,)."""
        return np.array([self.first.high, self.second.high]) - self.low

    def at(self, one: float, other: float) -> Network:
        """Return the network with a value on each axis."""
        whole = find_network(self.network)(**self.base)
        return self.second.line.at(self.first.line.at(whole, one), other)

    def at_share(self, share: np.ndarray) -> Network:
        """Return the network at a point given in shares of the ranges, shape (2,)."""
        return self.at(*self.values_at(share))

    def values_at(self, share: np.ndarray) -> tuple[float, float]:
        """Return the values on both axes at a point given in shares of the ranges, shape (2,)."""
        one, other = (self.low + share * self.size).tolist()
        return one, other

    def share(self, point: tuple[int, int]) -> np.ndarray:
        """Return a point of the grid, given by row and column, in shares of the ranges."""
        return np.array(point) / (self.first.count - 1, self.second.count - 1)

    def as_dict(self) -> dict[str, Any]:
        """Return everything in plain types."""
        return {'network': self.network, 'base': self.base,
                'axes': [{'line': str(axis.line), 'low': axis.low, 'high': axis.high,
                          'count': axis.count} for axis in (self.first, self.second)]}


def chart_of(network: str, base: Network, over: list[tuple[str, tuple[float, float]]],
             counts: tuple[int, int]) -> Chart:
    """Lay out the plane.

    Args:
        network: name or file.
        base: the other parameters.
        over: two lines with their ranges, as ``alpha=beta`` and (low, high).
        counts: points on each.

    Raises:
        InputError: a line, a range or a count that cannot be used.

    """
    axes = []
    for (text, (low, high)), count in zip(over, counts, strict=True):
        line = ParameterLine.parse(text, type(base))
        if not (np.isfinite(low) and np.isfinite(high) and low < high):
            raise InputError(f'{text}: {low:g} is not below {high:g}')
        for name, sign in zip(line.names, line.signs, strict=True):
            known = type(base).ranges[name]
            for value in (sign * low, sign * high):
                if not known.low <= value <= known.high:
                    raise InputError(f'{name}: {value:g} is not within {known.low:g} to '
                                     f'{known.high:g}')
        if not 2 <= count <= 2001:
            raise InputError(f'{text}: {count} points are not between 2 and 2001')
        axes.append(Axis(line, low, high, count))
    if set(axes[0].line.names) & set(axes[1].line.names):
        raise InputError(f'{axes[0].line} and {axes[1].line} move the same parameter')
    # Orbits are continued along the delay, where onsets are known in closed form.
    if base.delay_parameter in axes[0].line.names:
        axes.reverse()
    return Chart(reference(type(base).name), base.as_dict(), *axes)

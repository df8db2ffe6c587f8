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

from collections.abc import Iterator
from dataclasses import asdict, dataclass
from itertools import pairwise
import math
from typing import Any

from cpg_ros.common.command_line import finite
from cpg_ros.common.errors import InputError, ShortRepr
from cpg_ros.networks.network import Network, ParameterLine
from cpg_ros.networks.registry import find_network, reference
import numpy as np
from numpy.typing import ArrayLike

# Points on the boundaries of an atlas at which a second condition holds.

#: LABELS: kind of a codimension-two point -> MatCont's abbreviation.
LABELS = {'Bautin': 'GH', 'Hopf-Hopf': 'HH', 'zero-Hopf': 'ZH', 'Bogdanov-Takens': 'BT',
          '1:1 resonance': 'R1', '1:2 resonance': 'R2', '1:3 resonance': 'R3',
          '1:4 resonance': 'R4', 'cusp': 'CP'}


@dataclass(frozen=True, eq=False, repr=False)
class CodimensionTwo(ShortRepr):
    """A point of a boundary at which a second condition holds.

    Attributes:
        kind: one of LABELS.
        gait: of the curve; each gait on a common curve has its own coefficients.
        values: on both axes.
        test: value of the test function: the first Lyapunov coefficient at a Bautin point, the
            real part of the other root at a Hopf-Hopf or zero-Hopf point, otherwise the largest
            residual of the defining equations.
        omega: of the curve's critical root, rad per model time; nan on curves of orbits.
        other: gaits of the classes of the other roots, '' for a class without a gait.
        other_omega: of the other root; nan where there is none.

    """

    kind: str
    gait: str
    values: tuple[float, float]
    test: float
    omega: float = math.nan
    other: tuple[str, ...] = ()
    other_omega: float = math.nan

    def __str__(self) -> str:
        of = ' and '.join([self.gait, *filter(None, self.other)])
        return f'{self.kind} of {of} at {self.values[0]:.7g}, {self.values[1]:.7g}'

    def as_dict(self) -> dict[str, Any]:
        """Return everything in plain types; fields that do not apply are None."""
        fields: dict[str, Any] = finite(asdict(self))
        return {'type': fields.pop('kind'), **fields}

    @classmethod
    def of(cls, stored: dict[str, Any]) -> 'CodimensionTwo':
        """Make one from the result of as_dict."""
        fields: Any = [math.nan if value is None else tuple(value) if isinstance(value, list)
                       else value for value in stored.values()]
        return cls(*fields)


@dataclass(frozen=True)
class LossOnCurve:
    """The normal form's verdict at a point of a curve.

    Attributes:
        values: on both axes.
        soft: whether the motion that branches off attracts; None if the form does not decide.
        why: reason why it does not decide, or ''.

    """

    values: tuple[float, float]
    soft: bool | None
    why: str = ''


#: Stride of the coarse grid, a power of 2.
COARSE_STEP = 8


@dataclass(frozen=True)
class Axis:
    """A line of parameters and the values on it: ``tau=0.2:2``."""

    line: ParameterLine
    low: float
    high: float
    count: int

    @property
    def values(self) -> np.ndarray:
        """Evenly spaced from low to high, shape (count,)."""
        return np.linspace(self.low, self.high, self.count)

    def __contains__(self, value: float) -> bool:
        return self.low <= value <= self.high

    def indices(self, stride: int) -> list[int]:
        """Return the indices of a grid of a stride: of the coarse grid, halved."""
        indices = sorted({*range(0, self.count, COARSE_STEP), self.count - 1})
        halved = COARSE_STEP
        while halved > stride:
            indices = sorted({*indices, *((left + right) // 2
                                          for left, right in pairwise(indices))})
            halved //= 2
        return indices


@dataclass(frozen=True)
class ParameterPlane:
    """A plane of networks.

    Attributes:
        network: name or file, as find_network takes it.
        base: all parameters; those on the axes are ignored.
        first: axis along the rows of the grid.
        second: axis along which orbits are continued in a row.

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

    def at(self, first: float, second: float) -> Network:
        """Return the network with a value on each axis."""
        whole = find_network(self.network)(**self.base)
        return self.second.line.at(self.first.line.at(whole, first), second)

    def at_fractions(self, fraction: np.ndarray) -> Network:
        """Return the network at a point given in fractions of the ranges, shape (2,)."""
        return self.at(*self.values_at(fraction))

    def values_at(self, fraction: np.ndarray) -> tuple[float, float]:
        """Return the values on both axes at a point in fractions of the ranges, shape (2,)."""
        first, second = (self.low + fraction * self.size).tolist()
        return first, second

    def fractions_of(self, values: ArrayLike) -> np.ndarray:
        """Return points given by their values on both axes in fractions, shape (..., 2)."""
        return np.asarray((np.asarray(values)[..., :2] - self.low) / self.size)

    def fraction(self, point: tuple[int, int]) -> np.ndarray:
        """Return a point of the grid, given by row and column, in fractions of the ranges."""
        return np.array(point) / (self.first.count - 1, self.second.count - 1)

    def neighbours(self) -> Iterator[tuple[int, tuple[int, int], tuple[int, int]]]:
        """Yield the neighbours on the coarse grid: the axis between them, and both points."""
        rows, columns = self.first.indices(COARSE_STEP), self.second.indices(COARSE_STEP)
        for row, below in zip(rows, [*rows[1:], None], strict=True):
            for column, beside in zip(columns, [*columns[1:], None], strict=True):
                if beside is not None:
                    yield 1, (row, column), (row, beside)
                if below is not None:
                    yield 0, (row, column), (below, column)

    def as_dict(self) -> dict[str, Any]:
        """Return everything in plain types."""
        return {'network': self.network, 'base': self.base,
                'axes': [{'line': str(axis.line), 'low': axis.low, 'high': axis.high,
                          'count': axis.count} for axis in (self.first, self.second)]}


def chart_of(network: str, base: Network, over: list[tuple[str, tuple[float, float]]],
             counts: tuple[int, int]) -> ParameterPlane:
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
            bounds = type(base).ranges[name]
            for value in (sign * low, sign * high):
                if not bounds.low <= value <= bounds.high:
                    raise InputError(f'{name}: {value:g} is not within {bounds.low:g} to '
                                     f'{bounds.high:g}')
        if not 2 <= count <= 2001:
            raise InputError(f'{text}: {count} points are not between 2 and 2001')
        axes.append(Axis(line, low, high, count))
    if set(axes[0].line.names) & set(axes[1].line.names):
        raise InputError(f'{axes[0].line} and {axes[1].line} move the same parameter')
    # Orbits are continued along the delay, where Hopf points have a closed form.
    if base.delay_parameter in axes[0].line.names:
        axes.reverse()
    return ParameterPlane(reference(type(base).name), base.as_dict(), *axes)

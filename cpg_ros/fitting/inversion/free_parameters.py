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

"""Free numbers of a fit, the trust region, and its coordinates: delays over the critical one.

Near its onset, the shape of a gait is the same along the Hopf set, which is curved. With the delay
over its critical value as a coordinate, that valley of the cost is straight, and the onset is a
bound.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

from cpg_ros.common.errors import InputError, ShortRepr
from cpg_ros.dynamics.arclength import NoOrbit
from cpg_ros.dynamics.hopf import first_hopf, HopfPoint
from cpg_ros.networks.network import Network
import numpy as np
from scipy.optimize import least_squares

# Numbers of a network that a fit may move, and their bounds.

N = TypeVar('N', bound=Network)
#: DISTINCT_TOLERANCE: relative distance of two minima; MIN_SCALE: of a number near 0, in its unit,
#: for relative distances.
DISTINCT_TOLERANCE, MIN_SCALE = 0.03, 1e-3


def distinct(one: np.ndarray, other: np.ndarray) -> bool:
    """Return whether values of the free numbers, shape (numbers,), differ clearly."""
    return bool((np.abs(one - other) > DISTINCT_TOLERANCE * (np.abs(one) + MIN_SCALE)).any())


@dataclass(frozen=True)
class Free:
    """A free number of a network in a gait.

    Attributes:
        name: of a parameter, or of a group.
        members: parameters with its value, which the gait's symmetry requires to be equal; none if
            it does not belong to the network.
        low, high: bounds.

    """

    name: str
    members: tuple[str, ...]
    low: float
    high: float

    def value(self, network: Network) -> float:
        """Return its value in a network."""
        return float(getattr(network, self.members[0]))


def free_numbers(network: Network, gait: str, names: Sequence[str],
                 bounds: Mapping[str, tuple[float, float]] | None = None) -> tuple[Free, ...]:
    """Return the free numbers of a fit.

    Args:
        network: parameters.
        gait: one of its gaits.
        names: of parameters, or of groups of the network.
        bounds: name -> lower and upper bound, if narrower than the range.

    Raises:
        InputError: a name is unknown or repeated, or bounds cannot be used.

    """
    bounds = dict(bounds or {})
    families = network.families(network.symmetry(gait))
    valid = (*network.parameters(), *network.groups)
    free: list[Free] = []
    if not names or isinstance(names, str):
        raise InputError(f'no names of parameters to fit; there are {", ".join(valid)}')
    if len(set(names)) < len(names):
        raise InputError(f"names are '{', '.join(names)}'; they must be different ones")
    for name in names:
        if name not in valid:
            raise InputError(f"'{name}' is not one of the parameters of {network.name}: "
                             f'{", ".join(valid)}')
        members = network.groups.get(name, (name,))
        members = tuple(dict.fromkeys(
            member for family in families if set(family) & set(members) for member in family))
        others = [other.name for other in free if set(other.members) & set(members)]
        if others:
            raise InputError(f'{name} is the same as {others[0]}, which is free already')
        low = max(network.ranges[member].low for member in members)
        high = min(network.ranges[member].high for member in members)
        if name in bounds:
            least, most = bounds.pop(name)
            if not low <= least < most <= high:
                raise InputError(f'{name}: bounds {least:g} to {most:g} are not in order within '
                                 f'{low:g} to {high:g}')
            low, high = least, most
        free.append(Free(name, members, low, high))
    if bounds:
        raise InputError(f"'{next(iter(bounds))}' has bounds but is not free")
    return tuple(free)


def with_values(network: N, free: Sequence[Free], values: Sequence[float] | np.ndarray) -> N:
    """Return the network with values for its free numbers, in their order."""
    return replace(network, **{  # type: ignore[type-var]
        member: float(value) for parameter, value in zip(free, values, strict=True)
        for member in parameter.members})


#: Values -> residual (n,) and its derivative (n, values); NoOrbit where there is none.
Evaluate = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]


@dataclass(frozen=True, eq=False, repr=False)
class Minimisation(ShortRepr):
    """Result of the minimisation from one start.

    Attributes:
        start: initial values.
        values: final values.
        cost: half the sum of squares there; infinite if the start had no orbit.
        path: cost and values at the start and after every accepted step, shape (iterations + 1, 1
            + values).
        evaluations: number of orbits solved for.
        converged: whether a tolerance was met.
        reason: why the start has no orbit, or ''.

    """

    start: np.ndarray
    values: np.ndarray
    cost: float
    path: np.ndarray
    evaluations: int
    converged: bool
    reason: str = ''

    @classmethod
    def without_orbit(cls, start: np.ndarray, error: NoOrbit) -> 'Minimisation':
        """Return the result of a start that has no orbit."""
        return cls(start, start, float('inf'), np.empty((0, 1 + start.size)), 1, False, str(error))

    @property
    def iterations(self) -> int:
        """Number of accepted steps."""
        return max(0, len(self.path) - 1)


def minimise(evaluate: Evaluate, start: np.ndarray, low: np.ndarray, high: np.ndarray,
             tolerance: float, most: int = 100) -> Minimisation:
    """Minimise half the sum of squares within bounds, by scipy's 'trf' and exact derivatives.

    Args:
        evaluate: the problem; called twice in a row with the same values.
        start: values, shape (n,).
        low: lower bounds, shape (n,).
        high: upper bounds.
        tolerance: relative change of values, and of the cost, at which to stop.
        most: largest number of evaluations.

    """
    start = np.asarray(start, dtype=float)
    path: list[np.ndarray] = []
    try:
        size = evaluate(start)[0].size
    except NoOrbit as error:
        return Minimisation.without_orbit(start, error)

    def residual(values: np.ndarray) -> np.ndarray:
        try:
            return evaluate(values)[0]
        except NoOrbit:
            # The method responds to values that are not finite by a shorter step.
            return np.full(size, np.nan)

    def jacobian(values: np.ndarray) -> np.ndarray:
        rest, slopes = evaluate(values)
        path.append(np.append(0.5 * rest @ rest, values))
        return slopes

    result = least_squares(residual, start, jacobian, (low, high), 'trf', x_scale='jac',
                          ftol=tolerance, xtol=tolerance, gtol=1e-15, max_nfev=most)
    return Minimisation(start, result.x, float(result.cost), np.array(path), result.nfev,
                        result.status > 0)


#: MIN_DELAY_EXCESS: of the delay over the critical one, relative.
MIN_DELAY_EXCESS = 1e-7


class Coordinates:
    """Free numbers of a fit, and the coordinates in which the trust region moves.

    All numbers and the phase, which comes last, are their own coordinates, except a free delay
    without bounds of its own.

    Attributes:
        free: the free numbers.
        delay: index of the number measured in units of its critical value, -1 for none.

    """

    def __init__(self, network: Network, gait: str, free: Sequence[Free]) -> None:
        self._network, self._gait, self.free = network, gait, tuple(free)
        delay = network.ranges.get(network.delay_parameter)
        self.delay = next((k for k, parameter in enumerate(free) if delay
                            and parameter.name == network.delay_parameter
                            and (parameter.low, parameter.high) == (delay.low, delay.high)), -1)

    @property
    def straight(self) -> bool:
        """Whether all numbers are their own coordinates."""
        return self.delay < 0

    def _onset(self, values: np.ndarray) -> HopfPoint:
        network = with_values(self._network, self.free, values[:len(self.free)])
        point = first_hopf(network, self._gait) if np.isfinite(values).all() else None
        if point is None:
            start = network.as_dict()
            values_text = ', '.join(f'{name} {start[name]:g}' for name in network.needed)
            raise NoOrbit(f'{values_text} gives no {self._gait} at any delay')
        return point

    def of(self, values: np.ndarray) -> np.ndarray:
        """Return coordinates of values; NoOrbit where the gait exists at no delay."""
        coordinates = np.array(values, dtype=float)
        if not self.straight:
            coordinates[self.delay] /= self._onset(coordinates).value
        return coordinates

    def values(self, coordinates: np.ndarray) -> np.ndarray:
        """Return values at coordinates; NoOrbit as in of, or where the delay leaves its range."""
        values = np.array(coordinates, dtype=float)
        if not self.straight:
            values[self.delay] *= self._onset(values).value
            delay = self.free[self.delay]
            if not delay.low <= values[self.delay] <= delay.high:
                raise NoOrbit(f'{delay.name} {values[self.delay]:g} is not within {delay.low:g} '
                              f'to {delay.high:g}')
        return values

    def slopes(self, coordinates: np.ndarray) -> np.ndarray:
        """Return the derivatives of the values by the coordinates, shape (n, n)."""
        matrix = np.eye(coordinates.size)
        if not self.straight:
            point, k = self._onset(coordinates), self.delay
            slopes = point.slopes
            for j, parameter in enumerate(self.free):
                matrix[k, j] = coordinates[k] * slopes.get(parameter.name, 0.0)
            matrix[k, k] = point.value
        return matrix

    def move(self, values: np.ndarray, step: np.ndarray) -> np.ndarray:
        """Move values by a step in the coordinates, within the bounds."""
        if self.straight:
            low, high = self.bounds(values)
            return np.clip(values + step, low, high)
        begin = self.of(values)
        low, high = self.bounds(values)
        return self.values(np.clip(begin + np.linalg.solve(self.slopes(begin), step), low, high))

    def bounds(self, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the bounds of the coordinates."""
        low = np.array([*(one.low for one in self.free), -np.inf])
        high = np.array([*(one.high for one in self.free), np.inf])
        if not self.straight:
            low[self.delay], high[self.delay] = 1.0 + MIN_DELAY_EXCESS, np.inf
        # Beyond 0, where there is no gait, the same waveform may have another sign and delay.
        for k, one in enumerate(self.free):
            if one.name in self._network.needed:
                low[k], high[k] = ((max(low[k], 0.0), high[k]) if values[k] > 0.0
                                   else (low[k], min(high[k], 0.0)))
        return low, high

    def descend(self, evaluate: Evaluate, start: np.ndarray, tolerance: float, most: int = 100
                ) -> Minimisation:
        """Minimise from values with an orbit, as ``minimise`` does, in the coordinates.

        Args:
            evaluate: the problem, in values.
            start: values.
            tolerance: relative change of coordinates, and of the cost, at which to stop.
            most: largest number of evaluations.

        """
        def in_coordinates(coordinates: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            residual, slopes = evaluate(self.values(coordinates))
            return residual, slopes if self.straight else slopes @ self.slopes(coordinates)

        low, high = self.bounds(start)
        begin = np.clip(self.of(start), low, high)
        trial = minimise(in_coordinates, begin, low, high, tolerance, most)
        if self.straight or trial.reason:
            return replace(trial, start=start)
        path = np.array([[row[0], *self.values(row[1:])] for row in trial.path])
        return replace(trial, start=start, values=self.values(trial.values), path=path)

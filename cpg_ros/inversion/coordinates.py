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

"""Coordinates in which a trust region moves: the delay is measured by the gait's critical one.

Close to where a gait is born its shape is the same all along the Hopf set, which is curved. With
the delay over its critical value for a coordinate that valley is straight, and the set's edge a
bound.
"""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace

from cpg_ros.dynamics.hopf_point import first_hopf, HopfPoint
from cpg_ros.dynamics.periodic import NoOrbit
from cpg_ros.inversion.free_parameters import Free, with_values, within_hopf_set
from cpg_ros.inversion.trust_region import Evaluate, Minimisation, minimise
from cpg_ros.networks.network import Network
import numpy as np

#: Least share of the critical delay by which the delay is above it.
ABOVE = 1e-7
#: Where else to look: critical delays that are near it, or anywhere; factors of other numbers.
NEAR, LATE, FACTORS = 1.03, (1.03, 1.3, 2.0, 4.0), (0.45, 0.7, 1.4, 2.0, 3.0)


class Coordinates:
    """Free numbers of a fit, and what the trust region moves instead.

    The phase, which comes last, and all numbers but a free delay are their own coordinates. A
    delay with bounds of its own is, too.

    Attributes:
        free: the free numbers.
        delay: index of the one that is measured by its critical value, -1 for none.

    """

    def __init__(self, network: Network, gait: str, free: Sequence[Free]) -> None:
        self._network, self._gait, self.free = network, gait, tuple(free)
        whole = network.ranges.get(network.delay_parameter)
        self.delay = next((k for k, one in enumerate(free) if whole
                            and one.name == network.delay_parameter
                            and (one.low, one.high) == (whole.low, whole.high)), -1)

    @property
    def straight(self) -> bool:
        """Whether all numbers are their own coordinates."""
        return self.delay < 0

    def _onset(self, values: np.ndarray) -> HopfPoint:
        there = with_values(self._network, self.free, values[:len(self.free)])
        point = first_hopf(there, self._gait) if np.isfinite(values).all() else None
        if point is None:
            known = there.as_dict()
            values_text = ', '.join(f'{name} {known[name]:g}' for name in there.needed)
            raise NoOrbit(f'{values_text} gives no {self._gait} at any delay')
        return point

    def of(self, values: np.ndarray) -> np.ndarray:
        """Coordinates of values; NoOrbit where the gait is born at no delay."""
        found = np.array(values, dtype=float)
        if not self.straight:
            found[self.delay] /= self._onset(found).value
        return found

    def values(self, coordinates: np.ndarray) -> np.ndarray:
        """Values at coordinates; NoOrbit as in of, or where the delay leaves its range."""
        found = np.array(coordinates, dtype=float)
        if not self.straight:
            found[self.delay] *= self._onset(found).value
            one = self.free[self.delay]
            if not one.low <= found[self.delay] <= one.high:
                raise NoOrbit(f'{one.name} {found[self.delay]:g} is not within {one.low:g} to '
                              f'{one.high:g}')
        return found

    def slopes(self, coordinates: np.ndarray) -> np.ndarray:
        """Return the derivatives of the values by the coordinates, shape (n, n)."""
        found = np.eye(coordinates.size)
        if not self.straight:
            point, k = self._onset(coordinates), self.delay
            slopes = point.slopes
            for j, one in enumerate(self.free):
                found[k, j] = coordinates[k] * slopes.get(one.name, 0.0)
            found[k, k] = point.value
        return found

    def moved(self, values: np.ndarray, step: np.ndarray) -> np.ndarray:
        """Move values by a step along straight lines of the coordinates, within the bounds."""
        if self.straight:
            low, high = self._bounds(values)
            return np.clip(values + step, low, high)
        begin = self.of(values)
        low, high = self._bounds(values)
        return self.values(np.clip(begin + np.linalg.solve(self.slopes(begin), step), low, high))

    def valley(self, values: np.ndarray) -> list[np.ndarray]:
        """List values along the Hopf set, where other least costs may lie; none without delay."""
        if self.straight:
            return []
        here, found = self.of(values), []
        low, high = self._bounds(values)
        others = [j for j, one in enumerate(self.free) if j != self.delay and one.members]
        for late in LATE if not others else (NEAR, here[self.delay]):
            for j, factor in [(j, factor) for j in others for factor in FACTORS] or [(-1, 1.0)]:
                there = here.copy()
                there[self.delay] = late
                there[j] *= factor
                with suppress(NoOrbit):
                    found.append(self.values(np.clip(there, low, high)))
        return found

    def _bounds(self, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Bounds of the coordinates; a single number's are those of its Hopf set, too."""
        free = self.free
        if len(free) == 1 and self.straight and free[0].members:
            there = with_values(self._network, free, values[:1])
            free = (within_hopf_set(there, self._gait, free[0]),)
        low = np.array([*(one.low for one in free), -np.inf])
        high = np.array([*(one.high for one in free), np.inf])
        if not self.straight:
            low[self.delay], high[self.delay] = 1.0 + ABOVE, np.inf
        return low, high

    def descend(self, evaluate: Evaluate, start: np.ndarray, tolerance: float, most: int = 100
                ) -> Minimisation:
        """Minimise from values that have an orbit; as trust_region.minimise, but in coordinates.

        Args:
            evaluate: the problem, in values.
            start: values.
            tolerance: relative change of coordinates, and of the cost, at which to stop.
            most: evaluations at most.

        """
        def moved(coordinates: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            left, slopes = evaluate(self.values(coordinates))
            return left, slopes if self.straight else slopes @ self.slopes(coordinates)

        low, high = self._bounds(start)
        begin = np.clip(self.of(start), low, high)
        trial = minimise(moved, begin, low, high, tolerance, most)
        if self.straight or trial.why:
            return replace(trial, start=start)
        path = np.array([[row[0], *self.values(row[1:])] for row in trial.path])
        return replace(trial, start=start, values=self.values(trial.values), path=path)

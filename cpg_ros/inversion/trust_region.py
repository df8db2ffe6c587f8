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

"""A trust region from one start, with a record of its path.

Values without an orbit are infeasible: the region shrinks until it holds a step that has one.
"""

from collections.abc import Callable
from dataclasses import dataclass

from cpg_ros.dynamics.periodic import NoOrbit
from cpg_ros.short_repr import ShortRepr
import numpy as np
from scipy.optimize import least_squares

#: Values -> residual (n,) and its derivative (n, values); NoOrbit where there is none.
Evaluate = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]


@dataclass(frozen=True, eq=False, repr=False)
class Minimisation(ShortRepr):
    """What came of one start.

    Attributes:
        start: values it started from.
        values: where it ended.
        cost: half the sum of squares there; infinite where the start had no orbit.
        path: cost and values at the start and after every accepted step, shape
            (iterations + 1, 1 + values).
        evaluations: orbits that were solved for.
        converged: whether a tolerance was met.
        why: the reason where there was nothing to start from, or ''.

    """

    start: np.ndarray
    values: np.ndarray
    cost: float
    path: np.ndarray
    evaluations: int
    converged: bool
    why: str = ''

    @classmethod
    def without_orbit(cls, start: np.ndarray, error: NoOrbit) -> 'Minimisation':
        """Return what comes of a start that has no orbit."""
        return cls(start, start, float('inf'), np.empty((0, 1 + start.size)), 1, False, str(error))

    @property
    def iterations(self) -> int:
        """Accepted steps."""
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
        most: evaluations at most.

    """
    start = np.asarray(start, dtype=float)
    path: list[np.ndarray] = []
    evaluations = 0
    try:
        size = evaluate(start)[0].size
    except NoOrbit as error:
        return Minimisation.without_orbit(start, error)

    def residual(values: np.ndarray) -> np.ndarray:
        nonlocal evaluations
        evaluations += 1
        try:
            return evaluate(values)[0]
        except NoOrbit:
            # The method answers what is not finite with a shorter step.
            return np.full(size, np.nan)

    def jacobian(values: np.ndarray) -> np.ndarray:
        left, slopes = evaluate(values)
        path.append(np.append(0.5 * left @ left, values))
        return slopes

    found = least_squares(residual, start, jacobian, (low, high), 'trf', x_scale='jac',
                          ftol=tolerance, xtol=tolerance, gtol=1e-15, max_nfev=most)
    return Minimisation(start, found.x, float(found.cost), np.array(path), evaluations,
                        found.status > 0)

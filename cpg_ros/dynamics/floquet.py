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

"""Floquet multipliers of a gait: factors by which small disturbances grow in a period.

They split into those within the gait's symmetry class, 1 among them, and those transverse to it,
which the symmetry lock -g (I - P) x damps.
"""

from dataclasses import dataclass

from cpg_ros.common.errors import ShortRepr
from cpg_ros.dynamics.fourier.floquet import Accuracy, EXACT
from cpg_ros.dynamics.orbit import Orbit
from cpg_ros.dynamics.orbit_method import orbit_method
import numpy as np
import scipy

#: Modulus above which a multiplier is not distinguished from 1.
MAX_STABLE_MODULUS = 1.0 - 1e-7
#: Gains at which the growth is computed in the search for the smallest sufficient one.
NUM_GAINS = 8
#: Error of the growth during that search.
GROWTH_TOLERANCE = 1e-4
#: Gains that are tried where no bound is known.
MAX_ITERATIONS = 40
#: Names of the values of stable().
VERDICTS = {True: 'stable', False: 'unstable', None: 'cannot tell'}


def stable(modulus: float, error: float = 0.0) -> bool | None:
    """Return whether a disturbance decays; None if its multiplier is 1 to within the error.

    Args:
        modulus: of the multiplier.
        error: of the modulus; at least 1e-7 is assumed.

    """
    error = max(error, 1.0 - MAX_STABLE_MODULUS)
    return None if abs(modulus - 1.0) <= error else modulus < 1.0


@dataclass(frozen=True, eq=False, repr=False)
class Multipliers(ShortRepr):
    """Floquet multipliers of an orbit over a period, largest first.

    A delay gives infinitely many; those below rounding errors are meaningless.

    Attributes:
        period: T in model time.
        gain: of the symmetry lock, 1/model time.
        within: in the gait's symmetry class, without the trivial one.
        trivial: multiplier along the orbit, 1 up to the numerical error.
        parts: transverse ones of each invariant subspace.

    """

    period: float
    gain: float
    within: np.ndarray
    trivial: complex
    parts: tuple[np.ndarray, ...] = ()

    @property
    def transverse(self) -> np.ndarray:
        """Multipliers outside the class."""
        return by_size(np.concatenate([np.zeros(0), *self.parts]))

    @property
    def subspaces(self) -> list[np.ndarray]:
        """Multipliers of the class without the trivial one, then of each transverse subspace."""
        return [by_size(part) for part in (self.within, *self.parts)]

    def _summary(self) -> str:
        return (f'leading within {self.leading_within:.6g}, transverse '
                f'{self.leading_transverse:.6g}, gain {self.gain:.6g}, error {self.error:.0e}')

    @property
    def leading_within(self) -> float:
        """Largest modulus in the class except the trivial one; 0 if there is none."""
        return float(np.abs(self.within).max(initial=0.0))

    @property
    def leading_transverse(self) -> float:
        """Largest modulus outside the class; 0 if there is none."""
        return float(np.abs(self.transverse).max(initial=0.0))

    @property
    def leading(self) -> float:
        """Modulus of the largest multiplier except the trivial one."""
        return max(self.leading_within, self.leading_transverse)

    @property
    def unstable(self) -> int:
        """Number of multipliers that are not inside the unit circle, except the trivial one."""
        return sum(int((np.abs(part) >= MAX_STABLE_MODULUS).sum())
                   for part in (self.within, *self.parts))

    @property
    def error(self) -> float:
        """Distance of the trivial multiplier from 1, an estimate of the error of the others."""
        return abs(self.trivial - 1.0)

    @property
    def attracts(self) -> bool | None:
        """Whether all disturbances decay; None if the largest multiplier is 1 to the error."""
        return stable(self.leading, self.error)

    @property
    def attracts_within(self) -> bool | None:
        """Whether all disturbances within the class decay; None as for attracts."""
        return stable(self.leading_within, self.error)


def multipliers(orbit: Orbit, gain: float = 0.0, accuracy: Accuracy = EXACT) -> Multipliers:
    """Compute the multipliers from the variational equation along the orbit.

    Args:
        orbit: of any network.
        gain: of a symmetry lock, 1/model time.
        accuracy: with a delay; by default all multipliers, as exactly as possible.

    """
    floquet = orbit_method(orbit.network).floquet
    within, trivial = floquet.within(orbit, accuracy)
    return Multipliers(orbit.period, gain, by_size(within), trivial,
                       floquet.transverse(orbit, gain, accuracy))


def multipliers_within(orbit: Orbit) -> Multipliers:
    """Compute the multipliers within the gait's class only."""
    within, trivial = orbit_method(orbit.network).floquet.within(orbit, EXACT)
    return Multipliers(orbit.period, 0.0, by_size(within), trivial)


def by_size(values: np.ndarray) -> np.ndarray:
    """Return multipliers by descending modulus."""
    return values[np.argsort(-np.abs(values), kind='stable')]


def attracts_with(orbit: Orbit, gain: float) -> bool | None:
    """Return whether all disturbances decay with a lock, gain in 1/model time; None as above."""
    inside = multipliers_within(orbit)
    if not inside.attracts:
        return inside.attracts
    largest = _largest_outside(orbit, gain, GROWTH_TOLERANCE)
    if abs(largest - MAX_STABLE_MODULUS) <= 10.0 * GROWTH_TOLERANCE:
        largest = _largest_outside(orbit, gain)
    return stable(largest, inside.error)


def _largest_outside(orbit: Orbit, gain: float, exact: float = 1e-10) -> float:
    return float(orbit_method(orbit.network).floquet.largest_transverse(orbit, gain, exact))


def smallest_gain(orbit: Orbit) -> float:
    """Return the symmetry gain above which every transverse disturbance decays, 1/model time."""
    def growth(gain: float, exact: float = 1e-10) -> float:
        """Logarithm of the leading transverse multiplier."""
        largest = _largest_outside(orbit, gain, exact)
        return float(np.log(largest)) if largest > 0.0 else -np.inf

    if not orbit.network.delay:
        # Transverse multipliers shrink by exp(-g T) exactly.
        return max(0.0, growth(0.0) / orbit.period)
    # With a delay the growth need not fall evenly with the gain: search downward.
    enough = sufficient_gain(orbit, 0.0)
    for gain in enough * np.arange(NUM_GAINS - 1, -1, -1) / NUM_GAINS:
        if growth(gain, GROWTH_TOLERANCE) >= -GROWTH_TOLERANCE:
            if growth(gain) < 0.0:
                enough = gain
                continue
            return float(scipy.optimize.brentq(growth, gain, enough, xtol=1e-8))
        enough = gain
    return 0.0


def sufficient_gain(orbit: Orbit, rate: float) -> float:
    """Return a symmetry gain with which transverse disturbances decay at a rate, 1/model time.

    It is the network's own bound, which holds in any state, also during a change of gait; without
    one it follows from the orbit's multipliers.
    """
    bound = orbit.network.sufficient_gain(rate)
    if bound is not None:
        return bound
    gain = 0.0
    for _ in range(MAX_ITERATIONS):
        largest = _largest_outside(orbit, gain)
        growth = np.log(largest) / orbit.period + rate if largest > 0.0 else -np.inf
        if growth <= 1e-9:
            break
        # Without a delay this is exact; with one, a start.
        gain += float(growth) if not orbit.network.delay else max(float(growth), 0.5 * gain)
    return gain

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

"""Floquet multipliers of a gait: the factors of small disturbances over a period.

They split into those within the gait's symmetry class, 1 among them, and those transverse to it,
which the symmetry lock -g (I - P) x shrinks and nothing else does.
"""

from dataclasses import dataclass

from cpg_ros.common.errors import ShortRepr
from cpg_ros.dynamics.orbit import Orbit
from cpg_ros.dynamics.orbit_method import orbit_method
import numpy as np
import scipy

#: ATTRACTS: modulus of a multiplier below which it is distinguishable from 1.
ATTRACTS = 1.0 - 1e-7
#: GAINS: number of gains between 0 and the bound among which the smallest sufficient one is
#: sought.
GAINS = 8
#: ROUGHLY: error of the growth during that search.
ROUGHLY = 1e-4
#: MOST_GAINS: number of gains that are tried where no bound is known.
MOST_GAINS = 40


@dataclass(frozen=True, eq=False, repr=False)
class Multipliers(ShortRepr):
    """Floquet multipliers of an orbit over a period, largest first.

    With a delay there are infinitely many; those that decay to nothing are rounding.

    Attributes:
        period: T in model time.
        gain: of the symmetry lock, 1/model time.
        within: in the gait's symmetry class, without the trivial one.
        transverse: outside of it.
        trivial: the one along the orbit, 1 but for the error of the computation.
        parts: those transverse again, of each subspace that the flow keeps apart from others.

    """

    period: float
    gain: float
    within: np.ndarray
    transverse: np.ndarray
    trivial: complex
    parts: tuple[np.ndarray, ...] = ()

    @property
    def subspaces(self) -> list[np.ndarray]:
        """Multipliers of the class, without the trivial one, and of each part; largest first."""
        return [by_size(part) for part in (self.within, *self.parts)]

    def _summary(self) -> str:
        return (f'leading within {self.leading_within:.6g}, transverse '
                f'{self.leading_transverse:.6g}, gain {self.gain:.6g}, error {self.error:.0e}')

    @property
    def leading_within(self) -> float:
        """Modulus of the largest in the class but the trivial one; 0 if there is none."""
        return float(np.abs(self.within).max(initial=0.0))

    @property
    def leading_transverse(self) -> float:
        """Modulus of the largest outside the class; 0 if there is none."""
        return float(np.abs(self.transverse).max(initial=0.0))

    @property
    def error(self) -> float:
        """Distance of the trivial multiplier from 1, an estimate of the error of the others."""
        return abs(self.trivial - 1.0)

    @property
    def attracts(self) -> bool:
        """Whether all disturbances decay; neutral ones, as of uncoupled rings, do not."""
        return self.leading < ATTRACTS

    @property
    def leading(self) -> float:
        """Modulus of the largest but the trivial one: the gait attracts if it is below 1."""
        return max(self.leading_within, self.leading_transverse)


def multipliers(orbit: Orbit, gain: float = 0.0) -> Multipliers:
    """Compute the multipliers from the variational equation along the orbit.

    Args:
        orbit: of any network.
        gain: of a symmetry lock, 1/model time.

    """
    rest, trivial = orbit_method(orbit.network).floquet.within(orbit)
    parts = orbit_method(orbit.network).floquet.transverse(orbit, gain)
    return Multipliers(orbit.period, gain, by_size(rest),
                       by_size(np.concatenate([np.zeros(0), *parts])), trivial, parts)


def leading_within(orbit: Orbit) -> float:
    """Return the modulus of the leading multiplier within the class but the trivial one."""
    return float(np.abs(orbit_method(orbit.network).floquet.within(orbit)[0]).max(initial=0.0))


def by_size(values: np.ndarray) -> np.ndarray:
    """Return multipliers by falling modulus."""
    return values[np.argsort(-np.abs(values), kind='stable')]


def attracts_with(orbit: Orbit, gain: float) -> bool:
    """Whether all disturbances decay with a symmetry lock of this gain, 1/model time."""
    if leading_within(orbit) >= ATTRACTS:
        return False
    rough = _largest_outside(orbit, gain, ROUGHLY)
    # Only near the edge does it matter by how much.
    return (rough if abs(rough - ATTRACTS) > 10.0 * ROUGHLY
            else _largest_outside(orbit, gain)) < ATTRACTS


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
    # With a delay a lock need not help evenly: from one that is enough downward.
    enough = sufficient_gain(orbit, 0.0)
    for gain in enough * np.arange(GAINS - 1, -1, -1) / GAINS:
        if growth(gain, ROUGHLY) >= -ROUGHLY:
            if growth(gain) < 0.0:
                enough = gain
                continue
            return float(scipy.optimize.brentq(growth, gain, enough, xtol=1e-8))
        enough = gain
    return 0.0


def sufficient_gain(orbit: Orbit, rate: float) -> float:
    """Return a symmetry gain with which transverse disturbances decay at a rate, 1/model time.

    The network's own bound, which holds in any state of it, also while one gait gives way to
    another; or, where none is known, from the orbit's multipliers.
    """
    bound = orbit.network.sufficient_gain(rate)
    if bound is not None:
        return bound
    gain = 0.0
    for _ in range(MOST_GAINS):
        largest = _largest_outside(orbit, gain)
        growth = np.log(largest) / orbit.period + rate if largest > 0.0 else -np.inf
        if growth <= 1e-9:
            break
        # Without a delay this is exact; with one, a start.
        gain += float(growth) if not orbit.network.delay else max(float(growth), 0.5 * gain)
    return gain

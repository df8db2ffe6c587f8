"""Floquet multipliers of a gait: what a small disturbance is multiplied by in a period.

They split into those within the gait's symmetry class, 1 among them, and those transverse to it,
which the symmetry lock -g (I - P) x shrinks and nothing else does.
"""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq

from cpg_ros.dynamics.delay_floquet import transverse, variation
from cpg_ros.dynamics.delayed_orbit import DelayedOrbit
from cpg_ros.dynamics.mesh_floquet import mesh_multipliers
from cpg_ros.dynamics.mesh_orbit import MeshOrbit
from cpg_ros.dynamics.periodic import Orbit
from cpg_ros.networks.delayed import default_symmetry_gain

#: A multiplier from here on up is 1 as far as can be told.
ATTRACTS = 1.0 - 1e-7
#: Gains between none and the bound among which the smallest that is enough is looked for.
GAINS = 8


@dataclass(frozen=True)
class Multipliers:
    """Floquet multipliers of an orbit over a period, largest first.

    With a delay there are infinitely many; those that decay to nothing are rounding.

    Attributes:
        period: T in model time.
        gain: of the symmetry lock, 1/model time.
        within: in the gait's symmetry class, without the trivial one.
        transverse: outside of it.
        trivial: the one along the orbit, 1 but for the error of the computation.

    """

    period: float
    gain: float
    within: np.ndarray
    transverse: np.ndarray
    trivial: complex

    @property
    def leading_within(self) -> float:
        """Modulus of the largest in the class but the trivial one; 0 if there is none."""
        return float(np.abs(self.within).max(initial=0.0))

    @property
    def leading_transverse(self) -> float:
        """Modulus of the largest outside the class; 0 if there is none."""
        return float(np.abs(self.transverse).max(initial=0.0))

    @property
    def attracts(self) -> bool:
        """Whether all disturbances decay: neutral ones, such as of rings not coupled, do not."""
        return self.leading < ATTRACTS

    @property
    def leading(self) -> float:
        """Modulus of the largest but the trivial one: the gait attracts if it is below 1."""
        return max(self.leading_within, self.leading_transverse)


def within_class(orbit: DelayedOrbit) -> float:
    """Return the modulus of the leading multiplier within the class but the trivial one."""
    return float(np.abs(_parted(variation(orbit)[1])[0]).max(initial=0.0))


def multipliers(orbit: Orbit, gain: float = 0.0) -> Multipliers:
    """Compute the multipliers from the variational equation along the orbit.

    Args:
        orbit: of any network.
        gain: of a symmetry lock, 1/model time.

    """
    if isinstance(orbit, DelayedOrbit):
        equation, inside = variation(orbit)
        outside = transverse(equation, orbit.symmetry, gain)
    elif isinstance(orbit, MeshOrbit):
        inside, outside = mesh_multipliers(orbit)
        outside = outside * np.exp(-gain * orbit.period)
    else:
        raise TypeError(f'multipliers of {type(orbit).__name__} are not known')
    rest, trivial = _parted(inside)
    return Multipliers(orbit.period, gain, _sorted(rest), _sorted(outside), trivial)


def _sorted(values: np.ndarray) -> np.ndarray:
    return values[np.argsort(-np.abs(values), kind='stable')]


def _parted(inside: np.ndarray) -> tuple[np.ndarray, complex]:
    """Take the trivial multiplier out of those within the class."""
    place = int(np.abs(inside - 1.0).argmin())
    return np.delete(inside, place), complex(inside[place])


def smallest_gain(orbit: Orbit) -> float:
    """Return the symmetry gain above which every transverse disturbance decays, 1/model time."""
    if isinstance(orbit, MeshOrbit):
        largest = multipliers(orbit).leading_transverse
        return max(0.0, float(np.log(largest)) / orbit.period) if largest > 0.0 else 0.0
    if not isinstance(orbit, DelayedOrbit):
        raise TypeError(f'multipliers of {type(orbit).__name__} are not known')
    equation, _ = variation(orbit)

    def growth(gain: float) -> float:
        """Logarithm of the leading transverse multiplier."""
        return float(np.log(np.abs(transverse(equation, orbit.symmetry, gain)).max()))

    # With a delay a lock need not help evenly: from the bound, which is enough, downward.
    enough = default_symmetry_gain(orbit.network, rate=0.0)
    for gain in enough * np.arange(GAINS - 1, -1, -1) / GAINS:
        if growth(gain) >= 0.0:
            return float(brentq(growth, gain, enough, xtol=1e-10))
        enough = gain
    return 0.0

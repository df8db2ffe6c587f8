"""Does a gait attract, and with what symmetry gain?"""

from dataclasses import dataclass

import numpy as np

from cpg_ros.dynamics.delayed_orbit import DelayedOrbit
from cpg_ros.dynamics.floquet import multipliers, within_class
from cpg_ros.dynamics.periodic import Orbit
from cpg_ros.networks.delayed import default_symmetry_gain

#: Decay that the chosen gain gives transverse disturbances, per model time.
RATE = 0.5


@dataclass(frozen=True)
class Stability:
    """What is known of an orbit's stability.

    Attributes:
        enough: symmetry gain (1/model time) that makes transverse disturbances decay.
        chosen: the gain to run with: that, with a margin.
        flaw: why the gait does not attract whatever the gain, or ''.

    """

    enough: float
    chosen: float
    flaw: str


def stability(orbit: Orbit) -> Stability:
    """Judge an orbit by its multipliers; with a delay the gain comes from the bound on tanh.

    That bound holds in any state of the network, also while one gait gives way to another.
    """
    if isinstance(orbit, DelayedOrbit):
        leading = within_class(orbit)
        enough = chosen = default_symmetry_gain(orbit.network, RATE)
    else:
        found = multipliers(orbit)
        leading, slowest = found.leading_within, found.leading_transverse
        # Transverse multipliers shrink by exp(-g T) exactly; those of 1e-3 need no help.
        growth = np.log(slowest) / orbit.period if slowest > 0.0 else -np.inf
        enough, chosen = float(max(0.0, growth)), float(max(0.0, growth + RATE))
    flaw = '' if leading < 1.0 else (
        f'a disturbance within its own symmetry class grows {leading:.4g} times a stride')
    return Stability(enough, chosen, flaw)

"""Does a gait attract, and with what symmetry gain?"""

from dataclasses import dataclass

import numpy as np

from cpg_ros.dynamics.delayed_orbit import DelayedOrbit
from cpg_ros.dynamics.floquet import multipliers
from cpg_ros.dynamics.mesh_orbit import MeshOrbit
from cpg_ros.dynamics.periodic import Orbit
from cpg_ros.dynamics.stepper import Stepper
from cpg_ros.networks.delayed import Delayed, default_symmetry_gain

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
    """Judge an orbit: by its multipliers, or with a delay by the bound on tanh and a trial."""
    if isinstance(orbit, DelayedOrbit):
        assert isinstance(orbit.network, Delayed)
        enough = default_symmetry_gain(orbit.network)
        return Stability(enough, enough, '' if _holds(orbit, enough) else
                         'the network leaves it within its own symmetry class')
    if not isinstance(orbit, MeshOrbit):
        raise TypeError(f'stability of {type(orbit).__name__} is not known')
    found = multipliers(orbit)
    leading = float(np.abs(found.within).max(initial=0.0))
    flaw = '' if leading < 1.0 else (
        f'a disturbance within its own symmetry class grows {leading:.4g} times a stride')
    # Transverse multipliers shrink by exp(-g T) exactly; at gain 0 those of 1e-3 need no help.
    slowest = float(np.abs(found.transverse).max(initial=0.0))
    chosen = 0.0 if slowest == 0.0 else max(0.0, np.log(slowest) / orbit.period + RATE)
    return Stability(found.gain, float(chosen), flaw)


def _holds(orbit: DelayedOrbit, gain: float) -> bool:
    """Tell whether the orbit attracts within its class: 1 % off it, 12 periods long."""
    part = orbit.period / 128
    stepper = Stepper(orbit.network, _Scaled(orbit, 1.01), min(part, orbit.network.delay),
                      orbit.network.delay, gain=gain, symmetry=orbit.symmetry)
    stepper.advance(10 * orbit.period)
    # numpy's maximum, because a NaN comes through it.
    highest = np.max([stepper.advance(part)[0, 0] for _ in range(256)])
    return bool(abs(highest / orbit.peak - 1.0) < 0.012)


@dataclass(frozen=True)
class _Scaled:
    """A history in the orbit's class but off it."""

    orbit: DelayedOrbit
    factor: float

    def __call__(self, times: np.ndarray) -> np.ndarray:
        return self.factor * self.orbit(times)

    def derivative(self, times: np.ndarray) -> np.ndarray:
        return self.factor * self.orbit.derivative(times)

"""Hopf points of the delayed network's rest state, mode by mode (DESIGN 2.1).

In the symmetry class (j, k) the characteristic equation is ``lambda = A + B exp(-lambda tau)``
with ``A = a + b + d i^(-j)`` and ``B = c (-1)^k``; its crossings are known in closed form.
"""

import cmath
import math
from dataclasses import dataclass, replace

from cpg_ros.networks.delayed import Delayed, Mode


@dataclass(frozen=True)
class HopfPoint:
    """A crossing of the imaginary axis: angular frequency (rad per model time) and delay."""

    omega: float
    tau: float


def hopf_point(network: Delayed, mode: Mode) -> HopfPoint | None:
    """Return the first delay at which the mode's fast wave crosses, or None if it never does.

    ``omega = Im A + sqrt(c^2 - (Re A)^2)``, ``tau = (-arg((i omega - A)/B) mod 2 pi)/omega``.
    """
    a, b = mode.eigenvalue_terms(network)
    square = b * b - a.real * a.real
    if square <= 0.0:
        return None
    omega = a.imag + math.sqrt(square)
    if omega <= 0.0:
        return None
    angle = -cmath.phase((1j * omega - a) / b) % (2.0 * math.pi)
    return HopfPoint(omega, angle / omega)


def weakened(network: Delayed, gain: float) -> Delayed:
    """Return the network with every tanh replaced by gain * tanh.

    The rest state of this network is, to first harmonic, an oscillation of the given one whose
    amplitude makes the describing function of tanh equal to gain.
    """
    return replace(network, b=gain * network.b, c=gain * network.c, d=gain * network.d)

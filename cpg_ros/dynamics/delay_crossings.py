"""Where the roots of ``lambda = A + B exp(-lambda tau)`` cross the imaginary axis, in closed form.

The characteristic equation of a symmetry class with one variable a cell (docs/theory.md). A root
i omega has ``|i omega - A| = |B|``, which is quadratic in omega.
"""

import cmath
import math


def frequencies(a: complex, b: complex) -> list[float]:
    """Return omega > 0 of the crossings, ``Im A +- sqrt(|B|^2 - (Re A)^2)``, the fast one first."""
    square = abs(b)**2 - a.real**2
    if square <= 0.0:
        return []
    return [omega for omega in (a.imag + math.sqrt(square), a.imag - math.sqrt(square))
            if omega > 0.0]


def critical_delay(a: complex, b: complex, omega: float, n: int = 0) -> float:
    """Return ``tau_n = (-arg((i omega - A)/B) mod 2 pi + 2 pi n) / omega``."""
    angle = -cmath.phase((1j * omega - a) / b) % (2.0 * math.pi)
    return (angle + 2.0 * math.pi * n) / omega

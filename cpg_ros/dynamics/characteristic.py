"""Characteristic roots of the delayed network's rest state, all of them, by Lambert's W.

In the symmetry class (j, k) the characteristic equation is ``lambda = A + B exp(-lambda tau)``
(docs/theory.md, section Roots and Hopf points), so ``(lambda - A) tau`` is a branch of W at
``B tau exp(-A tau)``: ``lambda_n = A + W_n(B tau exp(-A tau)) / tau``. Real parts
fall as n goes from 0 to either side.
"""

import numpy as np
from scipy.special import lambertw

from cpg_ros.networks.delayed import MODES, Delayed, Mode

#: Beyond this exponent exp leaves the range of doubles, and W is taken from a logarithm.
LARGEST = 690.0


def _branches(a: complex, b: float, tau: float, n: np.ndarray) -> np.ndarray:
    """W_n(b tau exp(-a tau)), shape like n."""
    exponent = -a * tau
    if abs(exponent.real) <= LARGEST:
        return lambertw(b * tau * np.exp(exponent), n)
    # W_n(z) = L - log L + ... with L = log z + 2 pi i n large (Corless et al. 1996, eq. 4.18);
    # Newton's method on w + log w = L, whatever the sheet of the logarithm.
    argument = np.angle(b * np.exp(1j * exponent.imag))
    wanted = np.log(abs(b) * tau) + exponent.real + 1j * (argument + 2.0 * np.pi * n)
    w = wanted - np.log(wanted)
    for _ in range(6):
        gap = w + np.log(w) - wanted
        w = w - (gap - 2j * np.pi * np.round(gap.imag / (2.0 * np.pi))) / (1.0 + 1.0 / w)
    return w if exponent.real > 0.0 else np.where(n == 0, 0.0, w)


def characteristic_roots(network: Delayed, mode: Mode, count: int = 9) -> np.ndarray:
    """Return the mode's rightmost roots, 1/model time.

    Args:
        network: parameters; c must not be zero.
        mode: the symmetry class.
        count: how many roots to return; those of 2 count + 1 branches are looked at.

    Returns:
        Complex numbers by falling real part, shape (count,).

    """
    a, b = mode.eigenvalue_terms(network)
    roots = a + _branches(complex(a), b, network.tau, np.arange(-count, count + 1)) / network.tau
    return roots[np.argsort(-roots.real, kind='stable')][:count]


def unstable_roots(network: Delayed, mode: Mode) -> np.ndarray:
    """Return the mode's roots with positive real part, by falling real part."""
    count = 9
    while True:
        roots = characteristic_roots(network, mode, count)
        if roots[-1].real <= 0.0:
            return roots[roots.real > 0.0]
        count *= 2


def leading_roots(network: Delayed) -> dict[Mode, complex]:
    """Return each mode's rightmost root, 1/model time."""
    return {mode: complex(characteristic_roots(network, mode, 1)[0]) for mode in MODES}

"""Hopf points of the delayed network's rest state, mode by mode, and their normal forms.

In the symmetry class (j, k) the characteristic equation is ``lambda = A + B exp(-lambda tau)``
with ``A = a + b + d i^(-j)`` and ``B = c (-1)^k``; its crossings are known in closed form (DESIGN
2.1). The normal forms are in the paper's time, t/tau, and in mu = tau - tau_c; docs/theory.md
derives the correct one.
"""

import cmath
import math
from dataclasses import dataclass, replace
from functools import cached_property
from typing import cast

import numpy as np

from cpg_ros.dynamics.characteristic import unstable_roots
from cpg_ros.dynamics.normal_form import NormalForm
from cpg_ros.networks.delayed import GAITS, MODES, Delayed, Mode
from cpg_ros.networks.network import Network

#: A root this close to the imaginary axis, against its own size, is the crossing one.
ON_AXIS = 1e-7


@dataclass(frozen=True)
class HopfPoint:
    """A crossing of the imaginary axis by a pair of roots as the delay grows.

    Attributes:
        network: the parameters, its delay the critical one.
        mode: the symmetry class (j, k) of the wave that is born.
        n: how many turns more than the smallest the delay holds.
        omega: angular frequency, rad per model time.

    """

    network: Delayed
    mode: Mode
    n: int
    omega: float

    @property
    def tau(self) -> float:
        """Critical delay, model time."""
        return self.network.tau

    @property
    def gait(self) -> str:
        """Name of the primary gait, whichever way its wave runs."""
        j = 1 if self.mode.j == 3 else self.mode.j
        return next(gait for gait, class_ in GAITS.items() if class_ == (j, self.mode.k))

    @property
    def wave(self) -> str:
        """How the wave of walk and jump runs round the rings: '' for the gaits that stand."""
        return ('', 'LF leads LH', '', 'LH leads LF')[self.mode.j]

    @cached_property
    def normal_form(self) -> NormalForm:
        """``q = 1 + tau B e``, ``k1 = i omega / q``, ``k2 = -tau (b + d i^(-j) + B e) / q``.

        e = exp(-i omega tau). Each cell is ``2 r cos`` on the orbit.
        """
        a, b = self.mode.eigenvalue_terms(self.network)
        tau = self.network.tau
        past = b * cmath.exp(-1j * self.omega * tau)
        q = 1.0 + tau * past
        return NormalForm(1j * self.omega / q, -tau * (a - self.network.a + past) / q)

    @cached_property
    def published(self) -> NormalForm:
        """The normal form as Liu & Zhang (2024) print it, section 2; wrong (DESIGN 2.4, no. 1).

        ``D = 1/(8 (-1 + c e))``, ``k1 = 8 D (-a - b - d + c e)``, ``k2 = -8 tau D (-b + c e - d)``
        with e = exp(i omega tau), whatever the mode.
        """
        a, b, c, d, tau = self.network.as_dict().values()
        past = c * cmath.exp(1j * self.omega * tau)
        eight = 1.0 / (-1.0 + past)
        return NormalForm(eight * (-a - b - d + past), -tau * eight * (-b + past - d))

    @property
    def slopes(self) -> dict[str, float]:
        """Derivatives of the critical delay by the other parameters, by name.

        From ``i omega = A + B exp(-i omega tau)``, differentiated: real and imaginary part are
        two equations for the changes of omega and tau.
        """
        turn = (1, -1j, -1, 1j)[self.mode.j]
        b = self.mode.eigenvalue_terms(self.network)[1]
        past = np.exp(-1j * self.omega * self.tau)
        left = np.array([1j + 1j * self.tau * b * past, 1j * self.omega * b * past])
        right = np.array([1.0, 1.0, past * (-1) ** self.mode.k, turn])
        found = np.linalg.solve(np.array([left.real, left.imag]),
                                np.array([right.real, right.imag]))[1]
        return dict(zip(('a', 'b', 'c', 'd'), found.tolist(), strict=True))

    @property
    def drifts(self) -> bool:
        """Whether the gait's own class has a positive real root at every delay."""
        return self.mode.j % 2 == 0 and self.mode.eigenvalue_terms(self.network)[1] >= 0.0

    @property
    def direction(self) -> int:
        """1 where the roots enter the right half plane as the delay grows, -1 where they leave."""
        return 1 if self.normal_form.k1.real > 0.0 else -1

    @property
    def supercritical(self) -> bool:
        """Whether the orbits attract on the centre manifold: k2 < 0 (theorem 2.1)."""
        return self.normal_form.supercritical

    def _others(self, mode: Mode) -> int:
        """Roots of a mode with positive real part, but for the crossing one."""
        roots = unstable_roots(self.network, mode)
        close = ON_AXIS * max(1.0, self.omega)
        return int(np.sum((roots.real > close) | (abs(abs(roots.imag) - self.omega) > close)))

    @cached_property
    def unstable_transverse_roots(self) -> int:
        """Roots with positive real part outside the gait's class: none would have to be there."""
        own = {self.mode, Mode(-self.mode.j % 4, self.mode.k)}
        return sum(self._others(mode) for mode in MODES if mode not in own)

    @cached_property
    def unstable_roots(self) -> int:
        """All other roots with positive real part."""
        own = {self.mode, Mode(-self.mode.j % 4, self.mode.k)}
        return self.unstable_transverse_roots + sum(self._others(mode) for mode in own)

    def amplitude(self, tau: float) -> float:
        """Amplitude of every cell on the orbit near onset, ``2 sqrt(-k1 mu / k2)``.

        Raises:
            ValueError: at this delay the normal form has no orbit.

        """
        return 2.0 * self.normal_form.radius(tau - self.tau)

    def period(self, tau: float) -> float:
        """Period of the orbit near onset, model time; the error is of second order in mu.

        Raises:
            ValueError: at this delay the normal form has no orbit.

        """
        turning = self.omega * self.tau + self.normal_form.shift(tau - self.tau)
        return 2.0 * math.pi * tau / turning


def _crossing(network: Delayed, mode: Mode, omega: float, n: int) -> HopfPoint:
    """``tau_n = (-arg((i omega - A)/B) mod 2 pi + 2 pi n) / omega``."""
    a, b = mode.eigenvalue_terms(network)
    angle = -cmath.phase((1j * omega - a) / b) % (2.0 * math.pi)
    return HopfPoint(replace(network, tau=(angle + 2.0 * math.pi * n) / omega), mode, n, omega)


def _frequencies(network: Delayed, mode: Mode) -> list[float]:
    """``omega = Im A +- sqrt(c^2 - (Re A)^2) > 0``, the fast one first."""
    a, b = mode.eigenvalue_terms(network)
    square = b * b - a.real * a.real
    if square <= 0.0:
        return []
    return [omega for omega in (a.imag + math.sqrt(square), a.imag - math.sqrt(square))
            if omega > 0.0]


def hopf_point(network: Delayed, mode: Mode) -> HopfPoint | None:
    """Return the first delay at which the mode's fast wave crosses, or None if it never does."""
    omegas = _frequencies(network, mode)
    return _crossing(network, mode, omegas[0], 0) if omegas else None


def critical_point(network: Network, gait: str) -> HopfPoint | None:
    """Return where a gait is born as the delay grows; None at no delay, or of no network's."""
    if not network.delay_parameter:
        return None
    return hopf_point(cast(Delayed, network), network.symmetry(gait))


def hopf_points(network: Delayed, longest: float) -> list[HopfPoint]:
    """Return every Hopf point of all eight modes with a delay up to a bound, by their delays.

    Args:
        network: parameters; its own delay does not matter. c must not be zero.
        longest: bound of the delay, model time.

    """
    found = []
    for mode in MODES:
        for omega in _frequencies(network, mode):
            n = 0
            while (point := _crossing(network, mode, omega, n)).tau <= longest:
                found.append(point)
                n += 1
    return sorted(found, key=lambda point: point.tau)


def weakened(network: Delayed, gain: float) -> Delayed:
    """Return the network with every tanh replaced by gain * tanh.

    The rest state of this network is, to first harmonic, an oscillation of the given one whose
    amplitude makes the describing function of tanh equal to gain.
    """
    return replace(network, b=gain * network.b, c=gain * network.c, d=gain * network.d)

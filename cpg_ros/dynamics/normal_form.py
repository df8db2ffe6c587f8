"""The normal form of a Hopf bifurcation: ``z' = (i omega + k1 mu) z + k2 z |z|^2``.

With ``z = r exp(i theta)``: ``r' = Re k1 mu r + Re k2 r^3`` and
``theta' = omega + Im k1 mu + Im k2 r^2``, mu the distance of the parameter from the bifurcation.
"""

import math
from dataclasses import dataclass

from cpg_ros.dynamics.periodic import NoOrbit


@dataclass(frozen=True)
class NormalForm:
    """Coefficients of the normal form in the units of its own time.

    Attributes:
        k1: derivative of the critical eigenvalue by the parameter.
        k2: cubic coefficient.

    """

    k1: complex
    k2: complex

    @property
    def supercritical(self) -> bool:
        """Whether the orbits attract on the centre manifold: k2 < 0.

        They then lie where rest is unstable. Liu & Zhang (2024), theorem 2.1, say stable for
        k2 < 0 and supercritical for k1 k2 < 0; for k1 > 0, as they have it, that is one thing.
        """
        return self.k2.real < 0.0

    @property
    def side(self) -> int:
        """1 if the orbits lie where mu > 0 (k1 k2 < 0), -1 if where mu < 0."""
        return 1 if self.k1.real * self.k2.real < 0.0 else -1

    def radius(self, mu: float) -> float:
        """Radius of the orbit at a distance mu of the parameter, ``sqrt(-k1 mu / k2)``.

        Raises:
            ValueError: on this side there is no orbit.

        """
        square = -self.k1.real * mu / self.k2.real
        if square < 0.0:
            raise NoOrbit(f'at mu {mu:g} the normal form has no orbit')
        return math.sqrt(square)

    def shift(self, mu: float) -> float:
        """What the orbit's angular frequency there has over omega: ``Im k1 mu + Im k2 r^2``."""
        return self.k1.imag * mu + self.k2.imag * self.radius(mu)**2

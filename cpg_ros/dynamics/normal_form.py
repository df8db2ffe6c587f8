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

"""The normal form of a Hopf bifurcation: ``z' = (i omega + k1 mu) z + k2 z |z|^2``.

With ``z = r exp(i theta)``: ``r' = Re k1 mu r + Re k2 r^3`` and
``theta' = omega + Im k1 mu + Im k2 r^2``, mu the distance of the parameter from the bifurcation.
Where Re k2 is 0 terms of third order decide nothing. So it is where the rates are linear about the
equilibrium, their kinks away from it: there all of a disc of states oscillates at mu = 0, and the
orbits beyond begin with the size at which they reach a kink.
"""

from dataclasses import dataclass
import math

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
    def degenerate(self) -> bool:
        """Whether there is no term of third order to tell anything about orbits: Re k2 = 0."""
        return self.k2.real == 0.0

    @property
    def supercritical(self) -> bool:
        """Whether the orbits attract on the centre manifold: k2 < 0.

        They then lie where rest is unstable. Liu & Zhang (2024), theorem 2.1, say stable for
        k2 < 0 and supercritical for k1 k2 < 0; for k1 > 0, as they have it, that is one thing.
        """
        return self.k2.real < 0.0

    @property
    def side(self) -> int:
        """1 if the orbits lie where mu > 0 (k1 k2 < 0), -1 if where mu < 0, 0 if degenerate."""
        if self.degenerate:
            return 0
        return 1 if self.k1.real * self.k2.real < 0.0 else -1

    def radius(self, mu: float) -> float:
        """Radius of the orbit at a distance mu of the parameter, ``sqrt(-k1 mu / k2)``.

        Raises:
            NoOrbit: on this side there is none, or it is degenerate.

        """
        if self.degenerate:
            raise NoOrbit('the normal form is degenerate: it has no term of third order')
        square = -self.k1.real * mu / self.k2.real
        if square < 0.0:
            raise NoOrbit(f'at mu {mu:g} the normal form has no orbit')
        return math.sqrt(square)

    def shift(self, mu: float) -> float:
        """Return the orbit's angular frequency less omega: ``Im k1 mu + Im k2 r^2``."""
        return self.k1.imag * mu + self.k2.imag * self.radius(mu)**2

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

"""Theorem 4.2 of Buono & Golubitsky (2001): which Hopf bifurcations of the quadruped are stable.

With delta = gamma and xi = eta = 0, a Hopf bifurcation from stand is stable (critical eigenvalues
simple, all others to the left) if and only if alpha and gamma have the signs of its gait. Whether
the orbits attract then depends on the first Lyapunov coefficient besides.
"""

from dataclasses import dataclass

from cpg_ros.dynamics.equilibrium import equilibrium
from cpg_ros.dynamics.isotypic import blocks
from cpg_ros.networks.network import known
from cpg_ros.networks.quadruped import Quadruped
from cpg_ros.networks.symmetry import GAITS

#: Gait -> sign of beta against alpha, and the signs that alpha and gamma must have; 0 is any.
SIGNS = {'pronk': (1, 1, 1), 'pace': (1, 1, -1), 'bound': (1, -1, 1), 'trot': (1, -1, -1),
         'jump': (-1, 0, 1), 'walk': (-1, 0, -1)}
#: Couplings are equal, and eigenvalues on the imaginary axis, within this.
EQUAL = 1e-7


@dataclass(frozen=True)
class TheoremVerdict:
    """What the theorem says of a Hopf bifurcation.

    Attributes:
        gait: that branches off.
        unmet: hypotheses of the theorem that do not hold, as text.
        condition: on the signs, as text.
        met: whether it holds.
        overlooked: what the theorem's proof takes for granted though it does not hold, as text:
            the theorem, as stated, may be wrong there.

    """

    gait: str
    unmet: tuple[str, ...]
    condition: str
    met: bool
    overlooked: tuple[str, ...]

    @property
    def applies(self) -> bool:
        """Whether all hypotheses hold."""
        return not self.unmet

    @property
    def stable(self) -> bool | None:
        """Whether the theorem calls the bifurcation stable; None where it does not apply."""
        return self.met if self.applies else None

    def __str__(self) -> str:
        if self.unmet:
            return (f'theorem 4.2 does not apply to this {self.gait}: it requires '
                    f'{", ".join(self.unmet)}')
        text = (f'theorem 4.2: the bifurcation to {self.gait} is '
                f'{"stable" if self.met else "not stable"}, as {self.condition} '
                f'{"holds" if self.met else "does not hold"}')
        if self.overlooked:
            text += f'; but its proof takes for granted that {" and ".join(self.overlooked)}'
        return text


def theorem_4_2(network: Quadruped, gait: str) -> TheoremVerdict:
    """Apply the theorem at a Hopf point of the gait; that it is one is taken for granted.

    For jump and walk the proof holds only for the rightmost pair of the class ("we always refer
    to the real part of the eigenvalue with greatest real part", corollary 5.4) and for alpha so
    small that the real blocks have complex eigenvalues ("if we choose alpha small enough").
    Where alpha is 0 the cells of a ring do not hear one another, classes coincide, and no
    bifurcation is simple.

    Raises:
        InputError: the gait is not one of the six, or a parameter is not finite.
        NoEquilibrium: the network has no stand.

    """
    mirror, along, across = SIGNS[known(gait, tuple(GAITS))]
    required = {'delta = gamma': network.delta - network.gamma,
                'xi = 0': network.xi, 'eta = 0': network.eta,
                'beta = alpha' if mirror > 0 else 'beta = -alpha':
                    network.beta - mirror * network.alpha}
    unmet = [text for text, gap in required.items() if not abs(gap) <= EQUAL]
    if abs(network.alpha) <= EQUAL:
        unmet.append('alpha different from 0')
    signs = [('alpha', along, network.alpha), ('gamma', across, network.gamma)]
    condition = ' and '.join(f'{name} {">" if sign > 0 else "<"} 0'
                             for name, sign, _ in signs if sign)
    met = all(sign * value > 0.0 for _, sign, value in signs if sign)

    overlooked = []
    split = blocks(network, equilibrium(network))
    if max(block.leading.real for block in split if block.gait == gait) > EQUAL:
        overlooked.append('the critical pair is the rightmost of its class')
    # Where beta = alpha all real blocks have the discriminant of the critical one.
    if mirror < 0 and any(block.real and block.leading.imag == 0.0 for block in split):
        overlooked.append('the real blocks have complex eigenvalues')
    return TheoremVerdict(gait, tuple(unmet), condition, met, tuple(overlooked))

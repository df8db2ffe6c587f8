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

"""Hopf points of the equilibrium of any network, with their normal forms.

On the centre manifold ``x = rest + z q + conj(z q) + ...`` with the eigenvector q of the class,
the same for every cell but for the character chi. B(x, y) of two classes lies in the class of the
product of their characters, so the reduction needs the characteristic matrices Delta of the
classes 1 and chi^2 only (Kuznetsov, *Elements of Applied Bifurcation Theory*, chapter 5; with a
delay Diekmann et al., *Delay Equations*, chapter IX)::

    k2 = <p, C(q, q, q*) + 2 B(q, Delta_1(0)^-1 B(q, q*))
             + B(q*, Delta_chi^2(2 i omega)^-1 B(q, q))> / 2

with ``Delta q = 0``, ``p Delta = 0`` and ``<p, Delta'(i omega) q> = 1``.
"""

from dataclasses import dataclass, replace
from functools import cached_property

from cpg_ros.dynamics.characteristic import characteristic_matrix, rightmost_first
from cpg_ros.dynamics.delay_crossings import delay_crossings
from cpg_ros.dynamics.equilibrium import equilibrium, everywhere
from cpg_ros.dynamics.expansion import Expansion
from cpg_ros.dynamics.isotypic import Block, block_of, blocks, character, power
from cpg_ros.dynamics.normal_form import NormalForm
from cpg_ros.networks.network import Network
from cpg_ros.networks.parameter_line import ParameterLine
from cpg_ros.short_repr import ShortRepr
import numpy as np

#: Roots this close to the imaginary axis lie on it, 1/model time or against omega.
ON_AXIS = 1e-8


@dataclass(frozen=True, eq=False, repr=False)
class HopfPoint(ShortRepr):
    """A crossing of the imaginary axis by a pair of roots.

    Attributes:
        network: there.
        line: on which it lies.
        value: of the parameters there; of the delay, model time.
        block: the critical class's block, with its gait, mode and wave.
        omega: of the critical root i omega, rad per model time, positive.
        rest: state of every cell at the equilibrium, shape (variables,).
        n: where the delay moves, how many turns more than the smallest it holds.

    """

    network: Network
    line: ParameterLine
    value: float
    block: Block
    omega: float
    rest: np.ndarray
    n: int = 0

    def _summary(self) -> str:
        return (f'{self.gait} of {self.network.name} at {self.line} {self.value:.7g}, '
                f'omega {self.omega:.7g}')

    @property
    def gait(self) -> str:
        """The primary gait that branches off, whichever way its wave runs."""
        return self.block.gait

    @property
    def mode(self) -> tuple[int, ...]:
        """The class (j, k)."""
        return self.block.mode

    @property
    def wave(self) -> str:
        """How the wave runs, as in the block."""
        return self.block.wave

    @cached_property
    def _eigenvectors(self) -> tuple[np.ndarray, np.ndarray]:
        """Return q of one cell with <q, q> = 1 over all cells, and p with <p, Delta' q> = 1."""
        matrix, slope = characteristic_matrix(1j * self.omega, self.block.now, self.block.past,
                                              self.network.delay)
        left, _, right = np.linalg.svd(matrix)
        q, p = right[-1].conj(), left[:, -1].conj()
        largest = q[np.abs(q).argmax()]
        q = q * (largest.conjugate() / abs(largest)) / np.sqrt(self.network.cells)
        return q, p / (p @ slope @ q)

    @property
    def vector(self) -> np.ndarray:
        """Eigenvector q of one cell, shape (variables,); over the whole network <q, q> = 1."""
        return self._eigenvectors[0]

    @property
    def eigenvector(self) -> np.ndarray:
        """Eigenvector q of the whole network, shape (components,)."""
        return np.kron(self.vector, self.block.vector)

    @property
    def state(self) -> np.ndarray:
        """Equilibrium of the whole network, shape (components,)."""
        return everywhere(self.network, self.rest)

    @cached_property
    def normal_form(self) -> NormalForm:
        """In model time, mu = value' - value; z belongs to q."""
        expansion, delay = self._expansion, self.network.delay
        axis, chi, (q, p) = 1j * self.omega, self.block.vector, self._eigenvectors
        one, twice = np.ones_like(chi), character(power(self.block.symmetry, 2))
        still = characteristic_matrix(0.0, *expansion.linear(one), delay)[0]
        double = characteristic_matrix(2.0 * axis, *expansion.linear(twice), delay)[0]
        ahead = expansion.heard(q, chi, axis)
        back, second = ahead.conj(), expansion.second
        flat = expansion.heard(_moved(still, second(ahead, back)), one)
        fast = expansion.heard(_moved(double, second(ahead, ahead)), twice, 2.0 * axis)
        k2 = 0.5 * (p @ (expansion.third(ahead, ahead, back) + 2.0 * second(ahead, flat)
                         + second(back, fast)))

        return NormalForm(self._speed(self.line), complex(k2))

    @cached_property
    def _expansion(self) -> Expansion:
        return Expansion(self.network, self.rest)

    def _speed(self, line: ParameterLine) -> complex:
        """Return the derivative of the critical root by the value on a line of parameters."""
        expansion, delay = self._expansion, self.network.delay
        axis, chi, (q, p) = 1j * self.omega, self.block.vector, self._eigenvectors
        one, late = np.ones_like(chi), np.exp(-axis * delay)
        still = characteristic_matrix(0.0, *expansion.linear(one), delay)[0]
        moves = expansion.heard(_moved(still, expansion.along(line)), one)
        now, past = expansion.linear_along(line, chi)
        change = (now + past * late) @ q + expansion.second(moves, expansion.heard(q, chi, axis))
        if self.network.delay_parameter in line.names:
            sign = line.signs[line.names.index(self.network.delay_parameter)]
            change = change - sign * axis * late * (self.block.past @ q)
        return complex(p @ change)

    @property
    def in_delays(self) -> NormalForm:
        """In time over the delay, as Liu & Zhang (2024) have it, which the delay scales as well.

        z is half the amplitude of a cell's first variable.
        """
        form, delay = self.normal_form, self.network.delay
        return NormalForm(1j * self.omega + delay * form.k1,
                          delay * form.k2 / abs(self.vector[0])**2)

    @property
    def slopes(self) -> dict[str, float]:
        """Derivatives of the value on the line by the network's other parameters, by name.

        The critical root stays on the axis: what one parameter moves it by, the line takes back.
        """
        back = -self._speed(self.line).real
        return {name: self._speed(ParameterLine((name,), (1.0,))).real / back
                for name in self.network.parameters() if name not in self.line.names}

    @property
    def drifts(self) -> bool:
        """Whether the gait's own class has a real root with positive real part as well."""
        close = ON_AXIS * max(1.0, self.omega)
        roots = self.block.right_of(close)
        return bool((np.abs(roots.imag) <= close).any())

    @property
    def direction(self) -> int:
        """1 where the critical pair moves to the right as the value grows, -1 to the left."""
        return 1 if self.normal_form.k1.real > 0.0 else -1

    @property
    def supercritical(self) -> bool:
        """Whether the orbits attract on the centre manifold."""
        return self.normal_form.supercritical

    @property
    def lyapunov(self) -> float:
        """First Lyapunov coefficient l1 = Re k2 / omega (Kuznetsov, section 3.5; <q, q> = 1)."""
        return self.normal_form.k2.real / self.omega

    def but_critical(self, block: Block, roots: np.ndarray) -> np.ndarray:
        """Return a block's roots without the critical one or pair, where it is the block's."""
        mine = dict(block.symmetry.shifts)
        for critical, symmetry in ((1j * self.omega, self.block.symmetry),
                                   (-1j * self.omega, power(self.block.symmetry, -1))):
            if mine == dict(symmetry.shifts) and len(roots):
                roots = np.delete(roots, np.abs(roots - critical).argmin())
        return roots

    @cached_property
    def _others(self) -> tuple[tuple[Block, np.ndarray], ...]:
        """All blocks with their other roots on the axis and right of it."""
        close = ON_AXIS * max(1.0, self.omega)
        return tuple((one, self.but_critical(one, one.right_of(-close)))
                     for one in blocks(self.network, self.rest))

    @property
    def leading_other(self) -> complex:
        """The rightmost root but for the critical pair, 1/model time."""
        return complex(rightmost_first(np.concatenate([
            self.but_critical(one, one.roots(3))
            for one in blocks(self.network, self.rest)]))[0])

    def _right(self, within: bool) -> int:
        close = ON_AXIS * max(1.0, self.omega)
        return int(sum((roots.real > close).sum() for other, roots in self._others
                       if within or not other.within(self.block)))

    @property
    def unstable_roots(self) -> int:
        """How many of the other roots have a positive real part."""
        return self._right(within=True)

    @property
    def unstable_transverse_roots(self) -> int:
        """How many of these lie outside the gait's class: none would have to be there."""
        return self._right(within=False)

    @property
    def simple(self) -> bool:
        """Whether no other root lies on the imaginary axis."""
        return all((roots.real > ON_AXIS * max(1.0, self.omega)).all()
                   for _, roots in self._others)

    @property
    def stable(self) -> bool:
        """Whether the bifurcation is stable in the sense of Buono & Golubitsky (section 4).

        Critical roots simple, all others to the left; the orbits attract if the bifurcation is
        supercritical as well.
        """
        return self.simple and self.unstable_roots == 0

    def amplitude(self, value: float) -> float:
        """Amplitude of every cell's first variable near onset, half its range: 2 |q_1| r.

        Raises:
            NoOrbit: the orbits lie on the other side.

        """
        return 2.0 * abs(self.vector[0]) * self.normal_form.radius(value - self.value)

    def period(self, value: float) -> float:
        """Period near onset in model time, to first order in value' - value.

        Raises:
            NoOrbit: the orbits lie on the other side.

        """
        return 2.0 * np.pi / (self.omega + self.normal_form.shift(value - self.value))

    def path(self, value: float, theta: np.ndarray) -> np.ndarray:
        """States near onset at times in cycles: ``rest + 2 Re(q z)``, shape (m, components).

        Raises:
            NoOrbit: the orbits lie on the other side.

        """
        network = self.line.at(self.network, value)
        turning = np.exp(2j * np.pi * (np.asarray(theta)[:, None] + self.block.symmetry.phases))
        swing = self.normal_form.radius(value - self.value) * np.concatenate(
            [entry * turning for entry in self.vector], axis=1)
        return everywhere(network, equilibrium(network)) + 2.0 * swing.real


def _moved(matrix: np.ndarray, push: np.ndarray) -> np.ndarray:
    """Solve for what a push moves; where there is none, a singular matrix does not matter."""
    return np.linalg.solve(matrix, push) if push.any() else np.zeros_like(push)


def first_hopf(network: Network, gait: str) -> HopfPoint | None:
    """Return where a primary gait is born as the delay grows; None if at no delay, or without one.

    It is the smallest delay at which a pair of roots of the gait's class moves to the right.

    Args:
        network: parameters; its own delay does not matter.
        gait: one of its gaits.

    Raises:
        InputError: an unknown gait.
        NoEquilibrium: the network has no equilibrium.

    """
    symmetry, delay = network.symmetry(gait), network.delay_parameter
    if not delay or len(symmetry.shifts) < len(symmetry.group.elements):
        return None
    rest, line = equilibrium(network), ParameterLine((delay,), (1.0,))
    block = block_of(Expansion(network, rest), symmetry)
    points = [crossing_at(block, line, rest, omega, tau)
              for omega, tau in delay_crossings(block.now, block.past)]
    # With one variable the fast wave is the one that is born, and the slow one ends.
    born = points[:1] if len(rest) == 1 else [one for one in points if one.direction > 0]
    return min(born, key=lambda one: one.value, default=None)


def crossing_at(block: Block, line: ParameterLine, rest: np.ndarray, omega: float, tau: float,
                n: int = 0) -> HopfPoint:
    """Return the Hopf point of a block at a delay.

    Args:
        block: of a network with any delay.
        line: of the delay alone.
        rest: state of every cell at the equilibrium, shape (variables,).
        omega: rad per model time.
        tau: a delay at which the block's roots cross, and n turns more.
        n: how many turns.

    """
    tau += 2.0 * np.pi * n / omega
    there = line.at(block.network, tau)
    return HopfPoint(there, line, tau, replace(block, network=there), omega, rest, n)

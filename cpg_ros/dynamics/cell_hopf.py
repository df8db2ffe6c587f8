"""Hopf points of the stand of the Morris-Lecar networks, with their normal forms.

On the centre manifold ``x = stand + z q + conj(z q) + ...`` with the eigenvector q of the class,
the same for every cell but for the character chi. The couplings are linear, so all terms beyond
the first act cell by cell: B(x, y) lies in the class chi_x chi_y, and the reduction needs the 2x2
blocks of the classes 1 and chi^2 only (Kuznetsov, *Elements of Applied Bifurcation Theory*,
eq. 5.62, with L_1 and L_chi^2 in place of the whole matrix)::

    k2 = <p, C(q, q, q*) - 2 B(q, L_1^-1 B(q, q*)) + B(q*, (2 i omega - L_chi^2)^-1 B(q, q))> / 2
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache
from itertools import pairwise

import numpy as np

from cpg_ros.dynamics.equilibrium import (
    NoStand,
    cell_jacobian,
    cell_rates,
    cell_terms,
    everywhere,
    stand,
)
from cpg_ros.dynamics.isotypic import Block, blocks, characters, rightmost_first
from cpg_ros.dynamics.normal_form import NormalForm
from cpg_ros.dynamics.sign_changes import crossings
from cpg_ros.errors import InputError
from cpg_ros.networks.biped import Biped
from cpg_ros.networks.parameter_line import ParameterLine
from cpg_ros.networks.quadruped import Quadruped

#: Values of the parameters at which the stand is looked at before the crossings are refined.
GRID = 241
#: Eigenvalues this close to the imaginary axis lie on it, 1/model time.
ON_AXIS = 1e-8
#: Radius and points of the circle on which the cell's functions are differentiated: they have
#: their poles pi/2 v4 away, 0.24 for the biped.
RADIUS, POINTS = 0.08, 48


@dataclass(frozen=True, eq=False)
class CellHopf:
    """A Hopf point of the stand.

    Attributes:
        block: the critical class's block, with its gait, mode and wave.
        along: the line on which it lies.
        value: of the parameters there.
        network: there.
        stand: (v, w) of every cell.
        omega: of the critical eigenvalue i omega, rad per model time, positive.
        vector: q of one cell, shape (2,); over the whole network <q, q> = 1 and <p, q> = 1.
        normal_form: in model time, mu = value' - value; z belongs to q.
        others: all eigenvalues but the critical pair, rightmost first, 1/model time.
        unstable_roots: how many of them have a positive real part.
        unstable_transverse_roots: how many of these lie outside the gait's Fix(K).

    """

    block: Block
    along: ParameterLine
    value: float
    network: Quadruped | Biped
    stand: np.ndarray
    omega: float
    vector: np.ndarray
    normal_form: NormalForm
    others: np.ndarray = field(repr=False)
    unstable_roots: int
    unstable_transverse_roots: int

    @property
    def gait(self) -> str:
        """The primary gait that branches off."""
        return self.block.gait

    @property
    def mode(self) -> tuple[int, int]:
        """The class (j, k), as in L_jk."""
        return self.block.mode

    @property
    def wave(self) -> str:
        """How the wave of walk and jump runs round the rings, as in the block."""
        return self.block.wave

    @property
    def direction(self) -> int:
        """1 where the critical pair moves to the right as the value grows, -1 to the left."""
        return 1 if self.normal_form.k1.real > 0.0 else -1

    @property
    def lyapunov(self) -> float:
        """First Lyapunov coefficient l1 = Re k2 / omega (Kuznetsov, eq. 3.20; <q, q> = 1)."""
        return self.normal_form.k2.real / self.omega

    @property
    def supercritical(self) -> bool:
        """Whether the orbits attract on the centre manifold, l1 < 0."""
        return self.normal_form.supercritical

    @property
    def simple(self) -> bool:
        """Whether no other eigenvalue lies on the imaginary axis."""
        return bool((np.abs(self.others.real) > ON_AXIS).all())

    @property
    def stable(self) -> bool:
        """Whether the bifurcation is stable in the sense of Buono & Golubitsky (section 4).

        Critical eigenvalues simple, all others to the left; the orbits attract if the
        bifurcation is supercritical as well.
        """
        return self.simple and self.unstable_roots == 0

    def amplitude(self, value: float) -> float:
        """Amplitude of every cell's v near onset, half its range, to first order: 2 |q_v| r.

        Raises:
            ValueError: the orbits lie on the other side.

        """
        return 2.0 * abs(self.vector[0]) * self.normal_form.radius(value - self.value)

    def period(self, value: float) -> float:
        """Period near onset in model time, to first order in value' - value.

        Raises:
            ValueError: the orbits lie on the other side.

        """
        return 2.0 * np.pi / (self.omega + self.normal_form.shift(value - self.value))

    def path(self, value: float, theta: np.ndarray) -> np.ndarray:
        """States near onset at times in cycles: ``stand + 2 Re(q z)``, shape (m, components).

        Raises:
            ValueError: the orbits lie on the other side.

        """
        network = self.along.at(self.network, value)
        turning = np.exp(2j * np.pi * (np.asarray(theta)[:, None] + self.block.symmetry.phases))
        swing = self.normal_form.radius(value - self.value) * np.concatenate(
            [entry * turning for entry in self.vector], axis=1)
        return everywhere(network, stand(network)) + 2.0 * swing.real


def cell_hopf_points(network: Quadruped | Biped, along: ParameterLine, low: float, high: float
                     ) -> list[CellHopf]:
    """Find all Hopf points of the stand between two values of parameters, by rising value.

    Values at which the network has no stand are passed over. Points closer to one another than
    (high - low)/240 are told apart only where a pair crosses twice in the same class.

    Args:
        network: the other parameters.
        along: the parameters that move.
        low: least value.
        high: largest value.

    Raises:
        NoStand: the stand exists nowhere on the way.
        ValueError: low is not below high, a parameter is not finite, or the weights have not
            the symmetry of the network.

    """
    if not (np.isfinite(low) and np.isfinite(high) and low < high):
        raise InputError(f'low {low} must be less than high {high}')

    kinds = characters(type(network))

    @cache
    def eigenvalues(value: float) -> np.ndarray:
        there = along.at(network, value)
        try:
            return np.array([block.eigenvalues for block in blocks(there, stand(there))])
        except NoStand:
            return np.full((len(kinds), 2), np.nan)

    grid = _with_edges([float(value) for value in np.linspace(low, high, GRID)],
                       lambda value: bool(np.isfinite(eigenvalues(value)).all()))
    sizes = np.array([eigenvalues(value).real for value in grid])
    if np.isnan(sizes).all():
        stand(along.at(network, low))
    found: list[tuple[float, float, tuple[int, int]]] = []
    for which, (_, mode, _) in enumerate(kinds):
        for rank in (0, 1):
            def real_part(value: float, at: tuple[int, int] = (which, rank)) -> float:
                return float(eigenvalues(value)[at].real)

            for value in crossings(real_part, np.array(grid), sizes[:, which, rank]):
                # Both eigenvalues of a block may cross together; each is met twice then.
                on_axis = [root.imag for root in eigenvalues(value)[which]
                           if abs(root.real) <= ON_AXIS and root.imag > ON_AXIS]
                found += [(value, omega, mode) for omega in on_axis
                          if not any(mode == other and np.allclose((value, omega), known)
                                     for *known, other in found)]
    return [hopf_at(along.at(network, value), along, mode, omega)
            for value, omega, mode in sorted(found)]


def _with_edges(grid: list[float], exists: Callable[[float], bool]) -> list[float]:
    """Add the last places before and the first ones after those where nothing exists."""
    whole = grid[:1]
    for left, right in pairwise(grid):
        if exists(left) != exists(right):
            inside, outside = (left, right) if exists(left) else (right, left)
            for _ in range(20):
                middle = 0.5 * (inside + outside)
                inside, outside = (middle, outside) if exists(middle) else (inside, middle)
            if left < inside < right:
                whole.append(inside)
        whole.append(right)
    return whole


def hopf_at(network: Quadruped | Biped, along: ParameterLine, mode: tuple[int, int], omega: float
            ) -> CellHopf:
    """Reduce to the normal form at a Hopf point that is known.

    Args:
        network: at the point.
        along: the parameters by which the pair crosses.
        mode: the critical class.
        omega: of the critical eigenvalue i omega, to tell it from the other one of its block.

    """
    state = stand(network)
    split = {block.mode: block for block in blocks(network, state)}
    block = split[mode]
    values, vectors = np.linalg.eig(block.matrix)
    which = int(np.abs(values - 1j * omega).argmin())
    omega = float(values[which].imag)
    # <q, q> = 1 over all cells; rows of the inverse are the left eigenvectors, <p, q> = 1.
    p = np.linalg.inv(vectors)[which]
    q = vectors[:, which] / np.linalg.norm(vectors[:, which])
    p = p / (p @ q)

    second, third = cell_derivatives(network, state)
    still = np.linalg.inv(cell_jacobian(network, state))
    twice = split[block.power(2)].matrix
    flat = -still @ second(q, q.conj())
    double = np.linalg.solve(2j * omega * np.eye(2) - twice, second(q, q))
    cubic = third(q, q, q.conj()) + 2.0 * second(q, flat) + second(q.conj(), double)
    # q of the whole network is 1/sqrt(cells) of this one in each cell.
    k2 = 0.5 * (p @ cubic) / network.cells

    # Rates are linear in the parameters of a line: a difference over 1 is a derivative.
    beyond = along.at(network, along.value(network) + 1.0)
    moves = -still @ (cell_rates(beyond, state) - cell_rates(network, state))
    directly = next(other for other in blocks(beyond, state) if other.mode == mode).matrix
    k1 = p @ ((directly - block.matrix) @ q + second(moves, q))

    others, unstable, transverse = [], 0, 0
    for other in split.values():
        rest = list(other.eigenvalues)
        for critical, owner in ((1j * omega, block), (-1j * omega, split[block.power(-1)])):
            if other is owner:
                rest.pop(int(np.abs(np.array(rest) - critical).argmin()))
        growing = int(sum(value.real > ON_AXIS for value in rest))
        others.extend(rest)
        unstable += growing
        transverse += 0 if other.within(block) else growing
    return CellHopf(block, along, along.value(network), network, state, omega,
                    q / np.sqrt(network.cells), NormalForm(complex(k1), complex(k2)),
                    rightmost_first(np.array(others)), unstable, transverse)


def cell_derivatives(network: Quadruped | Biped, state: np.ndarray):
    """Second and third derivatives of a cell's rates at (v, w) as multilinear functions B, C.

    The functions of v are analytic: Cauchy's integral over a circle gives their derivatives to
    rounding.
    """
    circle = np.exp(2j * np.pi * np.arange(POINTS) / POINTS)
    terms = cell_terms(network, state[0] + RADIUS * circle)
    d1, d2, d3 = ((terms @ circle**-n).real * scale / (POINTS * RADIUS**n)
                  for n, scale in ((1, 1.0), (2, 2.0), (3, 6.0)))
    free, by_w, w = slice(0, 4, 2), slice(1, 4, 2), state[1]
    vv, vw = d2[free] + d2[by_w] * w, d1[by_w]
    vvv, vvw = d3[free] + d3[by_w] * w, d2[by_w]

    def second(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return vv * x[0] * y[0] + vw * (x[0] * y[1] + x[1] * y[0])

    def third(x: np.ndarray, y: np.ndarray, z: np.ndarray) -> np.ndarray:
        return vvv * x[0] * y[0] * z[0] + vvw * (
            x[0] * y[0] * z[1] + x[0] * y[1] * z[0] + x[1] * y[0] * z[0])

    return second, third

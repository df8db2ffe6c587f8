"""Isotypic blocks of the linearisation at a stand: one 2x2 matrix for each symmetry class.

The cells are permuted by an abelian group, simply and transitively, so each of its characters
chi has the eigenvector (chi(cell)) once for v and once for w, and the linearisation J falls into
``L_chi = sum_i J_1i chi(i)`` (Buono & Golubitsky 2001, section 5.2). Oscillations of a class are
primary gaits: ``x_i ~ chi(i) exp(i omega t)``, so the character is the gait (Table 5).
"""

from dataclasses import dataclass
from fractions import Fraction
from functools import cache, cached_property

import numpy as np

from cpg_ros.dynamics.equilibrium import everywhere
from cpg_ros.errors import InputError
from cpg_ros.networks import biped, quadruped
from cpg_ros.networks.biped import Biped
from cpg_ros.networks.quadruped import Quadruped
from cpg_ros.networks.symmetry import D2, Z4_Z2, Symmetry


@dataclass(frozen=True, eq=False)
class Block:
    """The linearisation in a symmetry class.

    Attributes:
        gait: that oscillates in this class.
        mode: (j, k). Quadruped: shifts j/4 of omega and k/2 of kappa, as in L_jk of the paper.
            Biped: shifts j/2 of rho and k/2 of tau.
        symmetry: what the class's oscillation has, the shifts of the whole group.
        matrix: L_chi, complex, shape (2, 2), acting on (v, w).

    """

    gait: str
    mode: tuple[int, int]
    symmetry: Symmetry
    matrix: np.ndarray

    @property
    def name(self) -> str:
        """Name as in Buono & Golubitsky's Table 6, ``L_21``."""
        return f'L_{self.mode[0]}{self.mode[1]}'

    @property
    def real(self) -> bool:
        """Whether the class is its own conjugate: its eigenvalues are real or a pair."""
        return all(2 * shift % 1 == 0 for _, shift in self.symmetry.shifts)

    @property
    def wave(self) -> str:
        """How the wave of walk and jump runs round the rings: '' for the gaits that stand."""
        return '' if self.real else ('LF leads LH' if self.mode[0] == 1 else 'LH leads LF')

    @property
    def vector(self) -> np.ndarray:
        """The character's value for every cell, shape (cells,)."""
        return _values(self.symmetry)

    @cached_property
    def eigenvalues(self) -> np.ndarray:
        """Both eigenvalues, rightmost first, in 1/model time, shape (2,)."""
        matrix = self.matrix.real if self.real else self.matrix
        return rightmost_first(np.linalg.eigvals(matrix).astype(complex))

    @property
    def leading(self) -> complex:
        """The rightmost eigenvalue; of a conjugate pair that with positive imaginary part."""
        return complex(self.eigenvalues[0])

    def power(self, n: int) -> tuple[int, int]:
        """Mode of the class of the n-th power of the character; -1 for the conjugate."""
        orders = (4, 2) if self.symmetry.group is Z4_Z2 else (2, 2)
        return (n * self.mode[0] % orders[0], n * self.mode[1] % orders[1])

    def within(self, other: 'Block') -> bool:
        """Whether the class lies in the other's Fix(K): it keeps that gait's spatial symmetry."""
        return set(other.symmetry.k) <= set(self.symmetry.k)


def blocks(network: Quadruped | Biped, state: np.ndarray) -> tuple[Block, ...]:
    """Split the linearisation at a stand (v, w): 8 blocks of the quadruped, 4 of the biped.

    Raises:
        ValueError: weights differ that the network's symmetry carries into one another.

    """
    known = characters(type(network))
    if unequal := network.broken(known[0][0]):
        raise InputError(f'{unequal} differ: the network has not the symmetry of its gaits')
    whole = network.jacobian(everywhere(network, np.asarray(state, dtype=float)))
    row = whole.reshape(2, network.cells, 2, network.cells)[:, 0]
    return tuple(Block(gait, mode, symmetry, row @ _values(symmetry))
                 for gait, mode, symmetry in known)


@cache
def characters(network: type[Quadruped] | type[Biped]
               ) -> tuple[tuple[str, tuple[int, int], Symmetry], ...]:
    """All characters of the network's group: gait, (j, k), and the shifts of its elements."""
    if issubclass(network, Quadruped):
        group, orders = Z4_Z2, {'omega': 4, 'kappa': 2}
        gaits = {mode: gait for gait, mode in quadruped.GAITS.items()}
        gaits |= {(3, k): gaits[1, k] for k in (0, 1)}
    else:
        group, orders = D2, {'rho': 2, 'tau': 2}
        gaits = {(int(2 * biped.GAITS[gait]['rho']), int(2 * biped.GAITS[gait]['tau'])): gait
                 for gait in biped.PRIMARY}
    return tuple((gaits[mode], mode, Symmetry.of(group, {
        name: Fraction(power, order)
        for (name, order), power in zip(orders.items(), mode, strict=True)}))
        for mode in sorted(gaits))


def _values(symmetry: Symmetry) -> np.ndarray:
    """Values of a character for the cells: powers of i, without error of rounding."""
    return np.round(np.exp(2j * np.pi * symmetry.phases))


def rightmost_first(values: np.ndarray) -> np.ndarray:
    """Sort eigenvalues by falling real part, of a pair that with positive imaginary part first."""
    return values[np.lexsort((-values.imag, -np.round(values.real, 12)))]

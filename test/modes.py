"""The symmetry classes (j, k) of the delayed network, as Liu & Zhang (2024) number them."""

from fractions import Fraction

import numpy as np

from cpg_ros.networks.symmetry import Z4_Z2, Symmetry


def Mode(j, k):
    """Shifts j/4 of omega and k/2 of kappa, of one variable a cell, odd."""
    return Symmetry.of(Z4_Z2, {'omega': Fraction(j, 4), 'kappa': Fraction(k, 2)}, variables=1,
                       odd=True)


MODES = tuple(Mode(j, k) for j in range(4) for k in range(2))


def class_of(symmetry):
    """(j, k) of a symmetry."""
    shifts = dict(symmetry.shifts)
    return int(4 * shifts['omega']), int(2 * shifts['kappa'])


def eigenvalue_terms(network, symmetry):
    """A and B of ``lambda = A + B exp(-lambda tau)``, from the paper's formulas."""
    j, k = class_of(symmetry)
    return (network.a + network.b + network.d * (1, -1j, -1, 1j)[j],
            network.c * (-1) ** k)


def eigenvector(symmetry):
    """(1, (-1)^k, i^j, ...), shape (8,)."""
    return np.exp(2j * np.pi * symmetry.phases)

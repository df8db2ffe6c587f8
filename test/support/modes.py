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

"""The symmetry classes (j, k) of the delayed network, as Liu & Zhang (2024) number them."""

from fractions import Fraction

from cpg_ros.networks.symmetry import Symmetry, Z4_Z2
import numpy as np


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
    """Return A and B of ``lambda = A + B exp(-lambda tau)``, from the paper's formulas."""
    j, k = class_of(symmetry)
    return (network.a + network.b + network.d * (1, -1j, -1, 1j)[j],
            network.c * (-1) ** k)


def eigenvector(symmetry):
    """(1, (-1)^k, i^j, ...), shape (8,)."""
    return np.exp(2j * np.pi * symmetry.phases)

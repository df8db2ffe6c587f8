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

"""Eigenvalues of a product of many matrices, each to its own size.

Floquet multipliers of one orbit span thirty orders of magnitude, and a product of matrices keeps
those only that are not small against the largest. So the product is never formed: orthonormal
columns go round through the factors, ``F_k Q_k = Q_(k+1) R_k``, until they come back to the same
spaces. The factors are upper triangular in these columns, and eigenvalues are products of the
diagonals: the periodic Schur decomposition (Bojanczyk, Golub & Van Dooren 1992), by orthogonal
iteration. Those of about one size stay together in a block.
"""

from itertools import pairwise

from cpg_ros.integration.jit import COMPILED, entry
import numpy as np

#: Two spaces this close are one.
SAME = 1e-13
#: Eigenvalues of a block may differ by this factor in size: what is left to rounding then.
ALIKE = 1e4
#: Times that the columns go round at most.
ROUNDS = 40


@entry
def _round(factors, columns, whole):
    """Take the columns through all factors; whole becomes the product of what is triangular.

    Gram and Schmidt's method twice over, which loses no orthogonality.
    """
    d = columns.shape[0]
    moved = np.empty((d, d))
    upper = np.empty((d, d))
    before = np.empty((d, d))
    for k in range(factors.shape[0]):
        for j in range(d):
            for i in range(d):
                total = 0.0
                for middle in range(d):
                    total += factors[k, i, middle] * columns[middle, j]
                moved[i, j] = total
        upper[:] = 0.0
        for j in range(d):
            for _ in range(2):
                for one in range(j):
                    along = 0.0
                    for i in range(d):
                        along += moved[i, one] * moved[i, j]
                    upper[one, j] += along
                    for i in range(d):
                        moved[i, j] -= along * moved[i, one]
            size = 0.0
            for i in range(d):
                size += moved[i, j]**2
            size = np.sqrt(size)
            upper[j, j] = size
            for i in range(d):
                moved[i, j] /= size
        columns[:] = moved
        before[:] = whole
        for i in range(d):
            for j in range(i, d):
                total = 0.0
                for middle in range(i, j + 1):
                    total += upper[i, middle] * before[middle, j]
                whole[i, j] = total


def _round_by_lapack(factors: np.ndarray, columns: np.ndarray, whole: np.ndarray) -> None:
    """Do what _round does, where numba is missing."""
    for factor in factors:
        columns[:], upper = np.linalg.qr(factor @ columns)
        signs = np.sign(np.diag(upper))
        columns *= signs
        whole[:] = signs[:, np.newaxis] * upper @ whole


def eigenvalues(factors: np.ndarray) -> np.ndarray:
    """Return the eigenvalues of ``F_n ... F_2 F_1``.

    Args:
        factors: F_1, F_2 ..., shape (n, d, d).

    Returns:
        Complex numbers, shape (d,); not a number where they leave the range of numbers.

    """
    factors, d = np.ascontiguousarray(factors), factors.shape[-1]
    # Any columns do that lie in no space of their own.
    columns = np.linalg.qr(np.random.default_rng(0).normal(size=(d, d)))[0]
    for _ in range(ROUNDS):
        start, whole = columns.copy(), np.eye(d)
        (_round if COMPILED else _round_by_lapack)(factors, columns, whole)
        back = start.T @ columns
        if not np.isfinite(back).all():
            return np.full(d, np.nan, dtype=complex)
        cuts = [0, *(k for k in range(1, d) if np.abs(back[k:, :k]).max() <= SAME), d]
        parts = [slice(*ends) for ends in pairwise(cuts)]
        sizes = [np.abs(np.diag(whole)[part]) for part in parts]
        if all(size.max() <= ALIKE * size.min() for size in sizes):
            break
    return np.concatenate([
        np.linalg.eigvals(back[part, part] @ whole[part, part]).astype(complex)
        for part in parts])

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

"""The compiled part of collocation: every interval's linear equations, and their chain.

They are small and many. Gaussian elimination written out, with the right-hand sides as further
columns, takes a fraction of the time of a call of LAPACK for each. Where numba is missing it is
LAPACK nevertheless.
"""

from cpg_ros.dynamics.mesh import collocation
from cpg_ros.integration.jit import COMPILED, entry
import numpy as np


@entry
def _solved(a, lengths, jacobians, sources, answers):
    """Fill answers as transfer has them; tell whether no pivot vanished."""
    n, s, d = jacobians.shape[:3]
    k = sources.shape[3]
    size = s * d
    width = size + d + k
    work = np.empty((size, width))
    inverse = np.empty(size)
    for i in range(n):
        for p in range(s):
            for row in range(d):
                line = work[p * d + row]
                for q in range(s):
                    factor = -lengths[i] * a[p, q]
                    for c in range(d):
                        line[q * d + c] = factor * jacobians[i, q, row, c]
                line[p * d + row] += 1.0
                for c in range(d):
                    line[size + c] = 0.0
                line[size + row] = 1.0
                for c in range(k):
                    line[size + d + c] = sources[i, p, row, c]
        for column in range(size):
            best = column
            for row in range(column + 1, size):
                if abs(work[row, column]) > abs(work[best, column]):
                    best = row
            # The comparison is false for NaN, too.
            if not abs(work[best, column]) > 0.0:
                return False
            if best != column:
                for c in range(column, width):
                    work[column, c], work[best, c] = work[best, c], work[column, c]
            inverse[column] = 1.0 / work[column, column]
            above = work[column, column + 1:]
            for row in range(column + 1, size):
                factor = work[row, column] * inverse[column]
                line = work[row, column + 1:]
                for c in range(width - column - 1):
                    line[c] -= factor * above[c]
        for column in range(size - 1, -1, -1):
            above = work[column, size:]
            for c in range(d + k):
                above[c] *= inverse[column]
            for row in range(column):
                factor = work[row, column]
                line = work[row, size:]
                for c in range(d + k):
                    line[c] -= factor * above[c]
        for p in range(s):
            for row in range(d):
                for c in range(d + k):
                    answers[i, p, row, c] = work[p * d + row, size + c]
    return True


@entry
def _summed(weights, lengths, jacobians, answers, steps):
    """Add to steps what summed returns."""
    n, s, d = jacobians.shape[:3]
    for i in range(n):
        for p in range(s):
            for row in range(d):
                for middle in range(d):
                    factor = lengths[i] * weights[p] * jacobians[i, p, row, middle]
                    for c in range(answers.shape[3]):
                        steps[i, row, c] += factor * answers[i, p, middle, c]


@entry
def _chained(steps, reached):
    """Fill reached from its first row on."""
    n, d, width = steps.shape
    for i in range(n):
        for row in range(d):
            for c in range(width):
                reached[i + 1, row, c] = steps[i, row, c] if c >= d else 0.0
            for middle in range(d):
                factor = steps[i, row, middle]
                for c in range(width):
                    reached[i + 1, row, c] += factor * reached[i, middle, c]


def transfer(jacobians: np.ndarray, lengths: np.ndarray, sources: np.ndarray) -> np.ndarray:
    """Solve the linear problem of every interval: ``dY = 1 dy + L h A J dY + g``.

    Args:
        jacobians: of the rates at the nodes, shape (n, S, d, d).
        lengths: of the intervals in model time, shape (n,).
        sources: g at the nodes for k right-hand sides, shape (n, S, d, k).

    Returns:
        Nodes' answer to dy, then to the sources, shape (n, S, d, d + k).

    Raises:
        LinAlgError: an interval's equations are singular.

    """
    n, s, d = jacobians.shape[:3]
    if not COMPILED:
        matrices = np.eye(s * d) - np.einsum('i,pq,iqrc->iprqc', lengths, collocation.A, jacobians
                                             ).reshape(n, s * d, s * d)
        ones = np.broadcast_to(np.tile(np.eye(d), (s, 1)), (n, s * d, d))
        sides = np.concatenate([ones, sources.reshape(n, s * d, -1)], axis=2)
        return np.linalg.solve(matrices, sides).reshape(n, s, d, -1)
    answers = np.empty((n, s, d, d + sources.shape[-1]))
    if not _solved(collocation.A, lengths, np.ascontiguousarray(jacobians),
                   np.ascontiguousarray(sources), answers):
        raise np.linalg.LinAlgError('an interval is singular')
    return answers


def summed(jacobians: np.ndarray, lengths: np.ndarray, answers: np.ndarray) -> np.ndarray:
    """Integrate ``J dY`` over every interval, dY the answers at the nodes, (n, d, k)."""
    if not COMPILED:
        weights = np.multiply.outer(lengths, collocation.WEIGHTS)[..., None, None]
        return (weights * jacobians @ answers).sum(axis=1)
    steps = np.zeros((jacobians.shape[0], jacobians.shape[2], answers.shape[-1]))
    _summed(collocation.WEIGHTS, lengths, np.ascontiguousarray(jacobians), answers, steps)
    return steps


def chained(steps: np.ndarray) -> np.ndarray:
    """Return what is reached at the mesh points, from (1, 0) on, shape (n + 1, d, d + k).

    Args:
        steps: of the intervals, ``y -> steps[:, :d] y + steps[:, d:]``, shape (n, d, d + k).

    """
    n, d, width = steps.shape
    reached = np.zeros((n + 1, d, width))
    reached[0, :, :d] = np.eye(d)
    if COMPILED:
        _chained(steps, reached)
        return reached
    for i in range(n):
        reached[i + 1] = steps[i, :, :d] @ reached[i]
        reached[i + 1, :, d:] += steps[i, :, d:]
    return reached

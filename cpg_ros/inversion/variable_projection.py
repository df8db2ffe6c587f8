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

"""The linear readout of joints and its elimination from a fit: variable projection.

A joint is ``offset + sum_k w_k psi_k(x, y)``, psi = x, y, x^2, x y, x^3, x^2 y up to the order
(docs/theory.md, section Readout). Whatever the network's parameters, the best offset and weights
are a linear least-squares problem; put in place they leave a residual of the network's parameters
alone. Its exact derivative is Golub & Pereyra's (1973).
"""

from cpg_ros.motion.joint_polynomial import monomials
import numpy as np

#: Weights of each readout order.
WEIGHTS = {1: 2, 2: 4, 3: 6}


def basis(order: int, x: np.ndarray, y: np.ndarray, z: np.ndarray
          ) -> tuple[np.ndarray, np.ndarray]:
    """Return 1 and the monomials of an order, and their derivatives by phase in cycles.

    Args:
        order: 1 to 3.
        x: signal, any shape.
        y: its derivative by phase in radians.
        z: the second one.

    Returns:
        Two arrays of shape (..., 1 + weights).

    """
    values, by_phase = monomials(x, y, z)
    count = WEIGHTS[order]
    return (np.stack([np.ones_like(x), *values[:count]], axis=-1),
            np.stack([np.zeros_like(x), *by_phase[:count]], axis=-1))


def basis_moved(order: int, x: np.ndarray, y: np.ndarray, slopes: np.ndarray) -> np.ndarray:
    """Return the derivatives of 1 and the monomials, shape (m, 1 + weights, numbers).

    Args:
        order: 1 to 3.
        x: signal, shape (m,).
        y: its derivative by phase in radians.
        slopes: derivatives of x and y by some numbers, shape (2, m, numbers).

    """
    one, zero = np.ones_like(x), np.zeros_like(x)
    by_x = np.stack([zero, one, zero, 2.0 * x, y, 3.0 * x * x, 2.0 * x * y], axis=1)
    by_y = np.stack([zero, zero, one, zero, x, zero, x * x], axis=1)
    count = 1 + WEIGHTS[order]
    return (by_x[:, :count, None] * slopes[0][:, None]
            + by_y[:, :count, None] * slopes[1][:, None])


def project(psi: np.ndarray, moved: np.ndarray, data: np.ndarray
            ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Fit a basis to joints and differentiate the residual.

    Args:
        psi: basis, shape (m, n).
        moved: its derivatives, shape (m, n, variables).
        data: of the joints, shape (m, joints).

    Returns:
        Offset and weights of each joint, shape (n, joints); the residual, fitted minus recorded,
        (m, joints); and its derivative, the readout staying the best, (m, joints, variables).

    Raises:
        numpy.linalg.LinAlgError: the basis is not independent.

    """
    q, r = np.linalg.qr(psi)
    weights = np.linalg.solve(r, q.T @ data)
    left = psi @ weights - data
    along = np.einsum('mnv,nj->mjv', moved, weights)
    along -= np.tensordot(q, np.tensordot(q, along, (0, 0)), (1, 0))
    pulled = np.einsum('mnv,mj->njv', moved, left)
    pulled = np.linalg.solve(r.T, pulled.reshape(len(r), -1))
    # The second part vanishes with the residual: it is what Kaufman (1975) leaves out.
    return weights, left, along - (q @ pulled).reshape(along.shape)

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

"""Gauss collocation on a mesh: polynomials of degree S on each interval, exact at its S nodes.

The implicit Runge-Kutta method of order 2 S at the mesh points (Hairer, Norsett & Wanner,
*Solving Ordinary Differential Equations I*, II.7), as in AUTO and COLSYS: intervals follow the
solution, so that a relaxation oscillation costs no more than a sinusoid.
"""

import numpy as np
from numpy.polynomial import legendre, polynomial

#: Nodes of an interval.
S = 8
#: Least density of a mesh, over the mean.
FLOOR = 0.2

_X, _W = legendre.leggauss(S)
#: Places of the nodes in an interval [0, 1], weights, and the integration matrix A.
NODES, WEIGHTS = 0.5 * (_X + 1.0), 0.5 * _W


def _lagrange() -> np.ndarray:
    """Power coefficients of the Lagrange polynomials at the nodes, shape (S, S)."""
    rows = []
    for k in range(S):
        others = np.delete(NODES, k)
        rows.append(polynomial.polyfromroots(others) / np.prod(NODES[k] - others))
    return np.array(rows)


_LAGRANGE = _lagrange()
#: Power coefficients of their integrals from 0, shape (S, S + 1).
INTEGRALS = np.hstack([np.zeros((S, 1)), _LAGRANGE / np.arange(1, S + 1)])
A = polynomial.polyval(NODES, INTEGRALS.T).T
#: From values at the nodes to the coefficients of the Legendre polynomials.
LEGENDRE = np.linalg.inv(legendre.legvander(_X, S - 1))


def power_coefficients(left: np.ndarray, slopes: np.ndarray, lengths: np.ndarray) -> np.ndarray:
    """Coefficients of the collocation polynomials in the place on each interval, 0 to 1.

    Args:
        left: values where the intervals start, shape (n, d).
        slopes: derivatives at the nodes, shape (n, S, d).
        lengths: of the intervals, shape (n,).

    Returns:
        An array of shape (S + 1, n, d).

    """
    coefficients = lengths[:, None] * np.einsum('sq,nsd->qnd', INTEGRALS, slopes)
    coefficients[0] += left
    return coefficients


def last_share(slopes: np.ndarray) -> np.ndarray:
    """Size of the last Legendre coefficient of each interval, shape (n,)."""
    return np.abs(np.einsum('s,nsd->nd', LEGENDRE[-1], slopes)).max(axis=1)


def spread(mesh: np.ndarray, density: np.ndarray, n: int) -> np.ndarray:
    """Return a mesh of n intervals that share the integral of a density equally.

    Args:
        mesh: places from 0 to 1, shape (m + 1,).
        density: on each of its intervals, shape (m,).
        n: intervals of the new mesh.

    """
    # A floor, and neighbours smoothed: no interval may be far longer than the next one. The floor
    # is a share of the mean, so that a long rest before a short jump takes few of the intervals.
    density = np.maximum(density, FLOOR * (density * np.diff(mesh)).sum())
    for _ in range(2):
        padded = np.concatenate([density[-1:], density, density[:1]])
        density = np.maximum(density, 0.5 * np.maximum(padded[:-2], padded[2:]))
    total = np.concatenate([[0.0], np.cumsum(density * np.diff(mesh))])
    new = np.interp(np.linspace(0.0, total[-1], n + 1), total, mesh)
    new[0], new[-1] = 0.0, 1.0
    return new

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

"""Compiled part of collocation: the linear equations of every interval, and their chain.

They are small and many. Gaussian elimination in C (``c/mesh.c``), with the right-hand sides as
further columns, takes a fraction of the time of one LAPACK call each.
"""

import ctypes
from functools import cache

from cpg_ros.common.c_library import load
from cpg_ros.dynamics.integration.c_kernel import version
from cpg_ros.dynamics.integration.c_text import part
from cpg_ros.networks import equations as generated
import numpy as np
from numpy.polynomial import legendre, polynomial

#: Nodes of an interval.
S = 8
#: Of a mesh, over the mean.
MIN_DENSITY = 0.2

_X, _W = legendre.leggauss(S)
#: NODES: places of the nodes in an interval [0, 1]; WEIGHTS: their Gauss weights.
NODES, WEIGHTS = 0.5 * (_X + 1.0), 0.5 * _W


def _lagrange() -> np.ndarray:
    """Return the power coefficients of the Lagrange polynomials at the nodes, shape (S, S)."""
    rows = []
    for k in range(S):
        others = np.delete(NODES, k)
        rows.append(polynomial.polyfromroots(others) / np.prod(NODES[k] - others))
    return np.array(rows)


_LAGRANGE = _lagrange()
#: Power coefficients of their integrals from 0, shape (S, S + 1).
INTEGRALS = np.hstack([np.zeros((S, 1)), _LAGRANGE / np.arange(1, S + 1)])
A = polynomial.polyval(NODES, INTEGRALS.T).T
#: LEGENDRE: matrix from values at the nodes to coefficients of the Legendre polynomials.
LEGENDRE = np.linalg.inv(legendre.legvander(_X, S - 1))


def power_coefficients(left: np.ndarray, slopes: np.ndarray, lengths: np.ndarray) -> np.ndarray:
    """Return the coefficients of the collocation polynomials over the interval, 0 to 1.

    Args:
        left: values at the starts of the intervals, shape (n, d).
        slopes: derivatives at the nodes, shape (n, S, d).
        lengths: of the intervals, shape (n,).

    Returns:
        Coefficients of shape (S + 1, n, d).

    """
    coefficients = lengths[:, None] * np.einsum('sq,nsd->qnd', INTEGRALS, slopes)
    coefficients[0] += left
    return coefficients


def last_fraction(slopes: np.ndarray) -> np.ndarray:
    """Return the size of the last Legendre coefficient of each interval, shape (n,)."""
    return np.abs(np.einsum('s,nsd->nd', LEGENDRE[-1], slopes)).max(axis=1)


def spread(mesh: np.ndarray, density: np.ndarray, n: int) -> np.ndarray:
    """Return a mesh of n intervals that share the integral of a density equally.

    Args:
        mesh: places from 0 to 1, shape (m + 1,).
        density: on each of its intervals, shape (m,).
        n: intervals of the new mesh.

    """
    # No interval may be far longer than its neighbours. The floor is a fraction of the mean, so
    # that a long rest before a short jump takes few intervals.
    density = np.maximum(density, MIN_DENSITY * (density * np.diff(mesh)).sum())
    for _ in range(2):
        padded = np.concatenate([density[-1:], density, density[:1]])
        density = np.maximum(density, 0.5 * np.maximum(padded[:-2], padded[2:]))
    total = np.concatenate([[0.0], np.cumsum(density * np.diff(mesh))])
    new = np.interp(np.linspace(0.0, total[-1], n + 1), total, mesh)
    new[0], new[-1] = 0.0, 1.0
    return new


# Meshes with ends at the kinks of the rates, which keep the order of the collocation.

#: Positions in an interval between which changes of sign are searched.
POSITIONS = np.linspace(0.0, 1.0, 9)
#: Distance between a kink and an end on it.
KINK_TOLERANCE = 1e-13
#: Distance below which an end moves onto a kink, over the shorter interval beside it.
SNAP_RATIO = 0.4


def sign_changes(mesh: np.ndarray, coefficients: np.ndarray) -> np.ndarray:
    """Return the places, 0 to 1, at which variables change sign, rising.

    Args:
        mesh: ends of the intervals, shape (n + 1,).
        coefficients: of the variables' polynomials on each, shape (S + 1, n, variables).

    """
    values = polynomial.polyval(POSITIONS[:, None, None], coefficients[:, None], tensor=False)
    begin, interval, variable = np.nonzero(values[:-1] * values[1:] < 0.0)
    low, high = POSITIONS[begin], POSITIONS[begin + 1]
    terms = coefficients[:, interval, variable]
    rising = values[begin + 1, interval, variable] > 0.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        above = (polynomial.polyval(middle, terms, tensor=False) > 0.0) == rising
        low, high = np.where(above, low, middle), np.where(above, middle, high)
    positions = np.sort(mesh[interval] + 0.5 * (low + high) * np.diff(mesh)[interval])
    # Cells that are in phase, and ends that a kink lies on, are met twice.
    return positions[np.diff(positions, prepend=-1.0) > 1e-9]


def aligned(mesh: np.ndarray, kinks: np.ndarray) -> np.ndarray | None:
    """Return a mesh with an end on each kink, or None if it has one there.

    Args:
        mesh: ends of the intervals, from 0 to 1, shape (n + 1,).
        kinks: their places, rising, shape (m,).

    """
    gaps = np.abs(mesh[:, None] - kinks).min(axis=0) if kinks.size else np.zeros(0)
    if not (gaps > KINK_TOLERANCE).any():
        return None
    fixed = [0.0, 1.0, *(kink for kink in kinks if KINK_TOLERANCE < kink < 1.0 - KINK_TOLERANCE)]
    free = [end for k, end in enumerate(mesh[1:-1], 1) if not any(
        abs(end - kink) < SNAP_RATIO * min(end - mesh[k - 1], mesh[k + 1] - end)
        for kink in fixed)]
    return np.array(sorted({*fixed, *free}))


@cache
def solver() -> ctypes.CDLL:
    """Return the functions of ``c/mesh.c``.

    Raises:
        NoCompiler: they are not in the cache, and there is no C compiler, or it fails.

    """
    library = load(generated.folder(), f'mesh-{version()}', lambda: {'mesh.c': part('mesh.c')},
                   'the solver of orbits')
    whole, array = ctypes.c_int, ctypes.c_void_p
    library.mesh_transfer.argtypes = *[whole] * 4, *[array] * 6
    library.mesh_sum.argtypes = *[whole] * 4, *[array] * 5
    library.mesh_chain.argtypes = *[whole] * 3, *[array] * 2
    library.mesh_round.argtypes = *[whole] * 2, *[array] * 4
    return library


def addresses(*arrays: np.ndarray) -> list[int]:
    """Return the addresses of arrays, all C-contiguous floats."""
    assert all(array.flags.c_contiguous and array.dtype == float for array in arrays)
    return [array.ctypes.data for array in arrays]


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
    n, s, d, k = sources.shape
    answers, work = np.empty((n, s, d, d + k)), np.empty((s * d, s * d + d + k))
    arrays = [np.ascontiguousarray(array) for array in (A, lengths, jacobians, sources)]
    if not solver().mesh_transfer(n, s, d, k, *addresses(*arrays, work, answers)):
        raise np.linalg.LinAlgError('an interval is singular')
    return answers


def summed(jacobians: np.ndarray, lengths: np.ndarray, answers: np.ndarray) -> np.ndarray:
    """Integrate ``J dY`` over every interval, dY the answers at the nodes, (n, d, k)."""
    n, s, d, k = answers.shape
    steps = np.zeros((n, d, k))
    arrays = [np.ascontiguousarray(array) for array in (lengths, jacobians, answers)]
    solver().mesh_sum(n, s, d, k, *addresses(WEIGHTS, *arrays, steps))
    return steps


def chained(steps: np.ndarray) -> np.ndarray:
    """Return the propagated columns at the mesh points, from (1, 0), shape (n + 1, d, d + k).

    Args:
        steps: of the intervals, ``y -> steps[:, :d] y + steps[:, d:]``, shape (n, d, d + k).

    """
    n, d, width = steps.shape
    reached = np.zeros((n + 1, d, width))
    reached[0, :, :d] = np.eye(d)
    steps = np.ascontiguousarray(steps)
    solver().mesh_chain(n, d, width, *addresses(steps, reached))
    return reached

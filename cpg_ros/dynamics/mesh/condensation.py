"""What the end of an interval is of its beginning, linearised: its inner values eliminated.

On every interval ``dY = 1 dy + L h A J dY + g`` holds at the nodes, and ``dy' = dy + L h w J dY +
e`` at its end. Gaits have few components once their symmetry is made use of, so these are many
small systems: a compiled elimination is several times as fast as a library's, which is used where
they are large.
"""

import numpy as np

from cpg_ros.dynamics.mesh import collocation
from cpg_ros.integration.jit import entry

#: Components up to which the compiled elimination is the faster one.
SMALL = 8


@entry
def _eliminated(collocate, jacobians, lengths, sources, answers):
    """Fill the answers by Gauss's elimination; tell whether no interval is singular."""
    n, s, d, _ = jacobians.shape
    size, extra = s * d, sources.shape[3]
    width = size + d + extra
    rows, top = np.empty((size, width)), np.empty(width)
    for k in range(n):
        for a in range(s):
            for i in range(d):
                at = a * d + i
                for b in range(s):
                    scale = -collocate[a, b] * lengths[k]
                    for j in range(d):
                        rows[at, b * d + j] = scale * jacobians[k, b, i, j]
                rows[at, at] += 1.0
                for j in range(d):
                    rows[at, size + j] = 1.0 if i == j else 0.0
                for j in range(extra):
                    rows[at, size + d + j] = sources[k, a, i, j]
        for c in range(size):
            best, largest = c, abs(rows[c, c])
            for r in range(c + 1, size):
                if abs(rows[r, c]) > largest:
                    best, largest = r, abs(rows[r, c])
            # A number it must be, too.
            if not largest > 0.0:
                return False
            inverse = 1.0 / rows[best, c]
            for j in range(c, width):
                value = rows[best, j]
                rows[best, j] = rows[c, j]
                rows[c, j] = top[j] = value * inverse
            for r in range(c + 1, size):
                share = rows[r, c]
                # From 0: loops of one length are vectorised, and what is left of c is not used.
                for j in range(width):
                    rows[r, j] -= share * top[j]
        for c in range(size - 1, -1, -1):
            for j in range(d + extra):
                answers[k, c, j] = rows[c, size + j]
            for r in range(c):
                share = rows[r, c]
                for j in range(d + extra):
                    rows[r, size + j] -= share * answers[k, c, j]
    return True


def transfer(jacobians: np.ndarray, lengths: np.ndarray, sources: np.ndarray) -> np.ndarray:
    """Solve the linear problem of every interval for its nodes.

    Args:
        jacobians: of the rates at the nodes, shape (n, S, d, d).
        lengths: of the intervals in model time, shape (n,).
        sources: g at the nodes for k right-hand sides, shape (n, S, d, k).

    Returns:
        Nodes' answer to dy, then to the sources, shape (n, S, d, d + k).

    Raises:
        numpy.linalg.LinAlgError: an interval's equations are singular.

    """
    n, s, d = jacobians.shape[:3]
    if d <= SMALL:
        answers = np.empty((n, s * d, d + sources.shape[-1]))
        if not _eliminated(collocation.A, np.ascontiguousarray(jacobians), lengths,
                           np.ascontiguousarray(sources), answers):
            raise np.linalg.LinAlgError('the equations of an interval are singular')
        return answers.reshape(n, s, d, -1)
    matrix = np.empty((n, s, d, s, d))
    np.multiply(-collocation.A[:, None, :, None],
                (lengths[:, None, None, None] * jacobians).transpose(0, 2, 1, 3)[:, None],
                out=matrix)
    whole = matrix.reshape(n, s * d, s * d)
    whole[:, np.arange(s * d), np.arange(s * d)] += 1.0
    right = np.empty((n, s, d, d + sources.shape[-1]))
    right[..., :d], right[..., d:] = np.eye(d), sources
    return np.linalg.solve(whole, right.reshape(n, s * d, -1)).reshape(right.shape)


def summed(jacobians: np.ndarray, lengths: np.ndarray, answers: np.ndarray) -> np.ndarray:
    """Integrate ``J dY`` over every interval, dY the answers at the nodes, (n, d, k)."""
    n, s, d = jacobians.shape[:3]
    weighted = lengths[:, None, None, None] * collocation.WEIGHTS[:, None] * jacobians.transpose(
        0, 2, 1, 3)
    return weighted.reshape(n, d, s * d) @ answers.reshape(n, s * d, -1)


@entry
def _chained(steps, reached):
    n, d, width = steps.shape
    for k in range(n):
        for i in range(d):
            for j in range(width):
                reached[k + 1, i, j] = steps[k, i, j] if j >= d else 0.0
            for m in range(d):
                share = steps[k, i, m]
                for j in range(width):
                    reached[k + 1, i, j] += share * reached[k, m, j]


def chained(steps: np.ndarray) -> np.ndarray:
    """Put intervals one behind the other.

    Args:
        steps: the end of each by its beginning and by k sources, shape (n, d, d + k).

    Returns:
        Mesh points by the first one and by the sources, shape (n + 1, d, d + k).

    """
    n, d, width = steps.shape
    reached = np.zeros((n + 1, d, width))
    reached[0, :, :d] = np.eye(d)
    _chained(np.ascontiguousarray(steps), reached)
    return reached

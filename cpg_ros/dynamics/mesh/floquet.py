"""Floquet multipliers of the gaits of networks without delay.

A gait lies in Fix(K), K its spatial symmetries. Along it the linearised flow keeps Fix(K) and its
orthogonal complement apart, so the multipliers split: those within the class, 1 among them, and
those transverse to it. The symmetry lock -g (I - P) x adds -g on the complement and nothing else:
it multiplies the transverse multipliers by exp(-g T) exactly.
"""

from functools import lru_cache

import numpy as np

from cpg_ros.dynamics.isotypic_split import split
from cpg_ros.dynamics.mesh.condensation import summed, transfer
from cpg_ros.dynamics.mesh.newton import Reduced
from cpg_ros.dynamics.mesh.orbit import MeshOrbit


def within(orbit: MeshOrbit) -> np.ndarray:
    """Return the multipliers within the gait's class, 1 among them."""
    return multipliers(orbit)[0]


def transverse(orbit: MeshOrbit, gain: float = 0.0) -> np.ndarray:
    """Return the multipliers transverse to the gait's class, with a symmetry lock."""
    found: np.ndarray = multipliers(orbit)[1] * np.exp(-gain * orbit.period)
    return found


@lru_cache(maxsize=4)
def multipliers(orbit: MeshOrbit) -> tuple[np.ndarray, np.ndarray]:
    """Return the multipliers within the class and transverse to it, without a lock.

    They come from the variational equation, by the orbit's own collocation.
    """
    symmetry, network = orbit.symmetry, orbit.network
    states = orbit.stages[..., Reduced(network, symmetry).place]
    jacobians = network.jacobian(states)
    lengths = np.diff(orbit.mesh) * orbit.period / symmetry.order
    blocks = np.arange(network.variables)[:, None] * network.cells
    turn = np.eye(network.components)[(symmetry.turn + blocks).ravel()]
    found = []
    inside, outside = split(symmetry)
    for columns in (inside, *outside):
        step = _propagated(columns.T @ jacobians @ columns, lengths)
        # After T/m the cells have changed places; m of these make a period. After m changes a
        # cell is another one of its class, which only matters outside Fix(K).
        change, m = columns.T @ turn @ columns, symmetry.order
        found.append(np.linalg.eigvals(np.linalg.matrix_power(change, m)
                                       @ np.linalg.matrix_power(change.T @ step, m)))
    return found[0], np.concatenate([np.zeros(0, dtype=complex), *found[1:]])


def _propagated(jacobians: np.ndarray, lengths: np.ndarray) -> np.ndarray:
    """Solution of the linear equation over all intervals, shape (d, d)."""
    d = jacobians.shape[-1]
    answers = transfer(jacobians, lengths, np.zeros((*jacobians.shape[:3], 0)))
    steps = np.eye(d) + summed(jacobians, lengths, answers)
    whole = np.eye(d)
    for step in steps:
        whole = step @ whole
    return whole

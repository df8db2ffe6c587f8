"""Floquet multipliers of the gaits of networks without delay.

A gait lies in Fix(K), K its spatial symmetries. Along it the linearised flow keeps Fix(K) and its
orthogonal complement apart, so the multipliers split: those within the class, 1 among them, and
those transverse to it. The symmetry lock -g (I - P) x adds -g on the complement and nothing else:
it multiplies the transverse multipliers by exp(-g T) exactly.
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import null_space

from cpg_ros.dynamics.gauss import WEIGHTS
from cpg_ros.dynamics.mesh_newton import transfer
from cpg_ros.dynamics.mesh_orbit import MeshOrbit


@dataclass(frozen=True)
class Multipliers:
    """Floquet multipliers of an orbit over a period, largest first, without symmetry lock.

    Attributes:
        period: T in model time.
        within: in Fix(K), without the trivial one.
        transverse: outside Fix(K).
        trivial: the one along the orbit, 1 but for the error of the computation.

    """

    period: float
    within: np.ndarray
    transverse: np.ndarray
    trivial: complex

    def leading(self, gain: float = 0.0) -> float:
        """Modulus of the largest but the trivial one, under a symmetry lock (1/model time)."""
        sizes = [float(np.abs(part).max(initial=0.0)) for part in (self.within, self.transverse)]
        return max(sizes[0], sizes[1] * float(np.exp(-gain * self.period)))

    @property
    def gain(self) -> float:
        """Symmetry gain above which every transverse disturbance decays, 1/model time."""
        largest = float(np.abs(self.transverse).max(initial=0.0))
        return max(0.0, float(np.log(largest)) / self.period) if largest > 0.0 else 0.0


def multipliers(orbit: MeshOrbit) -> Multipliers:
    """Compute the multipliers from the variational equation, by the orbit's own collocation."""
    symmetry, network = orbit.symmetry, orbit.network
    states = orbit.stages[..., np.concatenate([symmetry.classes + k * (symmetry.classes.max() + 1)
                                               for k in range(network.variables)])]
    jacobians = network.jacobian(states)  # type: ignore[attr-defined]
    lengths = np.diff(orbit.mesh) * orbit.period / symmetry.order
    blocks = np.arange(network.variables)[:, None] * network.cells
    turn = np.eye(network.components)[(symmetry.turn + blocks).ravel()]
    found = []
    for columns in (symmetry.basis.T, null_space(symmetry.basis)):
        if not columns.shape[1]:
            found.append(np.zeros(0, dtype=complex))
            continue
        step = _propagated(columns.T @ jacobians @ columns, lengths)
        # After T/m the cells have changed places; m of these make a period. After m changes a
        # cell is another one of its class, which only matters outside Fix(K).
        change, m = columns.T @ turn @ columns, symmetry.order
        whole = np.linalg.eigvals(np.linalg.matrix_power(change, m)
                                  @ np.linalg.matrix_power(change.T @ step, m))
        found.append(whole[np.argsort(-np.abs(whole))])
    trivial = int(np.abs(found[0] - 1.0).argmin())
    return Multipliers(orbit.period, np.delete(found[0], trivial), found[1],
                       complex(found[0][trivial]))


def _propagated(jacobians: np.ndarray, lengths: np.ndarray) -> np.ndarray:
    """Solution of the linear equation over all intervals, shape (d, d)."""
    d = jacobians.shape[-1]
    stages, _ = transfer(jacobians, lengths, np.zeros((*jacobians.shape[:3], 0)))
    steps = np.eye(d) + lengths[:, None, None] * np.einsum('s,nsij,nsjk->nik', WEIGHTS,
                                                           jacobians, stages)
    whole = np.eye(d)
    for step in steps:
        whole = step @ whole
    return whole

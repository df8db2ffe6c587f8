"""What bodies feel, from the true state of the physics: no noise, no delay."""

import numpy as np

from cpg_ros.feedback.estimate import GRAVITY, Senses
from cpg_ros.simulation.body import Body


def felt(angles: np.ndarray, rates: np.ndarray, loads: np.ndarray, quaternions: np.ndarray,
         moving: np.ndarray, before: np.ndarray, dt: float) -> tuple[Senses, np.ndarray]:
    """Return what is felt, and the true velocities in the bodies' own frames, m/s, (runs, 3).

    Args:
        angles: of the joints leg by leg, rad, shape (runs, joints).
        rates: rad/s, the same.
        loads: of the feet, N, shape (runs, legs).
        quaternions: of the bases, w x y z, shape (runs, 4).
        moving: velocity in the world's frame, m/s, then angular velocity in the base's, rad/s,
            shape (runs, 6).
        before: the same dt before.
        dt: s.

    """
    w, x, y, z = quaternions.T
    lean = np.stack([np.arctan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x * x + y * y)),
                     np.arcsin(np.clip(2.0 * (w * y - z * x), -1.0, 1.0)),
                     np.arctan2(2.0 * (w * z + x * y), 1.0 - 2.0 * (y * y + z * z))], axis=1)
    axes = np.stack([1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y),
                     2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
                     2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
                    axis=1).reshape(-1, 3, 3)
    faster = (moving[:, :3] - before[:, :3]) / dt
    faster[:, 2] += GRAVITY
    push, velocity = (np.einsum('rij,ri->rj', axes, one) for one in (faster, moving[:, :3]))
    return Senses(angles, rates, loads, lean, moving[:, 3:], push), velocity


class Proprioception:
    """What one body feels, step by step; call it once after each."""

    def __init__(self, body: Body) -> None:
        self._body = body
        self._order = np.argsort(body.robot.places)
        self._before = self._moving()

    def _moving(self) -> np.ndarray:
        body = self._body
        return body.rates[None].copy()

    def __call__(self) -> Senses:
        """Return what is felt now, of one run."""
        body, before = self._body, self._before
        self._before = self._moving()
        return felt(body.position[None, self._order], body.velocity[None, self._order],
                    body.feet[None].copy(), body.quaternion[None].copy(), self._before, before,
                    body.model.opt.timestep)[0]

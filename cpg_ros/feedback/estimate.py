"""What a robot feels, and what it makes of it: contact, lean, and its velocity over ground."""

from dataclasses import dataclass

import numpy as np

from cpg_ros.feedback.kinematics import Geometry, forward, jacobian

GRAVITY = 9.81
#: A foot counts as on the ground above this share of the weight, until below the other.
TOUCH, LEAVE = 0.10, 0.04
#: Stance legs pull the velocity to theirs with this time constant, s, when they bear the weight.
PULL = 0.02
#: Legs whose velocity is this far from the one expected, m/s, count half: they slip.
SLIP = 0.25


@dataclass
class Senses:
    """What a robot feels at an instant, of each run.

    Attributes:
        angles, rates: of the joints leg by leg, rad and rad/s, shape (runs, joints).
        loads: of the feet, N, shape (runs, legs).
        lean: roll, pitch and yaw, rad, shape (runs, 3).
        turning: of the base in its own frame, rad/s, shape (runs, 3).
        push: what an accelerometer shows, its own frame, m/s^2, shape (runs, 3).

    """

    angles: np.ndarray
    rates: np.ndarray
    loads: np.ndarray
    lean: np.ndarray
    turning: np.ndarray
    push: np.ndarray


def upward(lean: np.ndarray) -> np.ndarray:
    """Return the vertical in the base's frame, shape (..., 3)."""
    roll, pitch = lean[..., 0], lean[..., 1]
    return np.stack([-np.sin(pitch), np.sin(roll) * np.cos(pitch),
                     np.cos(roll) * np.cos(pitch)], axis=-1)


class BodyState:
    """State of the base and of its contacts.

    Attributes:
        velocity: of the base in its own frame, m/s, shape (runs, 3).
        contact: whether each foot is on the ground, shape (runs, legs).
        lean: roll, pitch and yaw, rad, shape (runs, 3).
        turning: rad/s, shape (runs, 3).

    """

    def __init__(self, geometry: Geometry, runs: int = 1) -> None:
        self.geometry = geometry
        legs = len(geometry.hips)
        self.velocity = np.zeros((runs, 3))
        self.contact = np.zeros((runs, legs), dtype=bool)
        self.lean, self.turning = np.zeros((2, runs, 3))

    def update(self, senses: Senses, dt: float) -> None:
        """Take note of what is felt, dt in s after the last time."""
        geometry, turning = self.geometry, senses.turning
        self.lean, self.turning = senses.lean, turning
        share = np.maximum(senses.loads, 0.0) / geometry.weight
        self.contact = share > np.where(self.contact, LEAVE, TOUCH)

        up = upward(senses.lean)
        speed_up = senses.push - GRAVITY * up - np.cross(turning, self.velocity)
        self.velocity += dt * speed_up

        seen = self._by_legs(senses, up)
        off = ((seen - self.velocity[:, None])**2).sum(axis=2)
        trust = np.where(self.contact, share, 0.0) / (1.0 + off / SLIP**2)
        # Even where all legs slip, they are believed a little: integrated pushes drift.
        pull = np.minimum(dt / PULL * trust, 0.5)
        total = pull.sum(axis=1, keepdims=True)
        pull *= np.minimum(total, 0.9) / np.maximum(total, 1e-9)
        self.velocity += (pull[..., None] * (seen - self.velocity[:, None])).sum(axis=1)

    def _by_legs(self, senses: Senses, up: np.ndarray) -> np.ndarray:
        """Return the base's velocity by each leg if its foot rolls, m/s, (runs, legs, 3)."""
        geometry, turning = self.geometry, senses.turning[:, None]
        feet = forward(geometry, senses.angles)
        rates = senses.rates[:, geometry.columns]
        moving = np.einsum('rlij,rlj->rli', jacobian(geometry, senses.angles), rates)
        turned = rates * geometry.turns
        hip = senses.angles[:, geometry.columns[:, 0]] * geometry.turns[:, 0]
        pitching = turned[..., 1] + turned[..., 2]
        shank = turning + np.stack([turned[..., 0], pitching * np.cos(hip),
                                    pitching * np.sin(hip)], axis=-1)
        rolling = geometry.radius * np.cross(shank, up[:, None])
        return rolling - moving - np.cross(np.broadcast_to(turning, feet.shape), feet)

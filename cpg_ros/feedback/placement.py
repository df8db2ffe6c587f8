"""Placement: a body that goes too fast steps further that way."""

import math

import numpy as np

from cpg_ros.feedback.gains import Gains


def step(velocity: np.ndarray, turning: np.ndarray, gains: Gains) -> np.ndarray:
    """Return how much further to put feet down, forward and to the left, m, shape (runs, 2).

    Args:
        velocity: beyond what is expected, forward and to the left, m/s, shape (runs, 2).
        turning: of roll and pitch beyond what is expected, rad/s, shape (runs, 2).
        gains: of the law.

    """
    far = gains.step * velocity
    far[:, 0] += gains.step_pitch_rate * turning[:, 1]
    far[:, 1] += gains.step_roll_rate * turning[:, 0]
    return np.clip(far, -gains.step_most, gains.step_most)


def advance(way: np.ndarray, swinging: np.ndarray, wanted: np.ndarray, sideways: np.ndarray,
            gains: Gains, dt: float) -> np.ndarray:
    """Move feet in the air to their steps, and let those on the ground go back, yielding.

    Args:
        way: by which feet are displaced, m, shape (runs, legs, 2).
        swinging: shape (runs, legs).
        wanted: as of step, shape (runs, 2).
        sideways: velocity to the left beyond what is expected, m/s, shape (runs,).
        gains: of the law.
        dt: s.

    """
    swung = way + (1.0 - math.exp(-dt / gains.step_filter)) * (wanted[:, None] - way)
    stood = way * math.exp(-gains.step_decay * dt)
    stood[..., 1] -= gains.give * dt * sideways[:, None]
    return np.clip(np.where(swinging[..., None], swung, stood), -gains.step_most, gains.step_most)

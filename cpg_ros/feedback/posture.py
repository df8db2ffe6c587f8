"""Posture: legs of the low side push, and a foot in the air stays level to gravity."""

import numpy as np

from cpg_ros.feedback.gains import Gains


def in_stance(feet: np.ndarray, lean: np.ndarray, turning: np.ndarray, gains: Gains
              ) -> np.ndarray:
    """Return how far to draw feet in, m, shape (runs, legs).

    Args:
        feet: where they are, m, shape (runs, legs, 3).
        lean: roll and pitch beyond what is expected, rad, shape (runs, 2).
        turning: their rates, the same way, rad/s.
        gains: of the law.

    """
    roll = gains.roll * lean[:, 0] + gains.roll_rate * turning[:, 0]
    pitch = gains.pitch * lean[:, 1] + gains.pitch_rate * turning[:, 1]
    drawn = roll[:, None] * feet[..., 1] - pitch[:, None] * feet[..., 0]
    return np.clip(drawn, -gains.posture_most, gains.posture_most)


def in_swing(feet: np.ndarray, lean: np.ndarray, gains: Gains) -> np.ndarray:
    """Return how far to draw feet in so that their heights are those of a level body, m."""
    level = lean[:, 1, None] * feet[..., 0] - lean[:, 0, None] * feet[..., 1]
    return np.clip(level, -gains.posture_most, gains.posture_most)

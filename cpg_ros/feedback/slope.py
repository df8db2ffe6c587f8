"""Slope: feet under the body along gravity, not along the body."""

import math

import numpy as np

from cpg_ros.feedback.gains import Gains


def follow(ground: np.ndarray, lean: np.ndarray, gains: Gains, dt: float) -> np.ndarray:
    """Return the low-passed roll and pitch, rad, shape (runs, 2), dt in s later."""
    return ground + (1.0 - math.exp(-dt / gains.slope_filter)) * (lean - ground)


def shift(ground: np.ndarray, gains: Gains) -> np.ndarray:
    """Return how far to move all feet, forward and to the left, m, shape (runs, 2)."""
    tilt = gains.slope_share * gains.slope_height * np.tan(ground)
    return np.clip(np.stack([tilt[:, 1], -tilt[:, 0]], axis=1),
                   -gains.slope_most, gains.slope_most)

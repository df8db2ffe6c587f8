"""Pace: a body that is pushed sideways steps faster."""

import numpy as np

from cpg_ros.feedback.gains import Gains


def hurry(sideways: np.ndarray, gains: Gains) -> np.ndarray:
    """Return the factor of the stride frequency, shape (runs,), at a sideways velocity, m/s."""
    return 1.0 + np.clip(gains.pace_gain * (np.abs(sideways) - gains.pace_from),
                         0.0, gains.pace_most)

"""Pace: a body that is pushed steps faster."""

import numpy as np

from cpg_ros.feedback.gains import Gains


def hurry(velocity: np.ndarray, gains: Gains) -> np.ndarray:
    """Return the factor of the stride frequency, shape (runs,).

    Args:
        velocity: beyond what is expected, forward and to the left, m/s, shape (runs, 2).
        gains: of the law.

    """
    pushed = np.hypot(velocity[:, 0], velocity[:, 1])
    return 1.0 + np.clip(gains.pace_gain * (pushed - gains.pace_from),
                         0.0, gains.pace_most)

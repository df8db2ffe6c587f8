"""Speed: a robot that is too slow takes longer strides."""

import numpy as np

from cpg_ros.feedback.gains import Gains


def longer(missing: np.ndarray, way: np.ndarray, gains: Gains) -> np.ndarray:
    """Return what to add to strides, shape (runs,); missing speed in m/s, its integral in m."""
    return np.clip(gains.speed_share * missing + gains.speed_rate * way,
                   -gains.speed_most, gains.speed_most)


def gather(way: np.ndarray, missing: np.ndarray, gains: Gains, dt: float) -> np.ndarray:
    """Return the integral of the missing speed, m, no larger than the law can use."""
    most = gains.speed_most / max(gains.speed_rate, 1e-9)
    return np.clip(way + dt * missing, -most, most)

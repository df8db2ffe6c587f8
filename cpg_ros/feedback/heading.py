"""Heading: a robot that is turned away turns back."""

import numpy as np

from cpg_ros.feedback.gains import Gains


def turn(wanted: np.ndarray, yaw: np.ndarray, gains: Gains) -> np.ndarray:
    """Return the yaw rate to ask of the legs, rad/s; headings in rad, all of shape (runs,)."""
    error = (wanted - yaw + np.pi) % (2.0 * np.pi) - np.pi
    return np.clip(gains.turn * error, -gains.turn_most, gains.turn_most)

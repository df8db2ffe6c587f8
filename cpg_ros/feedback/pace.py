"""Pace: a body that is pushed steps faster."""

import math

from cpg_ros.integration.jit import jit


@jit
def hurry(forward, left, gains):
    """Return the factor of the stride frequency; velocities beyond what is expected, m/s."""
    pushed = math.hypot(forward, left)
    return 1.0 + min(max(gains.pace_gain * (pushed - gains.pace_from), 0.0), gains.pace_most)

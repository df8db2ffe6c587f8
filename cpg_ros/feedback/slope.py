"""Slope: feet under the body along gravity, not along the body."""

import math

from cpg_ros.integration.jit import jit


@jit
def follow(ground, lean, gains, dt):
    """Return the low-passed angle of the ground, rad, dt in s later."""
    return ground + (1.0 - math.exp(-dt / gains.slope_filter)) * (lean - ground)


@jit
def shift(ground, gains):
    """Return how far to move all feet uphill of an angle in rad, m."""
    far = gains.slope_share * gains.slope_height * math.tan(ground)
    return min(max(far, -gains.slope_most), gains.slope_most)

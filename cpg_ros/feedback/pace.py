"""Pace: a body that is pushed sideways steps faster, for a while.

A gait that is hurried sways less and goes faster than its efference copy says, which would pass
for a push: so the law tires, and speed forward, which follows from the pace itself, is no matter
of it.
"""

import math

from cpg_ros.integration.jit import jit


@jit
def hurry(left, fatigue, gains):
    """Return what to add to the factor of the stride frequency.

    Args:
        left: velocity to the left beyond what is expected, m/s.
        fatigue: mean of what was added of late, see tire.
        gains: of the law.

    """
    fresh = min(max(gains.pace_gain * (abs(left) - gains.pace_from), 0.0), gains.pace_most)
    return max(fresh - gains.pace_fatigue * fatigue, 0.0)


@jit
def tire(fatigue, added, gains, dt):
    """Return the mean of what has been added to the factor of late, dt in s later."""
    return fatigue + (1.0 - math.exp(-dt / gains.pace_memory)) * (added - fatigue)

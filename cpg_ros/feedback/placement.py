"""Placement: a body that goes too fast steps further that way."""

import math

from cpg_ros.integration.jit import jit


@jit
def step(velocity, turning, gain, rate_gain, gains):
    """Return how much further to put feet down, m, forward or to the left.

    Args:
        velocity: that way beyond what is expected, m/s.
        turning: of pitch or roll beyond what is expected, rad/s.
        gain: of the first.
        rate_gain: of the second.
        gains: of the law.

    """
    return min(max(gain * velocity + rate_gain * turning, -gains.step_most), gains.step_most)


@jit
def swing(way, wanted, gains, dt):
    """Move a foot in the air towards its step; ways in m, dt in s."""
    return way + (1.0 - math.exp(-dt / gains.step_filter)) * (wanted - way)


@jit
def stand(way, giving, gains, dt):
    """Let a foot on the ground go back, and give way at a speed in m/s."""
    found = way * math.exp(-gains.step_decay * dt) - dt * giving
    return min(max(found, -gains.step_most), gains.step_most)

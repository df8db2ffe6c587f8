"""Heading: a robot that is turned away turns back."""

import math

from cpg_ros.integration.jit import jit


@jit
def turn(wanted, yaw, gains):
    """Return the yaw rate to ask of the legs, rad/s; headings in rad."""
    error = (wanted - yaw + math.pi) % (2.0 * math.pi) - math.pi
    return min(max(gains.turn * error, -gains.turn_most), gains.turn_most)

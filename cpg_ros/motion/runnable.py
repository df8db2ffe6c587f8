"""Whether the generator can run a gait at all, whatever the robot."""

import numpy as np

from cpg_ros.dynamics.periodic import Orbit
from cpg_ros.dynamics.stability import stability
from cpg_ros.motion.joint_readout import joint_readout
from cpg_ros.motion.plan import STEPS_A_PERIOD


def refusal(orbit: Orbit, harmonics: int) -> str:
    """Say why the generator would refuse a gait, or ''.

    Args:
        orbit: the gait's.
        harmonics: of a Morris-Lecar cell's waveform that joints follow.

    """
    shortest = STEPS_A_PERIOD * orbit.network.step
    if orbit.period < shortest:
        return f'its period of {orbit.period:.3g} model time units is below {shortest:g}'
    flaw = stability(orbit).flaw
    if flaw:
        return f'it does not attract: {flaw}'
    try:
        joint_readout(orbit, np.zeros(1, dtype=int), np.zeros((1, 6)), np.zeros(1, dtype=int),
                      harmonics)
    except ValueError as error:
        return f'it cannot drive joints: {error}'
    return ''

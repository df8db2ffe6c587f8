"""Make every kernel of the real-time path ready, compiling those not yet on disk."""

import numpy as np

from cpg_ros.dynamics.readout import confine, observe
from cpg_ros.dynamics.stepper import Stepper
from cpg_ros.networks.delayed import PRESETS, Mode


def warm() -> None:
    """Run each kernel once, on the types the generator uses."""
    network = PRESETS['trot'].network
    stepper = Stepper(network, np.zeros(8), max_delay=1.0, gain=1.0, mode=Mode(2, 1))
    stepper.advance(0.01)
    joints, table = np.zeros(1), np.zeros(4)
    observe(stepper.now, 1.0, 1.0, np.zeros(1, dtype=int), np.zeros((1, 6)), np.zeros(8),
            np.zeros(1, dtype=int), table, table, joints, joints, joints)
    confine(joints, joints, joints, joints, joints, 1.0, joints, joints)

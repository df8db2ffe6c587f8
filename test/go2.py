"""The shipped Go2's gaits, for tests that move its body."""

from functools import cache
from pathlib import Path

from cpg_ros.motion.plan import plan
from cpg_ros.networks.registry import PRESETS
from cpg_ros.robots.robot_file import load_robot

FILE = Path(__file__).parent.parent / 'config' / 'unitree_go2.yaml'
GO2 = load_robot(FILE)
#: Time step of the physics, s.
DT = 0.002


@cache
def program(gait, network='delayed'):
    """Return a gait at the frequency that the robot file has for it."""
    preset = PRESETS[network][gait]
    return plan(GO2, gait, preset, preset.network, GO2.motion(gait, gait).frequency)

# Copyright 2026 cpg_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Recordings of the generator's own pattern: what the node ticks, without a graph."""

from dataclasses import replace
from functools import cache

from cpg_ros.common.errors import CpgError
from cpg_ros.fitting.recordings.recording import Recording
from cpg_ros.motion.pattern import Pattern
from cpg_ros.motion.plan import plan
from cpg_ros.motion.robot_file import load_robot
from cpg_ros.networks.registry import find_network
import numpy as np

#: Samples a second, how long is recorded (s), and strides a second where no file says.
RATE, LASTING, STRIDES = 200.0, 14.0, 1.5
ROBOTS = ('quadruped', 'goat', 'unitree_go2', 'hexapod', 'biped', 'humanoid', 'unitree_g1')


@cache
def ticked(robot, network, gait, changes=(), duty=0.0):
    """Joint angles of a shipped robot in a gait, rad, shape (samples, joints)."""
    robot, preset = load_robot(robot), find_network(network).presets()[gait]
    frequency = robot.motion(gait, preset.gait).frequency or STRIDES
    pattern = Pattern(plan(robot, gait, preset, replace(preset.network, **dict(changes)),
                           frequency, duty=duty), 0.1)
    for _ in range(int(RATE)):
        pattern.advance(1.0 / RATE)
    rows = []
    for _ in range(int(LASTING * RATE)):
        pattern.advance(1.0 / RATE)
        rows.append(pattern.position[robot.order_indices])
    return np.array(rows)


def generated(robot, network, gait, seed=None, noise=0.01, **settings):
    """Return a recording of that, with noise of a fraction of each joint's range if seeded."""
    x = ticked(robot, network, gait, **settings)
    if seed is not None:
        x = x + noise * np.ptp(x, axis=0) * np.random.default_rng(seed).standard_normal(x.shape)
    return Recording(tuple(load_robot(robot).order), np.arange(len(x)) / RATE, x,
                     source=f'{robot}, {network} {gait}')


def walks():
    """Yield robot, network and gait of everything shipped that the generator runs."""
    for name in ROBOTS:
        robot = load_robot(name)
        for network in robot.networks:
            for gait, preset in find_network(network).presets().items():
                if gait != preset.gait:
                    continue
                try:
                    plan(robot, gait, preset, preset.network,
                         robot.motion(gait, gait).frequency or STRIDES)
                except CpgError:
                    continue
                yield name, network, gait

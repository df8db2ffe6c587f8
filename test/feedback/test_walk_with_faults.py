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

"""A biped's compiled tick beside recorded results of the same laws in plain Python.

The robot is on paper: its measurements follow from what the pattern says, and inputs fail.
"""

import json
import math
from pathlib import Path

from cpg_ros.feedback.biped.feedback import BipedFeedback, gait_plan
from cpg_ros.feedback.biped.links import links_of
from cpg_ros.feedback.estimate import SensorData
from cpg_ros.motion.robot_file import load_robot
import numpy as np
from ticked_pattern import TickedPattern

DT, EVERY, FREQUENCY = 0.002, 250, 1.65
#: Fault, its begin and its end, s.
FAULTS = (('imu', 4.0, 4.4), ('joints', 8.0, 8.2), ('all', 11.0, 11.6), ('stuck', 15.0, 15.6),
          ('swapped', 19.0, 19.6), ('jump', 23.0, 23.4), ('feet', 26.0, 26.3),
          ('lean', 29.0, 29.5))
#: Inputs that are lost in a fault: 0 is the inertial unit, 1 joints, 2 feet.
LOST = {'imu': (0,), 'joints': (1,), 'all': (0, 1, 2), 'feet': (2,)}
#: When it is told to walk, s: doubts are then forgotten.
TOLD = 1.0, 17.5, 21.5, 25.0, 28.0


class PaperRobot:
    """A humanoid whose joints go where the pattern holds them, and swing a little in balance."""

    def __init__(self):
        self.robot = load_robot('humanoid')
        self.pattern = TickedPattern(gait_plan(self.robot, 'walk'), 1.0, enabled=False)
        self.pattern.balance = feedback = BipedFeedback(self.robot)
        offsets = {**{joint.name: joint.offset for joint in self.robot.joints}, **self.robot.held}
        self.stand = np.array([offsets[name] for name in feedback.order])
        self.joints = self.stand.copy()
        self.rows = [feedback.order.index(joint.name) for joint in self.robot.joints]
        self.links = links_of(self.robot)
        self.sensors = SensorData.zeros(1, 2, len(feedback.order))

    def measure(self, time, now):
        pattern, sensors, wave = self.pattern, self.sensors, 2.0 * math.pi * FREQUENCY * time
        goal = self.stand.copy()
        if pattern.balancing:
            goal += 0.02 * np.sin(wave + np.arange(goal.size))
        else:
            goal[self.rows] = pattern.position
        step = np.clip(goal - self.joints, -4.0 * DT, 4.0 * DT)
        self.joints += step
        lost = {k for name in now for k in LOST.get(name, ())}
        pattern.ages[:] = [pattern.ages[k] + DT if k in lost else 0.0 for k in range(3)]
        pattern.latencies[:2] = pattern.ages[:2] + 0.004
        pattern.failed = bool((pattern.ages > 0.05).any())
        if 1 not in lost:
            sensors.joint_positions[0], sensors.joint_velocities[0] = self.joints, step / DT
            if 'stuck' in now:
                sensors.joint_positions[0, 4] = sensors.joint_velocities[0, 4] = 0.1
            sensors.joint_positions[0, 5] += 0.6 * ('jump' in now)
        if 0 not in lost:
            sensors.rpy[0] = 0.01 * np.sin(wave + np.arange(3))
            sensors.rpy[0, 0] += 1.2 * ('lean' in now)
            # The soles are level.
            sensors.rpy[0, 1] -= sum(self.links.axes[row, 1] * self.joints[row - 1]
                                     for row in self.links.chains[0]
                                     if abs(self.links.axes[row, 1]) > 0.9)
            sensors.angular_velocity[0] = 0.01 * np.cos(wave + np.arange(3))
            sensors.acceleration[0] = 0.1 * math.sin(wave), 0.05, 9.81
        if 2 not in lost:
            swings = np.abs((pattern.phases + 0.5) % 1.0 - 0.5) < 0.2445
            loads = np.where(swings & (pattern.level == 1.0), 0.0, 0.5)
            loads *= 9.81 * self.robot.biped.total / max(loads.sum(), 0.25)
            sensors.foot_forces[0] = loads[::-1] if 'swapped' in now else loads
        pattern.sense(sensors)

    @property
    def found(self):
        pattern = self.pattern
        return [float(pattern.position @ np.arange(1, 1 + pattern.position.size)),
                float(pattern.held_angles.sum() + pattern.phases[0]),
                4 * bool(pattern.balancing) + 2 * bool(pattern.crouching) + bool(pattern.fallen),
                sorted(pattern.doubts), float(pattern.level)]


def test_a_walk_with_faults_equals_the_recorded_one():
    one, found = PaperRobot(), []
    for k in range(round(32.0 / DT)):
        if k * DT in TOLD:
            one.pattern.command = 0.3, 0.05, 0.1
            one.pattern.enable(True, 1.0)
        one.measure(k * DT, {name for name, begin, end in FAULTS if begin <= k * DT < end})
        one.pattern.advance(DT)
        if k % EVERY == 0:
            found.append(one.found)
    recorded = json.loads(Path(__file__).with_name('walk_with_faults.json').read_text())
    assert [row[2:] for row in found] == [row[2:] for row in recorded]
    np.testing.assert_allclose([row[:2] for row in found], [row[:2] for row in recorded],
                               atol=1e-8)
    # It balanced, walked, crouched, and doubted the joints.
    assert {row[2] for row in recorded} >= {2, 4} and any(row[3] for row in recorded)

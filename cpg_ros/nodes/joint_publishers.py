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

"""The generator's messages: joint states, phases and commands, published every tick."""

from cpg_ros.nodes.message_block import MessageBlock, Template
from cpg_ros.robots.robot import Robot
import numpy as np
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, MultiArrayDimension
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

#: Names under which ros2_control's controllers listen by default.
COMMAND_TOPICS = {'joint_trajectory': 'joint_trajectory_controller/joint_trajectory',
                  'forward_position': 'forward_position_controller/commands'}


class Outputs:
    """Per-leg and combined joint states, leg phases, and commands for ros2_control.

    Attributes:
        topics: those that move joints, resolved.

    """

    def __init__(self, node: Node, robot: Robot, combined_topic: str, command: str) -> None:
        """Prepare all messages.

        Raises:
            ValueError: the combined topic is one of the others.

        """
        own = [*(f'{leg}/joint_states' for leg in robot.legs), *COMMAND_TOPICS.values()]
        if combined_topic:
            name = node.resolve_topic_name(combined_topic)
            for topic in (*own, '~/phase'):
                if name == node.resolve_topic_name(topic):
                    raise ValueError(f"combined_topic '{combined_topic}' is the generator's own "
                                     f'{topic}: it would be published twice on one topic')
        count, legs = len(robot.joints), len(robot.legs)
        # The block's numbers: positions, velocities, phases.
        self._parts = slice(count), slice(count, 2 * count), slice(2 * count, 2 * count + legs)
        places = np.arange(count)
        messages: list[tuple[str, Template]] = []
        start = 0
        for leg, joints in robot.legs.items():
            messages.append((f'{leg}/joint_states', joint_state(
                [joint.name for joint in joints], places[start:start + len(joints)], count)))
            start += len(joints)
        order = np.asarray(robot.places)
        if combined_topic:
            messages.append((combined_topic, joint_state(list(robot.order), order, count)))
        messages.append(('~/phase', labelled(tuple(robot.legs), 2 * count + np.arange(legs))))
        if command == 'joint_trajectory':
            # One point a message, reached a period after it: stamp 0 means from now.
            point = JointTrajectoryPoint()
            messages.append((COMMAND_TOPICS[command], Template(
                JointTrajectory(joint_names=list(robot.order), points=[point]),
                durations=[point.time_from_start],
                numbers=[(point, 'positions', order), (point, 'velocities', count + order)])))
        elif command == 'forward_position':
            array = Float64MultiArray()
            messages.append((COMMAND_TOPICS[command],
                             Template(array, numbers=[(array, 'data', order)])))
        self._block = MessageBlock(node, 2 * count + legs, messages)
        phase = node.resolve_topic_name('~/phase')
        self.topics = [topic for topic in self._block.topics if topic != phase]

    def publish(self, stamp: int, dt: float, position: np.ndarray, velocity: np.ndarray,
                phases: np.ndarray) -> None:
        """Publish everything: stamp in ns, dt in s, rad and rad/s by joint, phases in cycles."""
        values = self._block.values
        for part, given in zip(self._parts, (position, velocity, phases), strict=True):
            values[part] = given
        self._block.publish(stamp, round(1e9 * dt))


def joint_state(names: list[str], positions: np.ndarray, *further: int) -> Template:
    """Return a template of joint states.

    Args:
        names: of the joints.
        positions: which of a block's numbers are their positions.
        further: how far behind them the velocities are, and the efforts if there are any.

    """
    message = JointState(name=names)
    fields = zip(('position', 'velocity', 'effort'), (0, *further), strict=False)
    return Template(message, [message.header.stamp],
                    numbers=[(message, name, positions + behind) for name, behind in fields])


def labelled(names: tuple[str, ...], places: np.ndarray) -> Template:
    """Return a template of an array with a number for each name, which its label lists."""
    message = Float64MultiArray()
    message.layout.dim = [MultiArrayDimension(label=','.join(names), stride=1, size=len(names))]
    return Template(message, numbers=[(message, 'data', places)])

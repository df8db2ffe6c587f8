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

"""The generator's messages: joint states, phases and commands every tick, and cells."""

from collections.abc import Sequence

from cpg_ros.networks.network import Network
from cpg_ros.nodes.message_block import MessageBlock, places, Template
from cpg_ros.nodes.node_base import StartError
from cpg_ros.robots.robot import Robot
import numpy as np
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, MultiArrayDimension
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

#: Names under which ros2_control's controllers listen by default.
COMMAND_TOPICS = {'joint_trajectory': 'joint_trajectory_controller/joint_trajectory',
                  'forward_position': 'forward_position_controller/commands'}
#: The cells are published at most this many times a second, as often as people can see.
FASTEST = 50.0


class Outputs:
    """Per-leg and combined joint states, leg phases, and commands for ros2_control.

    Attributes:
        topics: those that move joints, resolved.

    """

    def __init__(self, node: Node, robot: Robot, combined_topic: str, command: str) -> None:
        """Prepare all messages.

        Raises:
            StartError: the combined topic is one of the others.

        """
        own = [*(f'{leg}/joint_states' for leg in robot.legs), *COMMAND_TOPICS.values()]
        if combined_topic:
            name = node.resolve_topic_name(combined_topic)
            for topic in (*own, '~/phase'):
                if name == node.resolve_topic_name(topic):
                    raise StartError(f"combined_topic '{combined_topic}' is the generator's own "
                                     f'{topic}: it would be published twice on one topic')
        count, legs = len(robot.joints), len(robot.legs)
        sizes = count, count, legs
        positions, velocities, phases = places(sizes)
        messages: list[tuple[str, Template]] = []
        start = 0
        for leg, joints in robot.legs.items():
            part = slice(start, start + len(joints))
            messages.append((f'{leg}/joint_states', joint_state(
                [joint.name for joint in joints], positions[part], velocities[part])))
            start = part.stop
        order = list(robot.places)
        positions, velocities = positions[order], velocities[order]
        if combined_topic:
            messages.append((combined_topic, joint_state(robot.order, positions, velocities)))
        messages.append(('~/phase', labelled(tuple(robot.legs), phases)))
        if command == 'joint_trajectory':
            # One point a message, reached a period after it: stamp 0 means from now.
            point = JointTrajectoryPoint()
            messages.append((COMMAND_TOPICS[command], Template(
                JointTrajectory(joint_names=list(robot.order), points=[point]),
                durations=[point.time_from_start],
                numbers=[(point, 'positions', positions), (point, 'velocities', velocities)])))
        elif command == 'forward_position':
            array = Float64MultiArray()
            messages.append((COMMAND_TOPICS[command],
                             Template(array, numbers=[(array, 'data', positions)])))
        self._block = MessageBlock(node, sizes, messages)
        phase = node.resolve_topic_name('~/phase')
        self.topics = [topic for topic in self._block.topics if topic != phase]

    def publish(self, stamp: int, dt: float, position: np.ndarray, velocity: np.ndarray,
                phases: np.ndarray) -> None:
        """Publish everything: stamp in ns, dt in s, rad and rad/s by joint, phases in cycles."""
        self._block.publish(stamp, (position, velocity, phases), round(1e9 * dt))


class CellsPublisher:
    """Publishes the network on ``~/cells``: a row for each variable of a cell, one for each rate.

    Rates are in model time.
    """

    def __init__(self, node: Node, network: type[Network]) -> None:
        rows = [*network.states, *(f'd{name}/dt' for name in network.states)]
        count = len(rows) * network.cells
        message = Float64MultiArray()
        message.layout.dim = [
            MultiArrayDimension(label=','.join(rows), size=len(rows), stride=count),
            MultiArrayDimension(label='cells', size=network.cells, stride=network.cells)]
        self._block = MessageBlock(node, [count], [
            ('~/cells', Template(message, numbers=[(message, 'data', np.arange(count))]))])
        self._elapsed = 1.0 / FASTEST

    def publish(self, dt: float, state: np.ndarray) -> None:
        """Publish a state and its rate, if one is due.

        Args:
            dt: since the last call, s.
            state: and its rate, shape (2, variables * cells).

        """
        self._elapsed += dt
        if self._elapsed >= (1.0 - 1e-6) / FASTEST:
            self._elapsed = 0.0
            self._block.publish(0, (state.ravel(),))


def joint_state(names: Sequence[str], *parts: np.ndarray) -> Template:
    """Return a template of joint states.

    Args:
        names: of the joints.
        parts: which of a block's numbers are their positions, velocities and, if there are any,
            efforts.

    """
    message = JointState(name=list(names))
    fields = zip(('position', 'velocity', 'effort'), parts, strict=False)
    return Template(message, [message.header.stamp],
                    numbers=[(message, name, part) for name, part in fields])


def labelled(names: tuple[str, ...], places: np.ndarray) -> Template:
    """Return a template of an array with a number for each name; its label lists the names."""
    message = Float64MultiArray()
    message.layout.dim = [MultiArrayDimension(label=','.join(names), stride=1, size=len(names))]
    return Template(message, numbers=[(message, 'data', places)])

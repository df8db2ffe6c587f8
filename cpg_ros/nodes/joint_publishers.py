"""The generator's messages: built once, filled in place and published every tick."""

from array import array

import numpy as np
from builtin_interfaces.msg import Duration
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.qos_overriding_options import QoSOverridingOptions
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, MultiArrayDimension
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

from cpg_ros.robots.robot import Robot

#: Names under which ros2_control's controllers listen by default.
COMMAND_TOPICS = {'joint_trajectory': 'joint_trajectory_controller/joint_trajectory',
                  'forward_position': 'forward_position_controller/commands'}


def view_of(message: object, field: str, n: int) -> np.ndarray:
    """Give a message's field n zeros and return a numpy view of the memory it publishes from.

    The view is taken from the field as stored: rclpy copies what is assigned or not, depending
    on whether it checks fields.
    """
    setattr(message, field, array('d', bytes(8 * n)))
    return np.frombuffer(getattr(message, field), dtype=float)


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
        joints = [joint.name for joint in robot.joints]
        self._order = robot.places
        self._stamps: list = []
        self._publish: list = []
        # Views of the messages' memory, and which joints go there.
        self._positions: list[tuple[np.ndarray, slice | np.ndarray]] = []
        self._velocities: list[tuple[np.ndarray, slice | np.ndarray]] = []
        self._node = node
        own = [*(f'{leg}/joint_states' for leg in robot.legs), *COMMAND_TOPICS.values()]
        if combined_topic:
            name = node.resolve_topic_name(combined_topic)
            for topic in (*own, '~/phase'):
                if name == node.resolve_topic_name(topic):
                    raise ValueError(f"combined_topic '{combined_topic}' is the generator's own "
                                     f'{topic}: it would be published twice on one topic')
        self.topics: list[str] = []

        start = 0
        for leg, members in robot.legs.items():
            part = slice(start, start + len(members))
            self._joint_state(f'{leg}/joint_states', joints[part], part)
            start = part.stop
        if combined_topic:
            self._joint_state(combined_topic, list(robot.order), self._order)

        phases = Float64MultiArray()
        self._phases = view_of(phases, 'data', len(robot.legs))
        phases.layout.dim = [MultiArrayDimension(label=','.join(robot.legs), stride=1,
                                                 size=len(robot.legs))]
        self._add(Float64MultiArray, '~/phase', phases)
        self.topics.remove(node.resolve_topic_name('~/phase'))
        self._point: JointTrajectoryPoint | None = None
        if command == 'joint_trajectory':
            self._trajectory(robot.order)
        elif command == 'forward_position':
            message = Float64MultiArray()
            self._positions.append((view_of(message, 'data', len(joints)), self._order))
            self._add(Float64MultiArray, COMMAND_TOPICS[command], message)

    def _add(self, kind: type, topic: str, message: object) -> None:
        publisher = self._node.create_publisher(
            kind, topic, QoSProfile(depth=100),
            qos_overriding_options=QoSOverridingOptions.with_default_policies())
        self._publish.append((publisher.publish, message))
        self.topics.append(publisher.topic_name)

    def _joint_state(self, topic: str, names: list[str], part: slice | np.ndarray) -> None:
        message = JointState(name=names)
        self._positions.append((view_of(message, 'position', len(names)), part))
        self._velocities.append((view_of(message, 'velocity', len(names)), part))
        self._stamps.append(message.header.stamp)
        self._add(JointState, topic, message)

    def _trajectory(self, names: tuple[str, ...]) -> None:
        """One point a message, reached a period after it: stamp 0 means from now."""
        self._point = JointTrajectoryPoint()
        self._positions.append((view_of(self._point, 'positions', len(names)), self._order))
        self._velocities.append((view_of(self._point, 'velocities', len(names)), self._order))
        message = JointTrajectory(joint_names=list(names))
        message.points = [self._point]
        self._add(JointTrajectory, COMMAND_TOPICS['joint_trajectory'], message)

    def publish(self, stamp: int, dt: float, position: np.ndarray, velocity: np.ndarray,
                phases: np.ndarray) -> None:
        """Publish everything: stamp in ns, dt in s, rad and rad/s by joint, phases in cycles."""
        seconds, nanoseconds = divmod(stamp, 1_000_000_000)
        for time in self._stamps:
            time.sec = seconds
            time.nanosec = nanoseconds
        for view, part in self._positions:
            view[:] = position[part]
        for view, part in self._velocities:
            view[:] = velocity[part]
        self._phases[:] = phases
        if self._point is not None:
            self._point.time_from_start = Duration(sec=int(dt), nanosec=round(dt % 1 * 1e9))
        for publish, message in self._publish:
            publish(message)

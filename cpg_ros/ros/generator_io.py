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

"""The generator's topics: messages of every tick, measured joint angles, and cmd_vel."""

from collections.abc import Callable, Mapping, Sequence
import math
import threading
import time
from typing import Any

from cpg_ros.motion.pattern import Pattern
from cpg_ros.motion.plan import GaitPlan
from cpg_ros.motion.robot import Robot
from cpg_ros.networks.network import Network
from cpg_ros.ros.node.health import node_of, STEADY
from cpg_ros.ros.node.message_block import indices, MessageBlock, Template
from cpg_ros.ros.node.node_base import StartError
from cpg_ros.ros.node.parameters import Spec
from cpg_ros.ros.node.polled import best_effort, OVERRIDABLE, PolledSubscription
from geometry_msgs.msg import Twist, TwistStamped, WrenchStamped
import numpy as np
from rclpy.node import Node
from rclpy.qos import QoSProfile
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, MultiArrayDimension
from trajectory_msgs.msg import JointTrajectory, JointTrajectoryPoint

# The generator's messages: joint states, phases and commands every tick, and cells.

#: COMMAND_TOPICS: kind of command -> topic on which ros2_control's controllers listen by default.
COMMAND_TOPICS = {'joint_trajectory': 'joint_trajectory_controller/joint_trajectory',
                  'forward_position': 'forward_position_controller/commands'}
#: CELLS_PERIOD: period in which the cells are published, s; shorter than people can see.
CELLS_PERIOD = 0.02
#: STAMPED: parameter of all nodes with topics that have no stamps.
STAMPED = Spec(False, 'publish messages with stamps, too, where the usual ones have none',
               read_only=True)


class Outputs:
    """Publisher of joint states per leg and combined, leg phases, and ros2_control commands.

    Attributes:
        topics: those that move joints, resolved.

    """

    def __init__(self, node: Node, robot: Robot, combined_topic: str, command: str,
                 stamped: bool = False) -> None:
        """Prepare all messages; with ``stamped`` that of the phases with a stamp, too.

        Raises:
            StartError: the combined topic equals another one.

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
        positions, velocities, phases = indices(sizes)
        messages: list[tuple[str, Template]] = []
        start = 0
        for leg, joints in robot.legs.items():
            part = slice(start, start + len(joints))
            messages.append((f'{leg}/joint_states', joint_state(
                [joint.name for joint in joints], positions[part], velocities[part])))
            start = part.stop
        order = list(robot.order_indices)
        positions, velocities = positions[order], velocities[order]
        if combined_topic:
            messages.append((combined_topic, joint_state(robot.order, positions, velocities)))
        messages.append(('~/phase', labelled(tuple(robot.legs), phases)))
        if stamped:
            messages.append(('~/phase_stamped', joint_state(tuple(robot.legs), phases)))
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
        self.block = MessageBlock(node, sizes, messages)
        still = [node.resolve_topic_name(f'~/phase{end}') for end in ('', '_stamped')]
        self.topics = [topic for topic in self.block.topics if topic not in still]


def cells_block(node: Node, network: type[Network], state: int, stamped: bool = False
                ) -> MessageBlock:
    """Return the message ``~/cells``: a row for each variable of a cell, one for each rate.

    Rates are in model time; state is the address of a pointer to the numbers. With ``stamped``,
    ``~/cells_stamped`` has the same: variables as positions, rates as velocities.
    """
    rows = [*network.states, *(f'd{name}/dt' for name in network.states)]
    count = len(rows) * network.cells
    message = Float64MultiArray()
    message.layout.dim = [
        MultiArrayDimension(label=','.join(rows), size=len(rows), stride=count),
        MultiArrayDimension(label='cells', size=network.cells, stride=network.cells)]
    messages = [('~/cells', Template(message, numbers=[(message, 'data', np.arange(count))]))]
    if stamped:
        names = [f'{name}{cell + 1}' for name in network.states for cell in range(network.cells)]
        messages.append(('~/cells_stamped', joint_state(names, *np.split(np.arange(count), 2))))
    return MessageBlock(node, [count], messages).feed(state, period=CELLS_PERIOD)


def joint_state(names: Sequence[str], *parts: np.ndarray) -> Template:
    """Return a template of joint states.

    Args:
        names: of the joints.
        parts: indices in the block of positions, velocities and, optionally, efforts.

    """
    message = JointState(name=list(names))
    fields = zip(('position', 'velocity', 'effort'), parts, strict=False)
    return Template(message, [message.header.stamp],
                    numbers=[(message, name, part) for name, part in fields])


def labelled(names: tuple[str, ...], slots: np.ndarray) -> Template:
    """Return a template of an array with one number for each name, listed in its label."""
    message = Float64MultiArray()
    message.layout.dim = [MultiArrayDimension(label=','.join(names), stride=1, size=len(names))]
    return Template(message, numbers=[(message, 'data', slots)])


def foot_wrenches(legs: Sequence[str], places: np.ndarray, frames: Mapping[str, str]
                  ) -> list[tuple[str, Template]]:
    """Return the forces on the feet along z of frames by leg, one topic and message each."""
    messages = []
    for k, leg in enumerate(legs):
        message = WrenchStamped()
        message.header.frame_id = frames[leg]
        messages.append((f'{leg}/foot_contacts', Template(
            message, [message.header.stamp], numbers=[
                (message.wrench.force, 'z', places[k:k + 1])])))
    return messages


# The joint angles that the robot's own driver publishes.

#: MAX_AGE: up to which joint states count as the joints' present angles, s.
MAX_AGE = 1.0


class MeasuredPose:
    """Newest angles of the joints on a topic of joint states, read on demand.

    Attributes:
        topic: its resolved name.

    """

    def __init__(self, node: Node, robot: Robot, topic: str) -> None:
        self._index = {joint.name: k for k, joint in enumerate(robot.joints)}
        self._angles = np.full(len(self._index), math.nan)
        self._arrived = np.zeros(len(self._index), dtype=np.int64)
        # Several publishers may share the topic.
        self._subscription = PolledSubscription(node, JointState, topic, best_effort(8))
        self.topic = self._subscription.topic

    def receive(self, max_age: float = MAX_AGE) -> np.ndarray:
        """Return each joint's angle, rad, leg by leg; nan if older than ``max_age``, s."""
        for message, arrived in self._subscription.receive():
            for name, angle in zip(message.name, message.position, strict=False):
                if (k := self._index.get(name)) is not None and math.isfinite(angle):
                    self._angles[k], self._arrived[k] = angle, arrived
        return np.where(self._arrived > time.time_ns() - max_age * 1e9, self._angles, math.nan)

    def lacks(self, angles: np.ndarray) -> str:
        """Return why angles are not a complete pose of the robot, or ''."""
        missing = [name for name, k in self._index.items() if math.isnan(angles[k])]
        if len(missing) == len(self._index):
            return f'no joint states on {self.topic}'
        return f'{self.topic} has no angle of {missing[0]}' if missing else ''


#: How often the age of the last command is checked, s.
CHECK_PERIOD = 0.02
#: Time between two warnings of a kind, s.
WARNING_PERIOD = 5.0
#: Frames that are the robot's base by name, beside the parameter ``feedback.base_frame``; '' is
#: that of a publisher without frames.
BASE_FRAMES = '', 'base', 'base_link', 'base_footprint'
#: Largest speed to the side, m/s, which needs feedback.
MAX_LATERAL_SPEED = 0.2
#: Fraction of a gait's fastest speed below which the pattern changes back to it.
HYSTERESIS = 0.9


class CmdVel:
    """Steering of a pattern by the newest velocity command; the gait may change meanwhile."""

    def __init__(self, node: Node, pattern: Pattern, plan: GaitPlan, enabled: bool,
                 timeout: Callable[[], float], ramp: Callable[[], float],
                 closed: Callable[[], bool], faster: str, change: Callable[[str], None]) -> None:
        """Subscribe to ``cmd_vel``.

        Args:
            node: that subscribes; its parameter ``stamped_cmd_vel`` selects the type.
            pattern: to steer.
            plan: of the gait.
            enabled: whether the robot may walk.
            timeout: returns how long a command is valid, s.
            ramp: returns the duration of the ramp between stand and gait, s.
            closed: returns whether feedback is active.
            faster: gait for speeds beyond those of the others, or ''.
            change: requests a gait, which ``set_plan`` then gives.

        """
        self._plan, self._enabled = plan, enabled
        self._faster, self._change, self._requested = faster, change, ''
        #: The gait that was left for the faster one.
        self._slower: GaitPlan | None = None
        self._deciding = threading.Lock()
        self._node, self._pattern, self._timeout, self._ramp = node, pattern, timeout, ramp
        self._closed = closed
        # Speeds forward and to the left, m/s, and yaw rate, rad/s.
        self._target, self._when, self._stale = (0.0, 0.0, 0.0), -math.inf, True
        self._up = False
        self._log = node.get_logger()
        self._stamped = node.get_parameter('stamped_cmd_vel').value
        # Text on publishers of another type, whose messages do not arrive.
        self._misfit = ''
        node.create_subscription(
            TwistStamped if self._stamped else Twist, 'cmd_vel',
            self._receive_stamped if self._stamped else self._receive, QoSProfile(depth=10),
            qos_overriding_options=OVERRIDABLE)
        # A system clock that is set must not stop the robot, nor keep it going.
        node.create_timer(CHECK_PERIOD, self._check, clock=STEADY)

    @property
    def walking(self) -> bool:
        """Whether a valid command demands motion."""
        return self._enabled and not self._stale and self._target != (0.0, 0.0, 0.0)

    @property
    def motion(self) -> tuple[float, float, float]:
        """Present speeds forward and to the left, m/s, and yaw rate, rad/s."""
        if not self.walking:
            return 0.0, 0.0, 0.0
        speed, aside, turn = self._target
        slowest, fastest = self._plan.speeds
        return min(max(speed, slowest), fastest), aside, turn

    @property
    def state(self) -> str:
        """Command as text, for diagnostics."""
        if self._stale:
            return 'none'
        speed, aside, turn = self._target
        return f'{speed:.3g} m/s, {turn:.3g} rad/s' + (f', {aside:.3g} m/s to the left'
                                                       if aside else '')

    def _now(self) -> float:
        clock: Any = self._node.get_clock()
        return (clock if clock.ros_time_is_active else STEADY).now().nanoseconds * 1e-9

    def find_misfits(self) -> str:
        """Return who publishes commands of the other type, which do not arrive; log changes."""
        own, other = ('geometry_msgs/msg/TwistStamped', 'geometry_msgs/msg/Twist')[
            ::1 if self._stamped else -1]
        names = sorted({node_of(publisher)
                        for publisher in self._node.get_publishers_info_by_topic(
            self._node.resolve_topic_name('cmd_vel')) if publisher.topic_type == other})
        text = '' if not names else (
            f'cmd_vel is published as {other} by {", ".join(names)}, but this generator takes '
            f'{own}: set stamped_cmd_vel to {str(not self._stamped).lower()}')
        if text and text != self._misfit:
            self._log.warning(text)
        self._misfit = text
        return text

    def _receive_stamped(self, message: TwistStamped) -> None:
        """Accept a fresh command in the base's frame; a stamp of 0 counts as fresh."""
        stamp, frame = message.header.stamp, message.header.frame_id
        base = self._node.get_parameter('feedback.base_frame').value
        if frame not in (*BASE_FRAMES, base):
            self._log.warning(f"cmd_vel ignored: it is in the frame '{frame}', not in the base's "
                              f"'{base}' (feedback.base_frame)", once=True)
            return
        age = self._node.get_clock().now().nanoseconds * 1e-9 - stamp.sec - 1e-9 * stamp.nanosec
        if (stamp.sec or stamp.nanosec) and abs(age) > self._timeout():
            side = 'old' if age > 0.0 else 'ahead'
            self._log.warning(f'cmd_vel ignored: its stamp is {abs(age):.3g} s {side}; the clocks '
                              'of sender and generator must agree',
                              throttle_duration_sec=WARNING_PERIOD)
            return
        self._receive(message.twist)

    def _receive(self, message: Twist) -> None:
        speed, turn, aside = message.linear.x, message.angular.z, message.linear.y
        if not all(math.isfinite(value) for value in (speed, turn, aside)):
            self._log.warning(f'cmd_vel ignored: {speed} m/s forward, {aside} m/s to the left, '
                              f'{turn} rad/s are not all finite',
                              throttle_duration_sec=WARNING_PERIOD)
            return
        if aside and not self._closed():
            self._log.warning(f'cmd_vel asks for {aside:g} m/s to the left: without feedback this '
                              'robot walks forward, backward and in curves only',
                              throttle_duration_sec=WARNING_PERIOD)
            aside = 0.0
        elif abs(aside) > MAX_LATERAL_SPEED:
            self._log.warning(f'cmd_vel asks for {aside:g} m/s to the left: the range is '
                              f'{-MAX_LATERAL_SPEED:g} to {MAX_LATERAL_SPEED:g} m/s',
                              throttle_duration_sec=WARNING_PERIOD)
            aside = math.copysign(MAX_LATERAL_SPEED, aside)
        with self._deciding:
            self._target, self._when, self._stale = (speed, aside, turn), self._now(), False
            self._act()

    def _check(self) -> None:
        age = self._now() - self._when
        stale = not 0.0 <= age <= self._timeout()
        if stale == self._stale:
            return
        if stale and self.walking:
            self._log.warning(f'no cmd_vel for {age:.2g} s: stopping')
        with self._deciding:
            self._stale = stale
            self._act()

    def set_plan(self, plan: GaitPlan) -> None:
        """Steer a new gait."""
        with self._deciding:
            if self._plan.name != self._faster:
                self._slower = self._plan
            self._plan, self._requested = plan, ''
            self._act()

    def enable(self, enabled: bool) -> None:
        """Set whether the robot may walk at all."""
        with self._deciding:
            self._enabled = enabled
            self._act()

    def _act(self) -> None:
        walking = self.walking
        if walking:
            speed, _, turn = self._target
            slowest, fastest = self._plan.speeds
            if gait := self._gait_for(speed):
                self._requested = gait
                self._change(gait)
            elif not slowest <= speed <= fastest and not self._requested:
                self._log.warning(f"cmd_vel asks for {speed:g} m/s: the {self._plan.name}'s "
                                  f'range is {slowest:g} to {fastest:g} m/s',
                                  throttle_duration_sec=WARNING_PERIOD)
            self._pattern.steer(*self._plan.steer(speed, turn))
        if walking != self._up:
            self._up = walking
            self._pattern.enable(walking, self._ramp())

    def _gait_for(self, speed: float) -> str:
        """Return the gait to change to for a speed, m/s, or '' to stay; each is tried once."""
        if self._plan.name == self._faster:
            slower = self._slower
            gait = (slower.name if slower is not None and speed < HYSTERESIS * slower.speeds[1]
                    else '')
        else:
            gait = self._faster if speed > self._plan.speeds[1] else ''
        return '' if gait == self._requested else gait

    def end(self) -> None:
        """Stop steering: the pattern ramps down for the last time."""
        with self._deciding:
            self._enabled = self._up = False

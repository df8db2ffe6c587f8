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

"""The loop of a bridge: reads states and targets, steps the state machine, sends commands."""

from collections import deque
from collections.abc import Callable, Mapping
import math
import time
from typing import ClassVar

from cpg_ros.nodes.bridge_interface import RobotInterface
from cpg_ros.nodes.command_topics import Commands, KINDS
from cpg_ros.nodes.deadline_thread import Ticker
from cpg_ros.nodes.kp_scale import KpScaleSubscription
from cpg_ros.nodes.local_socket import address, listening, NameTaken
from cpg_ros.nodes.node_base import StartedNode, StartError
from cpg_ros.nodes.parameter_spec import fixed, Spec
from cpg_ros.nodes.polled_group import PolledSubscription
from cpg_ros.nodes.qos_profiles import command_qos, latched
from cpg_ros.nodes.watchdog_link import WatchdogLink
from cpg_ros.robots.robot import Robot
from cpg_ros.robots.robot_file import load_robot
from cpg_ros.safety.bridge_settings import BridgeSettings
from cpg_ros.safety.robot_state import JointCommand, RobotState
from cpg_ros.safety.supervisor import BridgeState, Supervisor
import numpy as np
from rclpy.impl.logging_severity import LoggingSeverity
from rclpy.parameter import Parameter
from rclpy.publisher import Publisher
from std_msgs.msg import String

#: At the end, the robot is damped for this long, s.
REST = 1.0


class BridgeLoop(StartedNode):
    """One thread reads states and targets and sends commands; requests wait for it.

    Attributes:
        interface: topics and messages of the robot.
        specs: of all parameters, see ``bridge_specs``.
        robot: of the robot file.
        supervisor: the state machine.
        dry: whether nothing is sent.
        topic: of the commands, resolved.
        received: number of states so far.
        sent: number of commands so far.
        watchdog: connection to the watchdog; None in a dry run.

    """

    interface: ClassVar[type[RobotInterface]]
    specs: ClassVar[Mapping[str, Spec]]

    def __init__(self, state: RobotState) -> None:
        """Declare the parameters, check them, and prepare to start.

        Args:
            state: into which the robot's states are read.

        Raises:
            CpgError: a parameter, the robot file or the messages cannot be used.

        """
        interface = self.interface
        # A real robot has no simulated time.
        super().__init__(interface.bridge_name(),
                         parameter_overrides=[Parameter('use_sim_time', value=False)])
        self._declare(fixed(self.specs))
        self._one_of('command', KINDS)
        value, period = self._value, 1.0 / self._value('rate')
        self.dry: bool = value('dry_run')
        command_type, state_type = interface.command_type(), interface.state_type()
        self.robot = load_robot(value('robot'))
        common = {'period': period, 'target_timeout': value('target_timeout'),
                  'state_timeout': value('state_timeout'), 'astray': math.inf if self.dry else 0.4,
                  'tracking_error': math.inf if self.dry else value('tracking_error'),
                  'tracking_time': value('tracking_time')}
        # Of what some robots do not measure, their bridges have no parameter.
        if 'tilt' in self.specs:
            common['tilt'] = math.radians(value('tilt'))
        if 'hottest' in self.specs:
            common['hottest'] = value('hottest')
        settings = self.make_settings(self.robot, common)
        self._order = np.array([self.robot.order.index(name) for name in settings.names])
        self._changes: deque[tuple[BridgeState, str]] = deque()
        self.supervisor = Supervisor(settings, state, self.make_command(),
                                     lambda *change: self._changes.append(change))
        self.topic = topic = self.resolve_topic_name(interface.command_topic)
        domain = self.context.get_domain_id()
        self._publisher: Publisher | None = None
        self.watchdog: WatchdogLink | None = None
        if not self.dry:
            try:
                self._lock = listening(address(interface.maker, 'bridge', domain, topic))
            except NameTaken as error:
                raise StartError(f'another bridge on this computer commands the robot on {topic} '
                                 f'in domain {domain} already: {error}') from error
            self._publisher = self.create_publisher(command_type, topic, command_qos())
            self.watchdog = WatchdogLink(interface, domain, self.get_namespace(), topic,
                                         period, value('watchdog_timeout')
                                         or value('state_timeout'))
        self._states = PolledSubscription(self, state_type, interface.state_topic,
                                          raw=interface.raw_states)
        self._commands = Commands(self, self.robot, value('command'), period,
                                  settings.stand.take(self._order.argsort()))
        self._kp_scale = KpScaleSubscription(self)
        self._every = (max(1, round(value('rate') / value('sensor_rate')))
                       if 'sensor_rate' in self.specs else 1)
        self._requests: deque[Callable[[float], None]] = deque()
        self._ending = self._new = False
        self.received = self.sent = 0
        self._state_publisher = self.create_publisher(String, '~/state', latched())
        self._state_publisher.publish(String(data=BridgeState.IDLE.value))
        self.ticker = Ticker(self, value('rate'), self._tick, lambda: None, self._fail,
                             lambda _: None)

    # -- what a bridge adds ---------------------------------------------------------------

    def make_settings(self, robot: Robot, common: dict[str, float]) -> BridgeSettings:
        """Return joints, gains, torques and poses, with ``common`` as further settings.

        Raises:
            CpgError: a parameter or the robot file cannot be used.

        """
        raise NotImplementedError

    def make_command(self) -> JointCommand:
        """Return a command to be filled; that of the interface, unless joints are configured."""
        return self.interface.make_command()

    def stop_pressed(self) -> str:
        """Return which stop button the last state reports as pressed, or ''."""
        return ''

    def publish_measurements(self, stamp: int) -> None:
        """Publish the last state, stamp in ns; at most at ``sensor_rate``."""

    # -- the thread -----------------------------------------------------------------------

    def _tick(self, dt: float, stamp: int) -> None:
        now, supervisor = time.monotonic(), self.supervisor
        self._take_state(now)
        self._take_targets(now)
        supervisor.kp_scale = self._kp_scale.take(now)
        while self._requests:
            self._requests.popleft()(now)
        # Before anything is sent: joints that have given way must not be driven back at once.
        if self.watchdog is not None and self.watchdog.acted():
            supervisor.damp(now, 'the watchdog has damped the robot: the bridge was silent')
        if supervisor.step(now):
            message = supervisor.command.encode()
            if self._publisher is not None:
                self._publisher.publish(message)
                self.sent += 1
            if self.watchdog is not None and (
                    fault := self.watchdog.tick(supervisor.damping, now)):
                supervisor.sit(now, fault)
        # The robot comes first.
        while self._changes:
            self._report(*self._changes.popleft())
        if self._new and not self.ticker.ticks % self._every:
            self.publish_measurements(stamp)
            self._new = False
        if self._ending and self._resting(now):
            self.stop.set()
            self.ticker.end()

    def _take_state(self, now: float) -> None:
        last = None
        for message, _ in self._states.take():
            last = message
            self.received += 1
        if last is not None and self.supervisor.robot.read(last):
            self._new = True
            self.supervisor.state_received(now)
            if reason := self.stop_pressed():
                self._halt(reason, now)

    def _take_targets(self, now: float) -> None:
        complete = self._commands.take()
        if self._commands.refused:
            self.supervisor.reject_target(self._commands.refused, now)
        if complete:
            self._commands.expect(0)
            self.supervisor.set_target(self._commands.angles[self._order], now)

    def _report(self, state: BridgeState, reason: str) -> None:
        """Log and publish a new state."""
        severity = {BridgeState.DAMPING: LoggingSeverity.ERROR,
                    BridgeState.SITTING: LoggingSeverity.WARN}
        self.get_logger().log(f'{state.value}: {reason}',
                              severity.get(state, LoggingSeverity.INFO))
        self._state_publisher.publish(String(data=state.value))

    def _halt(self, reason: str, now: float) -> None:
        """Damp at once, and cancel a start under way."""
        self._cancel_start(reason)
        self.supervisor.damp(now, reason)

    def _cancel_start(self, reason: str) -> None:
        """Cancel a start under way."""
        raise NotImplementedError

    def _resting(self, now: float) -> bool:
        state = self.supervisor.state
        return state is BridgeState.IDLE or (state is BridgeState.DAMPING
                                             and self.supervisor.time_in_state(now) > REST)

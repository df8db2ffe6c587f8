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

"""The base class of bridges, which drive a robot from a generator's output; start sequences.

A bridge adds its robot's messages, limits and numbers: .github/CONTRIBUTING.md, section
Add a bridge.
"""

from collections import deque
from collections.abc import Callable, Mapping, Sequence
import math
import signal
import threading
import time
from typing import Any, ClassVar

from cpg_ros.common.errors import CpgError
from cpg_ros.motion.description import read_urdf_text
from cpg_ros.motion.robot import Robot
from cpg_ros.motion.robot_file import load_robot
from cpg_ros.ros.bridges.robot_state import BridgeSettings, JointCommand, RobotState
from cpg_ros.ros.bridges.supervisor import ACTIVE_STATES, BridgeState, Supervisor
from cpg_ros.ros.bridges.watchdog_link import (
    address,
    listening,
    NameTaken,
    RobotInterface,
    WatchdogLink,
)
from cpg_ros.ros.command_topics import (
    Commands,
    FeedforwardSubscription,
    KINDS,
    KpScaleSubscription,
)
from cpg_ros.ros.node.health import Health, HealthPublisher, others_on, STEADY, UNKNOWN_NODE
from cpg_ros.ros.node.node_base import StartedNode, StartError, termination_signals
from cpg_ros.ros.node.parameters import fixed, Spec
from cpg_ros.ros.node.polled import command_qos, latched_text, PolledSubscription
from cpg_ros.ros.node.ticker import Ticker
from diagnostic_msgs.msg import DiagnosticStatus
import numpy as np
from rclpy.parameter import Parameter
from rclpy.publisher import Publisher
from std_msgs.msg import String
from std_srvs.srv import Trigger

# The start of a bridge, step by step, in a thread of its own; a step that fails ends it.

#: Sleeps for some seconds; raises StartRefused once the start is cancelled.
Wait = Callable[[float], None]


class StartRefused(CpgError):
    """The robot is not started; the message is one line for the user."""


class StartSequence(threading.Thread):
    """Carries out steps one after another."""

    def __init__(self, steps: Sequence[Callable[[Wait], None]], on_end: Callable[[str], None]
                 ) -> None:
        """Carry out ``steps``, which may raise StartRefused; then call ``on_end``.

        Its argument is the reason why the robot was not started, or ''.
        """
        super().__init__(name='start', daemon=True)
        self._steps, self._on_end = steps, on_end
        self._cancelled = threading.Event()
        self._reason = ''

    @property
    def cancelled(self) -> bool:
        """Whether the start was cancelled."""
        return self._cancelled.is_set()

    def cancel(self, reason: str) -> None:
        """Cancel the start at its next wait or step."""
        self._reason = reason
        self._cancelled.set()

    def run(self) -> None:
        """Carry out the steps."""
        reason = ''
        try:
            for step in self._steps:
                self._wait(0.0)
                step(self._wait)
        except StartRefused as error:
            reason = str(error)
        except Exception as error:
            # Whatever else goes wrong, the robot has not been touched.
            reason = f'{type(error).__name__}: {error}'
        self._on_end(reason)

    def _wait(self, seconds: float) -> None:
        if self._cancelled.wait(seconds):
            raise StartRefused(self._reason)


#: REST_TIME: time in damping, s, after which the robot is at rest and the bridge may end.
REST_TIME = 1.0
#: CHECK_PERIOD: period in which the graph is checked for others who command the robot, s.
CHECK_PERIOD = 0.1
#: STATE_TIMEOUT: longest time that a start waits for the first robot state, s.
STATE_TIMEOUT = 10.0
#: DISCOVERY_TIME: time after which two programs on a network have discovered each other, s.
DISCOVERY_TIME = 1.0
#: LEASE_TIMEOUT: time after which the graph no longer lists a bridge that was killed, s.
LEASE_TIMEOUT = 25.0
#: DEBOUNCE_TIME: time, s, within which signals count as one: Ctrl-C in a terminal signals the
#: launch process as well, which sends the signal again.
DEBOUNCE_TIME = 0.5


class BridgeNode(StartedNode):
    """Starts, stops and monitors a thread that reads states and targets and sends commands.

    A subclass sets ``interface`` and ``specs`` and overrides ``make_state`` and ``make_settings``.
    The other public methods have defaults.

    Attributes:
        interface: topics and messages of the robot; ``make_state`` may set another one.
        specs: of all parameters, see ``bridge_specs``.
        state_hint: what to check if the robot sends no state, added to the message.
        robot: of the robot file.
        supervisor: the state machine.
        dry: whether nothing is sent.
        topic: of the commands, resolved.
        received: number of states so far.
        sent: number of commands so far.
        watchdog: connection to the watchdog; None in a dry run.

    """

    interface: type[RobotInterface]
    specs: ClassVar[Mapping[str, Spec]]
    state_hint: ClassVar[str] = ''

    def __init__(self) -> None:
        """Declare the parameters, check them, and prepare to start.

        Raises:
            CpgError: a parameter, the robot file or the messages cannot be used.

        """
        # A real robot has no simulated time.
        super().__init__(self.interface.bridge_name(),
                         parameter_overrides=[Parameter('use_sim_time', value=False)])
        self._declare(fixed(self.specs))
        self._one_of('command', KINDS)
        value, period = self._value, 1.0 / self._value('rate')
        state = self.make_state()
        interface = self.interface
        self.dry: bool = value('dry_run')
        command_type, state_type = interface.command_type(), interface.state_type()
        self.robot = load_robot(value('robot'))
        settings = self.make_settings(self.robot, self._common_settings())
        order = self.robot.order
        # Joints that belong to no leg stay at the stand.
        self._targets = settings.stand.copy()
        self._driven = [k for k, name in enumerate(settings.names) if name in order]
        self._order = np.array([order.index(settings.names[k]) for k in self._driven])
        self._changes: deque[tuple[BridgeState, str]] = deque()
        self.supervisor = Supervisor(settings, state, self.make_command(),
                                     lambda *change: self._changes.append(change))
        self.topic = self.resolve_topic_name(interface.command_topic)
        self._publisher: Publisher | None = None
        self.watchdog: WatchdogLink | None = None
        if not self.dry:
            self._connect(command_type, period)
        self._states = PolledSubscription(self, state_type, interface.state_topic,
                                          raw=interface.raw_states)
        self._commands = Commands(self, self.robot, value('command'), period,
                                  settings.stand[self._driven].take(self._order.argsort()))
        self._kp_scale = KpScaleSubscription(self)
        self._feedforward: FeedforwardSubscription | None = None
        self._followed = list(self._commands.topics)
        # Bridges of motors that take no torques lack the parameter.
        if 'feedforward' in self.specs and (fraction := value('feedforward')):
            self._feedforward = FeedforwardSubscription(self, settings.names,
                                                        fraction * settings.torque)
            self._followed.append(self._feedforward.topic)
        self._every = (max(1, round(value('rate') / value('sensor_rate')))
                       if 'sensor_rate' in self.specs else 1)
        self._requests: deque[Callable[[float], None]] = deque()
        self._ending = self._new = False
        self.received = self.sent = 0
        self._state_publisher = latched_text(self, '~/state', BridgeState.IDLE.value)
        if urdf := value('urdf'):
            self._description = latched_text(self, 'robot_description', read_urdf_text(urdf))
        self.ticker = Ticker(self, value('rate'), self._tick, lambda: None, self._fail,
                             lambda _: None)
        self._start: StartSequence | None = None
        self._refusal = self._hazard = self._conflict = ''
        self._ended_at = 0.0
        self.create_service(Trigger, '~/stop', self._stop)
        self.create_service(Trigger, '~/damp', self._damp)
        self.create_service(Trigger, '~/start', self._start_again)
        self._before = 0, 0, 0
        self._health = HealthPublisher(self, 'robot', self.robot.name, self._report_health)
        self._timer = self.create_timer(CHECK_PERIOD, self._check_graph, clock=STEADY)
        self._warn_of_unknown()

    def _common_settings(self) -> dict[str, float]:
        """Return the settings that are parameters of every bridge."""
        value = self._value
        common = {'period': 1.0 / value('rate'), 'target_timeout': value('target_timeout'),
                  'state_timeout': value('state_timeout'), 'astray': math.inf if self.dry else 0.4,
                  'tracking_error': math.inf if self.dry else value('tracking_error'),
                  'tracking_time': value('tracking_time')}
        # Bridges of robots without such a measurement lack the parameter.
        if 'tilt' in self.specs:
            common['tilt'] = math.radians(value('tilt'))
        if 'hottest' in self.specs:
            common['hottest'] = value('hottest')
        return common

    def _connect(self, command_type: type, period: float) -> None:
        """Create the command publisher and the watchdog's link; refuse a second bridge."""
        interface, topic, domain = self.interface, self.topic, self.context.get_domain_id()
        try:
            self._lock = listening(address(interface.maker, 'bridge', domain, topic))
        except NameTaken as error:
            raise StartError(f'another bridge on this computer commands the robot on {topic} '
                             f'in domain {domain} already: {error}') from error
        self._publisher = self.create_publisher(command_type, topic, command_qos())
        self.watchdog = WatchdogLink(
            interface, domain, self.get_namespace(), topic, period,
            self._value('watchdog_timeout') or self._value('state_timeout'))

    # -- what a bridge adds ---------------------------------------------------------------

    def make_state(self) -> RobotState:
        """Return the state into which the robot's messages are read; parameters are declared."""
        raise NotImplementedError

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

    @property
    def title(self) -> str:
        """Name of the robot in the log."""
        return self.robot.name

    def prepare(self, wait: Wait) -> None:
        """Prepare the robot for commands, such as by ending its own motion modes.

        Called at every start, in a thread of its own; ``wait`` sleeps, s.

        Raises:
            StartRefused: the robot cannot be commanded, or the start was cancelled.

        """

    def graph_hazard(self) -> str:
        """Return what on the network endangers the robot, and what to do, or ''."""
        return ''

    def publish_slow_measurements(self, stamp: int) -> None:
        """Publish slow measurements, such as the battery, once a second; stamp in ns."""

    def measured_values(self) -> Mapping[str, object]:
        """Return values for /diagnostics, such as temperatures, by name."""
        return {}

    def dry_report(self) -> str:
        """Return what the last command would demand of the motors, for the log of a dry run."""
        command, robot = self.supervisor.command, self.supervisor.robot
        torque = command.kp * (command.q - robot.q) - command.kd * robot.dq + command.tau
        return f'the largest torque would be {abs(torque).max():.1f} N m'

    # -- the thread -----------------------------------------------------------------------

    def _tick(self, dt: float, stamp: int) -> None:
        now, supervisor = time.monotonic(), self.supervisor
        self._receive_state(now)
        self._receive_targets(now)
        supervisor.kp_scale = self._kp_scale.receive(now)
        if self._feedforward is not None:
            supervisor.feedforward = self._feedforward.receive(
                now, supervisor.state is BridgeState.FOLLOWING)
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
                    fault := self.watchdog.tick(supervisor.damping, supervisor.command.echo,
                                                now)):
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

    def _receive_state(self, now: float) -> None:
        last = None
        for message, _ in self._states.receive():
            last = message
            self.received += 1
        if last is not None and self.supervisor.robot.read(last):
            self._new = True
            self.supervisor.command.echo[:] = self.supervisor.robot.echo
            self.supervisor.state_received(now)
            if reason := self.stop_pressed():
                self._halt(reason, now)

    def _receive_targets(self, now: float) -> None:
        complete = self._commands.receive()
        if self._commands.refused:
            self.supervisor.reject_target(self._commands.refused, now)
        if complete:
            self._commands.expect(0)
            self._targets[self._driven] = self._commands.angles[self._order]
            self.supervisor.set_target(self._targets, now)

    def _report(self, state: BridgeState, reason: str) -> None:
        """Log and publish a new state."""
        logger, text = self.get_logger(), f'{state.value}: {reason}'
        # rclpy lets a place in the code have one severity only.
        if state is BridgeState.DAMPING:
            logger.error(text)
        elif state is BridgeState.SITTING:
            logger.warning(text)
        else:
            logger.info(text)
        self._state_publisher.publish(String(data=state.value))

    def _halt(self, reason: str, now: float) -> None:
        """Damp at once, and cancel a start under way."""
        self._cancel_start(reason)
        self.supervisor.damp(now, reason)

    def _resting(self, now: float) -> bool:
        state = self.supervisor.state
        return state is BridgeState.IDLE or (state is BridgeState.DAMPING
                                             and self.supervisor.time_in_state(now) > REST_TIME)

    # -- start ----------------------------------------------------------------------------

    def _begin_start(self) -> None:
        self._start = StartSequence(
            [self._await_state, self._check_publishers, self._start_watchdog, self.prepare,
             self._check_publishers, self._rise], self._started)
        self._start.start()

    def _started(self, refusal: str) -> None:
        self._start, self._refusal = None, refusal
        if refusal:
            self.get_logger().error(f'not started: {refusal}')

    def log_step(self, text: str) -> None:
        """Log a step of the start."""
        self.get_logger().info(f'start: {text}')

    def _await_state(self, wait: Wait) -> None:
        end = time.monotonic() + STATE_TIMEOUT
        while not self.received:
            if time.monotonic() > end:
                name = self.interface.state_type().__name__
                raise StartRefused(f'no {name} for {STATE_TIMEOUT:g} s{self.state_hint}')
            wait(0.02)
        self.log_step('receiving robot state')

    def _others(self) -> str:
        """Return the other nodes that command the robot, or ''."""
        return others_on(self, self.topic, int(not self.dry), self._value('own_publishers'),
                         f'{self.get_namespace().rstrip("/")}/{self.interface.watchdog_name()}')

    def _check_publishers(self, wait: Wait) -> None:
        if self._hazard:
            raise StartRefused(self._hazard)
        end, logged = time.monotonic() + LEASE_TIMEOUT, False
        while (conflict := self._find_conflict())[0]:
            text, of_one_name = conflict
            if not of_one_name or time.monotonic() > end:
                raise StartRefused(text)
            if not logged:
                self.log_step(f'waiting until the middleware drops a node that was killed: {text}')
            logged = True
            wait(0.1)
        self.log_step('no other command publisher')

    def _start_watchdog(self, wait: Wait) -> None:
        if self.watchdog is not None and (refusal := self.watchdog.start()):
            raise StartRefused(refusal)
        # Let the robot discover this publisher before it is needed.
        wait(DISCOVERY_TIME)

    def _rise(self, wait: Wait) -> None:
        """Request the robot to stand up, on the thread that commands."""
        answer: deque[str] = deque()
        start = self._start

        def rise(now: float) -> None:
            standing = start is not None and not start.cancelled and not self._ending
            answer.append(self.supervisor.rise(now) if standing else 'it is stopped')

        self._requests.append(rise)
        while not answer:
            if self.stop.wait(0.001):
                raise StartRefused('the bridge ends')
        if answer[0]:
            raise StartRefused(answer[0])

    # -- services and timers --------------------------------------------------------------

    def _stop(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        """Sit down, then damp, in any state."""
        state = self.supervisor.state
        message = ('it sits down, then damps' if state in ACTIVE_STATES else
                   'the start is cancelled' if self._start is not None else f'it is {state.value}')
        # Cancel here, not in the loop's thread, which might cancel a start that is requested
        # later.
        self._cancel_start('~/stop')
        self._requests.append(lambda now: self.supervisor.sit(now, '~/stop'))
        response.success, response.message = True, message
        return response

    def _damp(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        """Damp at once, in any state."""
        self._cancel_start('~/damp')
        self._requests.append(lambda now: self.supervisor.damp(now, '~/damp'))
        response.success, response.message = True, 'damping'
        return response

    def _start_again(self, request: Trigger.Request, response: Trigger.Response
                     ) -> Trigger.Response:
        state = self.supervisor.state
        if state is BridgeState.HANGING and not self._ending:
            self._requests.append(self.supervisor.stand)
            response.success, response.message = True, 'following targets'
            return response
        if state in ACTIVE_STATES or self._start is not None or self._ending:
            response.message = ('it is being started already' if self._start is not None else
                                f'it is {state.value}')
            return response
        self._begin_start()
        response.success, response.message = True, 'starting: ~/state and the log show progress'
        return response

    def _check_graph(self) -> None:
        """Log network hazards; sit down if another node commands the robot."""
        if (hazard := self.graph_hazard()) and not self._hazard:
            self._hazard = hazard
            self.get_logger().error(hazard)
        before, (self._conflict, _) = self._conflict, self._find_conflict()
        if self._conflict and self.supervisor.state in ACTIVE_STATES:
            reason = self._conflict
            self._requests.append(lambda now: self.supervisor.sit(now, reason))
        # The name of a node may be known later than its publisher.
        if self._conflict and self._conflict != before and UNKNOWN_NODE in before:
            self.get_logger().error(self._conflict)

    def _find_conflict(self) -> tuple[str, bool]:
        """Return a line on other nodes that command the robot or publish targets, '' for none.

        The second value tells whether all of them have one name: a node that was killed and
        started again is listed twice until the middleware forgets its first instance.
        """
        if names := self._others():
            return (f'another node commands the robot: {names}',
                    names == self.get_fully_qualified_name())
        for topic in self._followed if self._value('exclusive') else ():
            if names := others_on(self, topic, 0, 1):
                return (f'{topic} is published by {names}: only one may publish it (exclusive)',
                        len(set(names.split(', '))) == 1)
        return '', False

    def _report_health(self) -> Health:
        """Publish slow measurements; return the level, its text and the values of diagnostics.

        ERROR while the robot sits down or is damped, or was not started; WARN while it is silent.
        """
        supervisor, ticker, before = self.supervisor, self.ticker, self._before
        self._before = counts = ticker.ticks, self.received, self.sent
        ticks, received, sent = (new - old for new, old in zip(counts, before, strict=True))
        state = supervisor.state
        if received:
            self.publish_slow_measurements(self.get_clock().now().nanoseconds)
        if self.dry and state is not BridgeState.IDLE:
            self.get_logger().info(f'dry run: {state.value}, {self.dry_report()}')
        if state in (BridgeState.DAMPING, BridgeState.SITTING):
            level, text = DiagnosticStatus.ERROR, f'{state.value}: {supervisor.reason}'
            if self._conflict and self._conflict not in text:
                text += f'; {self._conflict}'
        elif self._refusal and state is BridgeState.IDLE:
            level, text = DiagnosticStatus.ERROR, f'not started: {self._refusal}'
        elif not received:
            level, text = DiagnosticStatus.WARN, 'no robot state received'
        else:
            level, text = DiagnosticStatus.OK, state.value + ' (dry run)' * self.dry
        return level, text, {
            'phase': state.value, 'ticks in the last second': ticks,
            'states in the last second': received, 'commands in the last second': sent,
            'late ticks': ticker.late, 'dropped ticks': ticker.dropped,
            'worst delay of a tick [ms]': f'{1e3 * ticker.worst:.3f}',
            'largest tracking error [rad]': supervisor.tracking.worst,
            'largest feed-forward torque [N m]': f'{abs(supervisor.feedforward).max():.1f}',
            **self.measured_values()}

    # -- beginning and end ----------------------------------------------------------------

    def begin(self) -> None:
        """Start the ticks; with autostart, also begin to raise the robot to its stand."""
        for number in termination_signals():
            signal.signal(number, self._leave)
        self.get_logger().info(
            f"{'dry run: ' * self.dry}a {self.title} at {self._value('rate'):g} Hz; "
            'commands from ' + ', '.join(self._followed))
        self.ticker.start()
        if self._value('autostart'):
            self._begin_start()

    def _leave(self, number: int, _: Any) -> None:
        """Sit down, damp and end at a signal; damp at once at a second one."""
        name, now = signal.Signals(number).name, time.monotonic()
        again, self._ending = self._ending, True
        if again and now < self._ended_at + DEBOUNCE_TIME:
            return
        self._ended_at = now
        self._requests.append(lambda now: self._halt(f'{name} again', now) if again
                              else self._sit_down(name, now))

    def _sit_down(self, reason: str, now: float) -> None:
        self._cancel_start(reason)
        self.supervisor.sit(now, reason)

    def _cancel_start(self, reason: str) -> None:
        # Read once: the thread of the start clears it at its end.
        if (start := self._start) is not None:
            start.cancel(reason)

    def finish(self) -> None:
        """End the threads; end the watchdog, too, unless the bridge failed."""
        self.ticker.end()
        self.ticker.join(timeout=1.0)
        self._cancel_start('the bridge ends')
        if self.watchdog is not None and self.failure is None:
            self.watchdog.end()

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

"""The node ``unitree_bridge``: leads a Unitree robot by what a generator publishes."""

from collections import deque
from collections.abc import Callable
import math
import signal
import sys
import time
from typing import Any

from cpg_ros.errors import CpgError
from cpg_ros.nodes.command_topics import Commands, KINDS
from cpg_ros.nodes.deadline_thread import Ticker
from cpg_ros.nodes.log_queue import QUEUE
from cpg_ros.nodes.node_base import asked_for_help, run, StartedNode, StartError
from cpg_ros.nodes.shutdown import endings
from cpg_ros.nodes.unitree.interfaces import message
from cpg_ros.nodes.unitree.local_socket import address, listening, NameTaken
from cpg_ros.nodes.unitree.parameters import SPECS
from cpg_ros.nodes.unitree.robot_graph import best_effort, BRIDGE, Others, quality
from cpg_ros.nodes.unitree.sensors import Sensors
from cpg_ros.nodes.unitree.start import Start
from cpg_ros.nodes.unitree.watchdog_link import WatchdogLink
from cpg_ros.nodes.unserved import subscribe, taken
from cpg_ros.robots.robot_file import load_robot
from cpg_ros.unitree.low_state import BUTTONS
from cpg_ros.unitree.models import MODELS
from cpg_ros.unitree.participants import Announcements
from cpg_ros.unitree.settings import places, settings_of
from cpg_ros.unitree.supervisor import DRIVEN, Phase, Supervisor
from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.clock import Clock
from rclpy.clock_type import ClockType
from rclpy.impl.logging_severity import LoggingSeverity
from rclpy.parameter import Parameter
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import String
from std_srvs.srv import Trigger

#: How often others who command the robot are looked for, s.
LOOK = 0.25
#: At the end the robot is damped for this long, s.
REST = 1.0


class UnitreeBridge(StartedNode):
    """One thread reads states and targets and sends commands; what others ask waits for it."""

    def __init__(self) -> None:
        """Declare everything, check it, and be ready to start.

        Raises:
            StartError: a parameter, the robot file or the messages cannot be used.

        """
        # A real robot knows no other time.
        super().__init__(BRIDGE, parameter_overrides=[Parameter('use_sim_time', value=False)])
        for name, spec in SPECS.items():
            self._declare(name, spec.fixed())
        for name, allowed in (('command', KINDS), ('model', tuple(MODELS)),
                              ('stop_button', tuple(BUTTONS))):
            self._one_of(name, allowed)
        value, period = self._value, 1.0 / self._value('rate')
        try:
            kinds = message('unitree_go/LowCmd'), message('unitree_go/LowState')
            message('unitree_api/Request')
            robot = load_robot(value('robot'))
            settings = settings_of(
                robot, MODELS[value('model')], list(value('kp')), list(value('kd')),
                value('torque_factor'), period=period, tilt=math.radians(value('tilt')),
                target_timeout=value('target_timeout'), state_timeout=value('state_timeout'),
                hottest=value('hottest'), astray=math.inf if value('dry_run') else 0.4)
        except CpgError as error:
            raise StartError(str(error)) from error
        self._order = places(robot)
        self._button = BUTTONS[value('stop_button')]
        self._changes: deque[tuple[Phase, str]] = deque()
        self._supervisor = Supervisor(settings, lambda *change: self._changes.append(change))
        topic = self.resolve_topic_name('/lowcmd')
        self._dry, domain = value('dry_run'), self.context.get_domain_id()
        self._publisher: Publisher | None = None
        self._watchdog: WatchdogLink | None = None
        if not self._dry:
            try:
                self._lock = listening(address('bridge', domain, topic))
            except NameTaken as error:
                raise StartError(f'another bridge on this computer commands the robot on {topic} '
                                 f'in domain {domain} already: {error}') from error
            self._publisher = self.create_publisher(kinds[0], topic, quality())
            self._watchdog = WatchdogLink(domain, topic, period)
        self._announcements = Announcements(domain)
        self._harmful = ''
        self._others = Others(self, topic, int(not self._dry), value('own_publishers'))
        self._states = subscribe(self, kinds[1], '/lowstate', best_effort(), raw=True)
        self._commands = Commands(self, robot, value('command'), period,
                                  settings.stand.take(self._order.argsort()))
        self._sensors = Sensors(self, robot, self._supervisor.state)
        self._every = max(1, round(value('rate') / value('sensor_rate')))
        self._requests: deque[Callable[[float], None]] = deque()
        self._start: Start | None = None
        self._refused = ''
        self._ending = False
        self._new, self._received, self._sent, self._before = False, 0, 0, (0, 0, 0)
        self._phase = self.create_publisher(String, '~/state', QoSProfile(
            depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL))
        self._phase.publish(String(data=Phase.IDLE.value))
        self.create_service(Trigger, '~/stop', self._stop)
        self.create_service(Trigger, '~/start', self._start_again)
        self.ticker = Ticker(self, value('rate'), self._tick, lambda: None, self._fail,
                             lambda _: None)
        self._steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._timers = [self.create_timer(LOOK, self._look, clock=self._steady),
                        self.create_timer(1.0, self._health, clock=self._steady)]
        self._warn_of_unknown()

    def _tell(self, phase: Phase, reason: str) -> None:
        """Say what the robot is made to do now, and why."""
        severity = {Phase.DAMPING: LoggingSeverity.ERROR, Phase.SITTING: LoggingSeverity.WARN}
        self.get_logger().log(f'{phase.value}: {reason}',
                              severity.get(phase, LoggingSeverity.INFO))
        self._phase.publish(String(data=phase.value))

    # -- the thread -----------------------------------------------------------------------

    def _tick(self, dt: float, stamp: int) -> None:
        now, supervisor = time.monotonic(), self._supervisor
        self._take_state(now)
        self._take_targets(now)
        while self._requests:
            self._requests.popleft()(now)
        if supervisor.step(now):
            sealed = supervisor.command.sealed()
            if self._publisher is not None:
                self._publisher.publish(sealed)
                self._sent += 1
            if self._watchdog is not None and (
                    wrong := self._watchdog.tick(supervisor.damping, now)):
                supervisor.sit(now, wrong)
        # The robot comes first.
        while self._changes:
            self._tell(*self._changes.popleft())
        if self._new and not self.ticker.ticks % self._every:
            self._sensors.publish(stamp)
            self._new = False
        if self._ending and self._resting(now):
            self.stop.set()
            self.ticker.end()

    def _take_state(self, now: float) -> None:
        last = None
        for found, _ in taken(self._states):
            last = found
            self._received += 1
        if last is not None and self._supervisor.state.read(last):
            self._new = True
            self._supervisor.heard(now)
            if self._supervisor.state.buttons & self._button:
                self._halt('the button of the wireless remote', now)

    def _take_targets(self, now: float) -> None:
        complete = self._commands.take()
        if self._commands.refused:
            self._supervisor.refuse(self._commands.refused, now)
        if complete:
            self._commands.expect(0)
            self._supervisor.ask(self._commands.angles[self._order], now)

    def _halt(self, reason: str, now: float) -> None:
        """Stop at once, and whatever was about to start."""
        self._give_up(reason)
        self._supervisor.damp(now, reason)

    def _give_up(self, reason: str) -> None:
        # Read once: the thread that starts forgets itself at its end.
        if (start := self._start) is not None:
            start.give_up(reason)

    def _resting(self, now: float) -> bool:
        phase = self._supervisor.phase
        return phase is Phase.IDLE or (phase is Phase.DAMPING
                                       and self._supervisor.since(now) > REST)

    # -- what others ask ------------------------------------------------------------------

    def _stop(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self._requests.append(lambda now: self._halt('~/stop', now))
        response.success, response.message = True, 'damping'
        return response

    def _start_again(self, request: Trigger.Request, response: Trigger.Response
                     ) -> Trigger.Response:
        phase = self._supervisor.phase
        if phase in DRIVEN or self._start is not None or self._ending:
            response.message = ('it is being started already' if self._start is not None else
                                f'it is {phase.value}')
            return response
        self._begin_start()
        response.success, response.message = True, 'starting: ~/state and the log say how it goes'
        return response

    def _begin_start(self) -> None:
        switch = self._value('motion_switcher')
        if switch and self._dry:
            self.get_logger().info('dry run: CheckMode, StandDown and ReleaseMode are not sent')
        watchdog = self._watchdog
        self._start = Start(self, self._others, lambda: self._harmful, lambda: self._received > 0,
                            watchdog.start if watchdog is not None else str, self._rise,
                            switch and not self._dry, self._started)
        self._start.start()

    def _rise(self) -> str:
        """Let the thread that commands begin, for the one that starts; return why not, or ''."""
        answer: deque[str] = deque()
        start = self._start

        def rise(now: float) -> None:
            wanted = start is not None and not start.given_up and not self._ending
            answer.append(self._supervisor.rise(now) if wanted else 'it is stopped')

        self._requests.append(rise)
        while not answer:
            if self.stop.wait(0.001):
                return 'the bridge ends'
        return answer[0]

    def _started(self, reason: str) -> None:
        self._start, self._refused = None, reason
        if reason:
            self.get_logger().error(f'not started: {reason}')

    def _look(self) -> None:
        """See whether somebody else commands the robot, or would crash its software."""
        if (found := self._announcements.look()) and not self._harmful:
            self._harmful = found
            self.get_logger().error(f'{found} is on this network: it crashes the 0.10 in '
                                    "Unitree's firmware; stop it")
        if self._supervisor.phase in DRIVEN and (found := self._others.found()):
            reason = f'the robot is commanded by {found}, too'
            self._requests.append(lambda now: self._supervisor.sit(now, reason))

    # -- its health -----------------------------------------------------------------------

    def _health(self) -> None:
        supervisor, ticker = self._supervisor, self.ticker
        before = self._before
        self._before = counts = ticker.ticks, self._received, self._sent
        ticks, received, sent = (new - old for new, old in zip(counts, before, strict=True))
        phase = supervisor.phase
        if phase in (Phase.DAMPING, Phase.SITTING):
            level, text = DiagnosticStatus.ERROR, f'{phase.value}: {supervisor.reason}'
        elif self._refused and phase is Phase.IDLE:
            level, text = DiagnosticStatus.ERROR, f'not started: {self._refused}'
        elif not received:
            level, text = DiagnosticStatus.WARN, 'the robot is not heard'
        else:
            level, text = DiagnosticStatus.OK, phase.value + ' (dry run)' * self._dry
        self._sensors.publish_health(level, text, {
            'phase': phase.value, 'ticks in the last second': ticks,
            'states in the last second': received, 'commands in the last second': sent,
            'late ticks': ticker.late, 'dropped ticks': ticker.dropped,
            'worst delay of a tick [ms]': f'{1e3 * ticker.worst:.3f}',
            'log lines dropped': QUEUE.dropped})
        if received:
            self._sensors.publish_battery(self.get_clock().now().nanoseconds)
        if self._dry and phase is not Phase.IDLE:
            command, state = supervisor.command, supervisor.state
            torque = command.kp * (command.q - state.q) - command.kd * state.dq
            self.get_logger().info(f'dry run: {phase.value}, the largest torque would be '
                                   f'{abs(torque).max():.1f} N m')

    # -- beginning and end ----------------------------------------------------------------

    def begin(self) -> None:
        """Start the thread, and lead the robot to its stand unless that waits for ~/start."""
        for number in endings():
            signal.signal(number, self._leave)
        self.get_logger().info(
            f"{'dry run: ' * self._dry}a {self._value('model')} at {self._value('rate'):g} Hz; "
            'commands from ' + ', '.join(self._commands.topics))
        self.ticker.start()
        if self._value('autostart'):
            self._begin_start()

    def _leave(self, number: int, _: Any) -> None:
        """Sit down and damp, then end; asked once more, damp at once."""
        name = signal.Signals(number).name
        again, self._ending = self._ending, True
        self._requests.append(lambda now: self._halt(f'{name} again', now) if again
                              else self._sit_down(name, now))

    def _sit_down(self, reason: str, now: float) -> None:
        self._give_up(reason)
        self._supervisor.sit(now, reason)

    def finish(self) -> None:
        """End the threads; the watchdog, too, where the robot rests."""
        self.ticker.end()
        self.ticker.join(timeout=1.0)
        self._give_up('the bridge ends')
        self._announcements.close()
        if self._watchdog is not None and self.failure is None:
            self._watchdog.end()


def main(args: list[str] | None = None) -> int:
    """Run the node until a signal ends it; return the exit code."""
    code = asked_for_help(BRIDGE, 'Leads a Unitree robot by what a generator publishes.', SPECS,
                          args)
    return run(UnitreeBridge, BRIDGE, args) if code is None else code


if __name__ == '__main__':
    sys.exit(main())

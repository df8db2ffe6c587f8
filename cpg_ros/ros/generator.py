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

"""The generator node, which publishes joint states of a gait in real time."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager, ExitStack
import ctypes
from functools import partial
import sys
import time
from typing import Any

from cpg_ros.feedback.biped.balanced_pattern import BalancedPattern
from cpg_ros.motion.pattern import Pattern
from cpg_ros.motion.plan import GaitPlan, PlanError
from cpg_ros.motion.robot import Robot
from cpg_ros.motion.robot_file import load_robot
from cpg_ros.motion.strides import StrideCommand
from cpg_ros.networks.network import Network
from cpg_ros.networks.registry import find_network, NetworkError
from cpg_ros.ros.feedback import switch
from cpg_ros.ros.feedback.sensor_input import CONTACTS
from cpg_ros.ros.feedback.switch import default_enabled, ENABLED, FeedbackSwitch, FORMER, PREFIX
from cpg_ros.ros.generator_io import cells_block, CmdVel, MeasuredPose, Outputs
from cpg_ros.ros.generator_parameters import (
    COMMANDS,
    exclusive,
    FREQUENCY,
    gait_spec,
    NETWORK,
    network_for,
    Planner,
    presets_of,
    specs,
)
from cpg_ros.ros.joint_tracking import JointTracking
from cpg_ros.ros.kernels import compile_kernels
from cpg_ros.ros.node import native
from cpg_ros.ros.node.health import Health, HealthPublisher, OtherPublishers, STEADY
from cpg_ros.ros.node.node_base import Lifecycle, run, StartedNode, StartError
from cpg_ros.ros.node.polled import latched, OVERRIDABLE
from cpg_ros.ros.node.ticker import RealTime, SPECS, Ticker
from cpg_ros.ros.posture import Posture
from diagnostic_msgs.msg import DiagnosticStatus
import numpy as np
from rcl_interfaces.msg import ParameterType, SetParametersResult
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.timer import Timer
from std_msgs.msg import String
from std_srvs.srv import SetBool

# The generator's health, once a second on /diagnostics.

#: Time between two warnings of jumps of simulated time in the log, s.
WARNING_PERIOD = 5.0


class Diagnostics:
    """Status of the generator on /diagnostics.

    It is ERROR after a fault until the pattern is back, with other publishers, and with joints
    that do not follow; WARN with late ticks, and while nothing is published.
    """

    def __init__(self, node: Node, pattern: Pattern, ticker: Ticker, others: OtherPublishers,
                 cmd_vel: CmdVel | None, feedback: FeedbackSwitch,
                 awaited: Callable[[], str], lag: Callable[[], str]) -> None:
        self._lag = lag
        self._feedback, self._awaited = feedback, awaited
        self._node, self._pattern, self._ticker = node, pattern, ticker
        self._others, self._cmd_vel = others, cmd_vel
        self._before = self._counts()
        self._silent = 0
        self._publisher = HealthPublisher(node, 'pattern', pattern.robot.name, self._status)

    def _counts(self) -> dict[str, int]:
        ticker, pattern = self._ticker, self._pattern
        return {'ticks': ticker.ticks, 'late ticks': ticker.late,
                'dropped ticks': ticker.dropped, 'jumps back of simulated time': ticker.jumps,
                'watchdog re-seeds': pattern.faults, 'ticks held by limits': pattern.held}

    def _status(self) -> Health:
        """Return the status of the last second."""
        counts, before, pattern = self._counts(), self._before, self._pattern
        self._before = counts
        new = {key: counts[key] - before[key] for key in counts}
        plan = pattern.plan
        self._silent = 0 if new['ticks'] and not self._ticker.paused else self._silent + 1
        misfit = self._cmd_vel.find_misfits() if self._cmd_vel else ''
        if new['watchdog re-seeds'] or pattern.recovering:
            level, text = DiagnosticStatus.ERROR, 'the network left its orbit and was re-seeded'
            if plan.gain == 0.0:
                text += ' (symmetry_gain is 0: no gait is stable)'
        elif self._others.text:
            level, text = DiagnosticStatus.ERROR, self._others.text
        elif lag := self._lag():
            level, text = DiagnosticStatus.ERROR, lag
        elif new['jumps back of simulated time']:
            level = DiagnosticStatus.WARN
            text = self._why_anew(new['jumps back of simulated time'])
            self._node.get_logger().warning(text, throttle_duration_sec=WARNING_PERIOD)
        elif self._silent > 1.0 / self._ticker.rate:
            level, text = DiagnosticStatus.WARN, f'nothing is published: {self._why_silent()}'
        elif 100 * new['dropped ticks'] > new['ticks']:
            level, text = DiagnosticStatus.WARN, f'{new["dropped ticks"]} ticks dropped'
        elif misfit:
            level, text = DiagnosticStatus.WARN, misfit
        elif self._feedback.out:
            level, text = DiagnosticStatus.WARN, f'no feedback: {self._feedback.out}'
        elif new['ticks held by limits'] and not self._feedback.active:
            level, text = DiagnosticStatus.WARN, 'a joint limit held the pattern back'
        elif 100 * new['late ticks'] > new['ticks']:
            level, text = DiagnosticStatus.WARN, f'{new["late ticks"]} late ticks'
        else:
            level, text = DiagnosticStatus.OK, self._state()
        values: dict[str, object] = {
            'gait': plan.name, 'character': plan.character, 'state': self._state(),
            'network': plan.orbit.network.name,
            'frequency [Hz]': f'{plan.frequency:.6g}',
            'period [model time]': f'{plan.orbit.period:.8g}',
            'symmetry gain [1/model time]': f'{plan.gain:.4g}',
            'rate wanted [Hz]': f'{self._ticker.rate:.6g}', 'ticks in the last second':
            new['ticks'], **counts,
            'worst delay of a tick [ms]': f'{1e3 * self._ticker.worst:.3f}'}
        if self._cmd_vel:
            values['cmd_vel'] = self._cmd_vel.state
        values |= self._feedback.state(1e-9 * self._node.get_clock().now().nanoseconds)
        return level, text, values

    def _why_anew(self, jumps: int) -> str:
        publishers = self._node.count_publishers(self._node.resolve_topic_name('/clock'))
        text = ('simulated time jumped back: starting again from the stand' if jumps == 1 else
                f'simulated time jumped back {jumps} times in a second')
        if publishers > 1:
            text += f'; /clock has {publishers} publishers, stop all but one'
        return text

    def _why_silent(self) -> str:
        clock: Any = self._node.get_clock()
        now = clock.now().nanoseconds
        if self._ticker.waiting:
            return f'waiting for {self._awaited()}'
        if not clock.ros_time_is_active:
            return f'no tick for {self._silent} s'
        return f'simulated time is still {1e-9 * now:.3f} s' if now else 'no /clock yet'

    def _state(self) -> str:
        pattern = self._pattern
        if self._ticker.waiting:
            return f'waiting for {self._awaited()}'
        if pattern.standing:
            return 'sitting' if pattern.body.seated else 'standing'
        if pattern.level < 1.0:
            return 'ramping up' if pattern.enabled else 'ramping down'
        return 'changing gait' if pattern.in_transition else 'running'


NAME = 'cpg_generator'
#: After a signal that ends the node. SHUTDOWN_RAMP: duration of the ramp to the stand, s;
#: SHUTDOWN_TIMEOUT: deadline of the node's end, s.
SHUTDOWN_RAMP, SHUTDOWN_TIMEOUT = 0.5, 0.95
#: The same deadline for a biped that balances, s: it slows down, stands and crouches.
CROUCH_TIMEOUT = 8.0
#: DISCOVERY_TIME: time after which two nodes have discovered each other, s: announcements repeat
#: every 3 s, and a busy machine may lose the first ones.
DISCOVERY_TIME = 3.5
#: SEARCH_PERIOD: period in which the node looks for the joints' initial pose, s.
SEARCH_PERIOD = 0.05


class Generator(StartedNode):
    """Parameters, topics and services around one moving pattern."""

    #: Parameters that set others: a gait loads its preset.
    SETS_OTHERS = frozenset({'gait'})

    def __init__(self, name: str = NAME, **options: Any) -> None:
        """Declare the parameters, check them, and prepare to start.

        Args:
            name: of the node.
            options: further arguments of rclpy's Node, such as ``namespace``, ``context`` and
                ``parameter_overrides``.

        Raises:
            CpgError: a parameter or the robot file cannot be used.

        """
        super().__init__(name, **options)
        joined = time.monotonic()
        network, robot = self._load()
        self._create_pattern(network, self._first_plan(network, robot))
        self._measured = self._measured_pose(robot)
        #: Angles that the last tick sent, rad.
        self._sent = self.pattern.position
        self._tracking = JointTracking(self, robot, self._measured, self._commanded,
                                       self._lag) if self._measured else None
        #: Searches for the pose to begin from, and why it has not begun.
        self._search: Timer | None = None
        self._unmeasured = ''
        self._gait = self.create_publisher(String, '~/gait', latched(),
                                           qos_overriding_options=OVERRIDABLE)
        self.create_service(SetBool, '~/enable', self._enable)
        self._posture = Posture(self, self.pattern, lambda: self._planner.plan(self._values()),
                                self._walk, self._cannot_sit)
        real_time = RealTime.of(*map(self._value, SPECS))
        self.ticker = Ticker(self, self._value('rate'), lambda *_: None, self._restart, self._fail,
                             self.pattern.resume, partial(real_time.request, self.get_logger()),
                             self._prepare)
        self._others = OtherPublishers(self, self._outputs.topics)
        self._diagnostics = Diagnostics(self, self.pattern, self.ticker, self._others,
                                        self._cmd_vel, self._feedback, lambda: self._awaited,
                                        lambda: self._tracking.text if self._tracking else '')
        self.add_on_set_parameters_callback(self._validate)
        self.add_post_set_parameters_callback(self._apply)
        self._warn_of_unknown()
        wait = joined + DISCOVERY_TIME - time.monotonic()
        if self._value('exclusive') and self._others.seek(wait):
            raise StartError(f'{self._others.text}: stop that publisher, rename the topic, '
                             'or set exclusive to false')
        self._lifecycle = Lifecycle(self, {
            'configure': lambda: self._start_publishing()[0],
            'activate': lambda: self._walk(True), 'deactivate': lambda: self._walk(False),
            'cleanup': self._fall_silent, 'shutdown': self._shut_down
        }) if self._value('managed') else None

    def _load(self) -> tuple[type[Network], Robot]:
        """Declare the parameters of every network; return network and robot."""
        overrides = {name: override.value for name, override in self._parameter_overrides.items()}
        self._parameter_overrides['network'] = Parameter('network', value=network_for(
            overrides.get('network', NETWORK.default), overrides.get('robot')))
        self._declare({'network': NETWORK})
        try:
            network = find_network(self._value('network'))
        except NetworkError as error:
            raise StartError(f'network {error}') from error
        compile_kernels(self._value('network'), self)
        self._declare(specs(network))
        self._declare({'exclusive': exclusive(self._value('command'))})
        robot = load_robot(self._value('robot'))
        if network.name not in robot.networks:
            raise StartError(f"robot file '{robot.name}' is for the network "
                             f"{' or '.join(robot.networks)}, not '{network.name}'")
        return network, robot

    def _first_plan(self, network: type[Network], robot: Robot) -> GaitPlan:
        """Declare the parameters of network and robot; return the plan of the first gait."""
        presets = presets_of(network, self._value('presets'))
        self._one_of('gait', tuple(presets))
        self._one_of('command', COMMANDS)
        self._planner = Planner(network, presets, robot, self._value('cmd_vel'))
        if self._value('faster_gait'):
            self._one_of('faster_gait', tuple(self._planner.offered))
        # Its descriptor lists those of the file, too.
        descriptor = gait_spec(network, self._planner.offered, robot=robot).descriptor()
        descriptor.type = ParameterType.PARAMETER_STRING
        self.set_descriptor('gait', descriptor)
        self._declare(switch.specs(robot))
        if FORMER in self._parameter_overrides:
            raise StartError(f"there is no parameter '{FORMER}': it is '{ENABLED}'")
        self._declare({ENABLED: default_enabled(self, robot, self._value('combined_topic'),
                                      self._value('command') != 'none')})
        self._one_of('feedback.contacts', CONTACTS)
        for parameter in self._planner.given(self._value('gait'), self._parameter_overrides):
            self._parameter_overrides[parameter.name] = parameter
        self._declare(self._planner.specs(self._value('gait')))
        plan = self._planner.plan(self._values())
        self._planner.prepare()
        return plan

    def _create_pattern(self, network: type[Network], plan: GaitPlan) -> None:
        """Create the pattern, its steering and feedback, and its publishers."""
        robot, steered = plan.robot, self._value('cmd_vel')
        autostart = self._value('autostart') and not self._value('managed')
        soled = robot.biped is not None
        self.pattern = (BalancedPattern if soled else Pattern)(
            plan, self._value('ramp'), autostart and not steered,
            StrideCommand(len(robot.legs)) if steered and not soled else None)
        self._cmd_vel = CmdVel(self, self.pattern, plan, autostart,
                               lambda: self._value('cmd_vel_timeout'),
                               lambda: self._value('ramp'),
                               lambda: self._feedback.active, self._value('faster_gait'),
                               self._change_gait) if steered else None
        self._outputs = Outputs(self, robot, self._value('combined_topic'),
                                self._value('command'), self._value('stamped'))
        self._feedback = FeedbackSwitch(self, self.pattern, self._motion, self._outputs.topics)
        self._cells = cells_block(self, network, self.pattern.addresses['state'],
                                  self._value('stamped'))

    # -- parameters -----------------------------------------------------------------------

    def _change_gait(self, name: str) -> None:
        """Change the gait as a request would; log why not."""
        def answer(result: SetParametersResult) -> None:
            if not result.successful:
                self.get_logger().warning(f'no change to the gait {name}: {result.reason}')
        self.parameter_service.change(Parameter('gait', value=name), answer)

    def _values(self, changes: list[Parameter] | None = None) -> dict:
        values = {name: self._value(name) for name in self._planner.names}
        values.update({p.name: p.value for p in changes or [] if p.name in values})
        return values

    def _complete(self, parameters: list[Parameter]) -> list[Parameter]:
        return self._planner.complete(super()._complete(parameters), self._values())

    def _validate(self, parameters: list[Parameter]) -> SetParametersResult:
        """Return whether a batch can run as a whole, without changing anything."""
        plan = self.pattern.plan
        if any(p.name in self._planner.names for p in parameters):
            try:
                plan = self._planner.plan(self._values(parameters))
            except PlanError as error:
                return SetParametersResult(successful=False, reason=str(error))
            if reason := self._feedback.validate_plan(plan):
                return SetParametersResult(successful=False, reason=reason)
        reason = self._posture.validate(parameters, plan) or self._feedback.validate(parameters)
        return SetParametersResult(successful=not reason, reason=reason)

    def _apply(self, parameters: list[Parameter]) -> None:
        """Apply a batch that has been accepted and stored."""
        for parameter in parameters:
            if parameter.name == 'rate':
                self.ticker.rate = parameter.value
                self.ticker.attend()
        if any(p.name in self._planner.names for p in parameters):
            plan = self._planner.plan(self._values())
            self._feedback.learn(plan)
            self.pattern.apply(plan, self._value('transition'))
            if self._cmd_vel:
                self._cmd_vel.set_plan(plan)
            self._announce()
        self._posture.apply(parameters)
        if any(p.name.startswith(PREFIX) for p in parameters):
            self._feedback.apply()
        if any(p.name in (ENABLED, f'{PREFIX}virtual_stiffness') for p in parameters):
            self.ticker.attend()

    def _announce(self) -> None:
        plan = self._planner.plan(self._values())
        self._gait.publish(String(data=plan.name))
        self.get_logger().info(f'{plan.name} at {plan.frequency:.4g} Hz')
        self.get_logger().debug(f'period {plan.orbit.period:.6f} model time, symmetry gain '
                                f'{plan.gain:.3g}')
        enough = plan.stability.enough
        if plan.gain < enough:
            self.get_logger().warning(
                f'symmetry_gain {plan.gain:g} may be too low for the gait to attract '
                f'({enough:.3g} is enough): the phase watchdog may reset it repeatedly')

    # -- the robot ------------------------------------------------------------------------

    def _motion(self) -> tuple[float, float, float]:
        """Return the wanted speeds forward and to the left, m/s, and yaw rate, rad/s."""
        if self._cmd_vel:
            return self._cmd_vel.motion
        return self.pattern.plan.own_speed, 0.0, 0.0

    def _measured_pose(self, robot: Robot) -> MeasuredPose | None:
        topic = self._value('measured_topic')
        if topic and self.resolve_topic_name(topic) not in self._outputs.topics:
            return MeasuredPose(self, robot, topic)
        if self._needs_pose:
            raise StartError(
                f"command '{self._value('command')}' begins at the measured pose, but "
                + (f"measured_topic '{topic}' is the generator's own: set combined_topic to ''"
                   if topic else "measured_topic is ''")
                + ', or set assume_stand to true if nothing measures the joints')
        return None

    @property
    def _needs_pose(self) -> bool:
        """Whether the first motion requires the joints' measured angles."""
        return self._value('command') != 'none' and not self._value('assume_stand')

    def _find_pose(self) -> tuple[str, np.ndarray | None]:
        """Return why it cannot begin, or '', and the measured pose, None for the stand."""
        if self._measured is None:
            return '', None
        angles = self._measured.receive()
        lacking = self._measured.lacks(angles)
        if not lacking:
            return '', angles
        if self._needs_pose:
            return f'the pose is not known, and the joints must not jump: {lacking}', None
        if np.isfinite(angles).any():
            self.get_logger().warning(f'the pose is not known, starting at the stand: {lacking}')
        return '', None

    def _start_publishing(self) -> tuple[str, str]:
        """Start publishing; return why not, or '', and the name of the initial pose."""
        if self._value('exclusive') and self._others.check():
            return self._others.text, ''
        reason, pose = self._find_pose()
        if reason:
            return reason, ''
        self._end_search()
        if self.ticker.paused:
            self.pattern.restart(self._value('ramp'), False)
            self._feedback.restart()
        if pose is not None:
            self.pattern.start_from(pose, self._value('ramp'))
        if self.ticker.is_alive():
            self.ticker.paused = False
        else:
            self.ticker.start()
        return '', 'the stand' if pose is None else 'the measured pose'

    def _await_pose(self) -> None:
        """Start publishing as soon as the pose is measured; log changes of the reason why not."""
        reason, pose = self._start_publishing()
        if not reason:
            self.get_logger().info(f'beginning from {pose}')
        elif reason != self._unmeasured:
            self.get_logger().warning(f'waiting: {reason}')
        self._unmeasured = reason

    def _end_search(self) -> None:
        """Stop waiting for the pose."""
        if self._search is not None:
            self._search.cancel()
            self._search, self._unmeasured = None, ''

    @property
    def _awaited(self) -> str:
        """Text on the condition for which publishing waits."""
        if self._search is not None and self._measured is not None:
            return f'the measured pose on {self._measured.topic}'
        return '~/enable' if self._lifecycle is None else 'configure'

    def _walk(self, walking: bool) -> str:
        """Ramp into the gait, standing up first, or down to the stand; return ''."""
        self.ticker.stop_moving(False)
        self._posture.walks = False
        if walking and self._posture.seated:
            self._posture.rise(True)
            return ''
        if self._cmd_vel:
            self._cmd_vel.enable(walking)
        else:
            self.pattern.enable(walking, self._value('ramp'))
        if not walking:
            self.ticker.stop_moving()
        return ''

    def _cannot_sit(self) -> str:
        """Return why the robot can neither sit nor stand up now, or ''."""
        if self.ticker.waiting:
            return 'nothing is published yet'
        active = self._lifecycle is not None and self._lifecycle.active
        return 'this node is managed: deactivate it first' if active else ''

    def _fall_silent(self) -> str:
        """Stop publishing; return why not, or ''."""
        if not self.pattern.standing:
            return 'it is still ramping down to the stand'
        self.ticker.paused = True
        return ''

    def _shut_down(self) -> str:
        """End the node with a ramp down, as a signal does; return ''."""
        self.stop.set()
        return ''

    def _enable(self, request: SetBool.Request, response: SetBool.Response) -> SetBool.Response:
        response.success = True
        response.message = (f'ramping {"up" if request.data else "down"} over '
                            f'{self._value("ramp"):g} s')
        if self._lifecycle is not None and request.data:
            response.success = False
            response.message = 'this node is managed: activate it instead'
            return response
        if self._lifecycle is not None and self._lifecycle.active:
            self._lifecycle.trigger_deactivate()
            return response
        if self.ticker.waiting:
            if not request.data:
                self._end_search()
                response.message = 'nothing is published yet'
                return response
            reason, pose = self._start_publishing()
            if reason:
                response.success, response.message = False, reason
                return response
            response.message += f' from {pose}'
        self._walk(request.data)
        if self._cmd_vel and request.data and not self._cmd_vel.walking:
            response.message = 'enabled: standing until cmd_vel asks for motion'
        self.get_logger().info(response.message)
        return response

    def _commanded(self) -> np.ndarray | None:
        """Return the commanded angles, rad, or None while there are none."""
        # The balance of a biped sends torques as angles, q + tau / kp.
        torques = isinstance(self.pattern, BalancedPattern) and self.pattern.balancing
        if self.ticker.waiting or not self.ticker.ticks or torques or self._feedback.recovering:
            return None
        return self._sent.copy()

    def _lag(self, reason: str) -> None:
        """Switch the feedback off while a joint does not follow: it would correct wrongly."""
        self._feedback.hinder(reason)
        if reason:
            self.get_logger().error(reason)
        else:
            self.get_logger().info('all joints follow again')

    @contextmanager
    def _prepare(self, loop: native.Loop) -> Iterator[None]:
        """Give ``tick.c`` all that its ticks need until ``Ticker.attend``; see Ticker."""
        pattern, feedback = self.pattern.addresses, self._feedback.loop
        self.pattern.start_drift()
        loop.attend = loop.advance = loop.resume = loop.correct = None
        loop.outputs[:] = [None] * len(loop.outputs)
        with ExitStack() as kept:
            if not self.ticker.paused:
                self._sent = self.pattern.position
                for name in ('attend', 'advance', 'resume', 'what'):
                    setattr(loop, name, pattern[name])
                if feedback is not None:
                    self._sent = feedback.target
                    loop.correct = ctypes.addressof(feedback.compiled())
                    kept.enter_context(feedback.inputs.held())
                self._outputs.block.feed(self._sent, pattern['velocity'], pattern['legs'])
                blocks = [self._outputs.block, self._cells, *self._feedback.blocks]
                for k, block in enumerate(blocks):
                    kept.enter_context(block.held())
                    loop.outputs[k] = block.output(self.ticker.rate)
            yield

    def _restart(self) -> None:
        """Restart after simulated time jumped back; the diagnostics log the jump."""
        ramp = self._value('ramp')
        # At the end there is no time for a longer one.
        self.pattern.restart(min(ramp, SHUTDOWN_RAMP) if self.stop.is_set() else ramp,
                             self.pattern.enabled)
        self._feedback.restart()

    def begin(self) -> None:
        """Start publishing, unless that waits for ~/enable."""
        self._announce()
        names = len(self.pattern.robot.joints)
        at = f"{names} joints of '{self.pattern.robot.name}' at {self.ticker.rate:g} Hz"
        if self._lifecycle is not None:
            self.get_logger().info(f'publishing nothing until it is configured, then {at}')
        elif self._value('autostart') and self._needs_pose and self._measured is not None:
            self.get_logger().info('publishing nothing until the pose is measured on '
                                   f'{self._measured.topic}, then {at}')
            self._search = self.create_timer(SEARCH_PERIOD, self._await_pose, clock=STEADY)
        elif self._value('autostart'):
            self.get_logger().info(f'publishing {at}')
            self.ticker.start()
        else:
            self.get_logger().info(f'publishing nothing until ~/enable, then {at}')

    def poll(self) -> float:
        """Pass the wanted motion, and whether it rests, on to ticks outside the interpreter."""
        self._feedback.renew()
        if self.pattern.standing:
            self.ticker.stop_moving(False)
        return 0.02 if self._feedback.active else 0.1

    def finish(self) -> None:
        """Ramp down to the stand, then stop publishing, within SHUTDOWN_TIMEOUT.

        A balancing biped crouches instead, and a robot with ``end: sit`` sits down, within
        CROUCH_TIMEOUT; a second signal later than SHUTDOWN_TIMEOUT ends that at once.
        """
        began = time.monotonic()
        crouches = isinstance(self.pattern, BalancedPattern) and self.pattern.lower()
        sits = self._value('end') == 'sit'
        deadline = began + (CROUCH_TIMEOUT if crouches or sits else SHUTDOWN_TIMEOUT)
        if self.ticker.is_alive() and self.ticker.ticks and (sits or not self.pattern.standing):
            self.get_logger().info(
                'coming to a stand and crouching before the end' if crouches else
                f'ramping down over {SHUTDOWN_RAMP:g} s{", sitting down" if sits else ""} before '
                'the end')
            if self._cmd_vel:
                self._cmd_vel.end()
            self.pattern.enable(False, SHUTDOWN_RAMP)
            self.ticker.stop_moving()
            early = 0
            while time.monotonic() < deadline and not (
                    self.pattern.standing and (not sits or self._posture.end())):
                time.sleep(0.005)
                # Launched from a terminal, a process gets the same Ctrl-C twice.
                if time.monotonic() < began + SHUTDOWN_TIMEOUT:
                    early = len(self.signals)
                elif len(self.signals) > early:
                    self.get_logger().warning('a second signal: ending at once')
                    break
            time.sleep(min(0.05, 1.0 / self.ticker.rate))
        self.ticker.end()
        if self.ticker.is_alive():
            self.ticker.join(timeout=0.2)


HELP = """\
Publishes the joint states of a gait. While it runs, cpg param list shows all parameters,
also those of the networks and the gains of the feedback.

examples:
  generator --ros-args -p gait:=walk -p rate:=500.0
  generator --ros-args -p network:=biped -p gait:=skip
  generator --ros-args -p robot:=my_robot.yaml -p cmd_vel:=true"""


def main(args: list[str] | None = None) -> int:
    """Run the node until a signal ends it; return the exit code."""
    listed = {'network': NETWORK, **specs(find_network(NETWORK.default)), 'frequency': FREQUENCY,
              'exclusive': exclusive('none'), ENABLED: switch.SWITCH, **switch.TOPICS}
    return run(Generator, NAME, HELP, listed, args, 'generator')


if __name__ == '__main__':
    sys.exit(main())

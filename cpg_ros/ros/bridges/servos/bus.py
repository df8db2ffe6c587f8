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

"""The node ``servo_bus``: angles from ``servo/commands`` to servos on I2C or a serial bus.

It obeys one sender, and disables servo torque when that commands it, when commands stop, and when
anything fails. It is a process of its own so that the bridge's watchdog reaches the servos if the
bridge is killed.
"""

import math
import time

from cpg_ros.common.errors import CpgError, InputError
from cpg_ros.ros.bridges.servos.calibration import Calibration, load_calibration
from cpg_ros.ros.bridges.servos.dynamixel import Dynamixel
from cpg_ros.ros.bridges.servos.feetech import Feetech
from cpg_ros.ros.bridges.servos.interfaces import sender_of, Servos
from cpg_ros.ros.bridges.servos.pca9685 import LinuxI2c, Pca9685
from cpg_ros.ros.bridges.servos.serial_board import SerialBoard, SerialPort, ServoBoard, ServoError
from cpg_ros.ros.node.health import Health, HealthPublisher, others_on, STEADY
from cpg_ros.ros.node.node_base import run, StartedNode
from cpg_ros.ros.node.parameters import fixed, Spec
from cpg_ros.ros.node.polled import command_qos, PolledSubscription
from cpg_ros.ros.node.ticker import Ticker
from diagnostic_msgs.msg import DiagnosticStatus
import numpy as np
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile
from rclpy.time import Time
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, Header

# The board that a calibration file describes.

def open_board(calibration: Calibration) -> ServoBoard:
    """Open the bus, and return its servos, which are not driven yet.

    Raises:
        ServoError: the bus cannot be opened.

    """
    options, device = calibration.options, calibration.device
    try:
        if calibration.board == 'pca9685':
            return Pca9685(LinuxI2c(device, int(options['address'])), calibration.channels,
                           options['frequency'])
        protocol = (Dynamixel() if calibration.board == 'dynamixel' else
                    Feetech(encoder=calibration.board == 'feetech_sts'))
        return SerialBoard(SerialPort(device, int(options['baud'])), protocol,
                           calibration.channels)
    except OSError as error:
        raise ServoError(f'{device}: {error.strerror or error}') from error


# The owner of the servos: the one sender whose commands drive them until torque is disabled.

class CommandOwner:
    """Accepts the commands of one sender and rejects those of all others.

    The first sender whose command drives the servos owns them until torque is disabled. If its
    watchdog or a timeout disables it, the sender's commands are rejected until it releases the
    servos, too: it does not know, and would move them at full speed from where they have sunk to.
    A sender without a name, such as ``ros2 topic pub``, may go on.

    Attributes:
        sender: whose commands are accepted; None while torque is disabled.
        blocked: sender that must release the servos first, '' for none.

    """

    def __init__(self, watchdog: str) -> None:
        """Start without an owner; ``watchdog`` is a sender that may release the servos, too."""
        self._watchdog = watchdog
        self.sender: str | None = None
        self.blocked = ''

    def may_drive(self, sender: str) -> bool:
        """Give the servos to a sender if they are free; return whether it has them."""
        if self.sender is None and not (sender and sender == self.blocked):
            self.sender, self.blocked = sender, ''
        return sender == self.sender

    def may_release(self, sender: str) -> bool:
        """Record that a sender releases the servos; return whether it may."""
        if sender == self.blocked:
            self.blocked = ''
        if self.sender is None or sender not in (self.sender, self._watchdog):
            return False
        self.released('' if sender == self.sender else self.sender)
        return True

    def released(self, blocked: str) -> None:
        """Remove the owner; ``blocked`` must release the servos first."""
        self.sender, self.blocked = None, blocked


NAME = 'servo_bus'
SPECS = fixed({
    'calibration': Spec('', 'calibration file of the servos',
                        constraints='the path of a YAML file'),
    'no_position_feedback': Spec(False, 'drive servos that do not report their position, as those '
                                 'of a PCA9685; the first command moves them at full speed unless '
                                 'the robot lies in its rest pose'),
    'rate': Spec(50.0, 'rate at which servos are commanded and their positions read [Hz]',
                 10.0, 200.0),
    'command_timeout': Spec(0.5, 'time without a command after which servo torque is disabled [s]',
                            0.05, 5.0),
    'end_timeout': Spec(0.0, 'after Ctrl-C or SIGTERM, longest wait for the bridge to make the '
                        'robot sit down and end its commands [s]; 0 disables servo torque at '
                        'once', 0.0, 30.0)})
#: Least time between two warnings that a servo does not answer, s.
WARNING_PERIOD = 5.0
#: QUEUE_DEPTH: most commands that wait for a tick.
QUEUE_DEPTH = 100
#: CHECK_PERIOD: period in which the graph is checked for others who command the servos, s.
CHECK_PERIOD = 0.25
#: REPORT_TIME: time for which /diagnostics reports a refused command, s.
REPORT_TIME = 2.0


class ServoBus(StartedNode):
    """One thread applies commands and publishes the servos' positions."""

    def __init__(self) -> None:
        """Open the bus.

        Raises:
            CpgError: the calibration file or the bus cannot be used.

        """
        super().__init__(NAME, parameter_overrides=[Parameter('use_sim_time', value=False)])
        self._declare(SPECS)
        if not self._value('calibration'):
            raise InputError('parameter calibration is empty: name the calibration file')
        self._calibration = load_calibration(self._value('calibration'))
        blind = self._calibration.board == 'pca9685'
        if blind and not self._value('no_position_feedback'):
            raise InputError('servos of a pca9685 do not report their position, and the first '
                             'command moves them at full speed from wherever they are: lay the '
                             'robot in its rest pose, and set no_position_feedback to true')
        self._reads = not blind
        self._timeout: float = self._value('command_timeout')
        # Leave room for the commands of other senders, which must not displace the owner's.
        self._commands = PolledSubscription(self, Float64MultiArray, Servos.command_topic,
                                            QoSProfile(depth=QUEUE_DEPTH))
        self._owner = CommandOwner(Servos.watchdog_name())
        self._publisher = self.create_publisher(JointState, Servos.state_topic, command_qos())
        #: Assumed angles of servos that cannot be read, rad: at rest until they are commanded.
        self._assumed = self._calibration.rest
        #: Times of the last commands of the owner, and of a refused sender, s.
        self._commanded_at = self._refused_at = -math.inf
        self._refusal = self._others = self._senders = ''
        self._reason = 'not commanded yet'
        self._board = open_board(self._calibration)
        self.thread = self._ticker = Ticker(self, self._value('rate'), self._tick, lambda: None,
                                            self._failed, lambda _: None)
        self._health = HealthPublisher(self, 'bus', self._calibration.board, self._report_health)
        self._timer = self.create_timer(CHECK_PERIOD, self._check_senders, clock=STEADY)
        self._warn_of_unknown()

    @property
    def _driven(self) -> bool:
        return self._owner.sender is not None

    def _check_senders(self) -> None:
        """Find other nodes that command the servos."""
        watchdog = f'{self.get_namespace().rstrip("/")}/{Servos.watchdog_name()}'
        self._others = others_on(self, self._commands.topic, 0, 1, watchdog)
        self._senders = others_on(self, self._commands.topic, 0, 1)

    def _report_health(self) -> Health:
        level, text = DiagnosticStatus.OK, ('driven' if self._driven else
                                            f'servo torque disabled: {self._reason}')
        if time.monotonic() < self._refused_at + REPORT_TIME:
            level, text = DiagnosticStatus.ERROR, self._refusal
        elif self._others:
            level = DiagnosticStatus.ERROR
            text = f'{self._commands.topic} is published by {self._others}: only one may'
        return level, text, {'sender': self._owner.sender or ''}

    def _tick(self, dt: float, stamp: int) -> None:
        now = time.monotonic()
        for message, _ in self._commands.receive():
            self._receive(sender_of(message), np.array(message.data, dtype=float), now)
        if self._driven and now - self._commanded_at > self._timeout:
            self._release(f'no command for {1e3 * self._timeout:.0f} ms', self._owner.sender)
        if self._driven:
            self._board.write(self._calibration.units(self._assumed))
        angles = self._assumed
        if self._reads:
            units = self._board.read()
            if units is None:
                self.get_logger().warning('not all servos answer',
                                          throttle_duration_sec=WARNING_PERIOD)
                return
            angles = self._calibration.angles(units)
        # Without states, a bridge whose commands are refused stops following.
        if not (self._owner.blocked and now < self._refused_at + self._timeout):
            self._publisher.publish(JointState(
                header=Header(stamp=Time(nanoseconds=stamp).to_msg()),
                name=self._calibration.joints, position=angles.tolist()))

    def _receive(self, sender: str, angles: np.ndarray, now: float) -> None:
        """Apply a command, or disable torque if it has no angles or cannot be used."""
        count, owner = len(self._calibration.joints), self._owner
        if not angles.size:
            if owner.may_release(sender):
                self._release('as commanded', owner.blocked)
            return
        was_driven = self._driven
        if not sender and not owner.sender and self._senders:
            self._refuse(f'commands without a sender: {self._senders} publish '
                         f'{self._commands.topic}', now)
        elif not owner.may_drive(sender):
            self._refuse(f'commands of {sender or self._others or "a nameless sender"}: ' + (
                'servo torque was disabled in its absence' if owner.sender is None else
                f'the servos are driven by {owner.sender or "a nameless sender"}'), now)
        elif len(angles) != count:
            self._release(f'a command has {len(angles)} angles for {count} servos', sender)
        elif not np.isfinite(angles).all():
            self._release('a command is not a number', sender)
        else:
            if not was_driven:
                self.get_logger().info('the servos are driven')
            self._assumed, self._commanded_at = angles, now

    def _refuse(self, reason: str, now: float) -> None:
        self._refusal, self._refused_at = f'refused: {reason}', now
        self.get_logger().error(self._refusal, throttle_duration_sec=WARNING_PERIOD)

    def _release(self, reason: str, blocked: str | None) -> None:
        """Disable torque; the sender ``blocked``, if any, must disable it, too."""
        self._owner.released(blocked or '')
        self._reason = reason
        self._board.detach()
        self.get_logger().warning(f'servo torque disabled: {reason}')

    def _failed(self, error: BaseException) -> None:
        """End the node, with a single line if the bus or a servo failed."""
        if not isinstance(error, OSError | CpgError):
            self._fail(error)
            return
        self.failure = error
        text = error.strerror if isinstance(error, OSError) and error.strerror else error
        self.get_logger().fatal(f'{self._calibration.device}: {text}')
        self.stop.set()

    def begin(self) -> None:
        """Start the thread."""
        self.get_logger().info(f'{len(self._calibration.joints)} servos ({self._calibration.board}'
                               f') on {self._calibration.device}')
        self._ticker.start()

    def finish(self) -> None:
        """End the thread and disable torque, whatever has failed."""
        longest = time.monotonic() + self._value('end_timeout')
        while self._driven and self.failure is None and time.monotonic() < longest:
            time.sleep(0.02)
        self._ticker.end()
        self._ticker.join(timeout=1.0)
        try:
            self._board.detach()
        except OSError:
            self.get_logger().fatal('servo torque could not be disabled: cut their power')
        self._board.close()


def main(args: list[str] | None = None) -> int:
    """Run the node until a signal ends it; return the exit code."""
    return run(ServoBus, NAME, 'Drives servos on I2C or a serial bus.', SPECS, args)

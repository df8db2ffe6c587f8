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

"""The node ``servo_bus``: angles from ``/servo/commands`` to servos on I2C or a serial bus.

It lets the servos go when it is told to, when commands stop, and when anything fails. It is a
process of its own so that the bridge's watchdog reaches the servos if the bridge is killed.
"""

import math
import sys
import time

from cpg_ros.errors import CpgError, InputError
from cpg_ros.nodes.deadline_thread import Ticker
from cpg_ros.nodes.node_base import run, StartedNode
from cpg_ros.nodes.parameter_spec import fixed, Spec
from cpg_ros.nodes.polled_group import PolledSubscription
from cpg_ros.nodes.qos_profiles import command_qos
from cpg_ros.nodes.servos.interfaces import Servos
from cpg_ros.servos.boards import open_board
from cpg_ros.servos.calibration import load_calibration
import numpy as np
from rclpy.parameter import Parameter
from rclpy.time import Time
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, Header

NAME = 'servo_bus'
SPECS = fixed({
    'calibration': Spec('', 'calibration file of the servos',
                        constraints='the path of a YAML file'),
    'rate': Spec(50.0, 'times that servos are commanded, and asked where they are, a second [Hz]',
                 10.0, 200.0),
    'command_timeout': Spec(0.25, 'time without a command after which the servos are let go [s]',
                            0.05, 5.0),
    'end_timeout': Spec(0.0, 'time for which Ctrl-C or SIGTERM waits for the commands to stop, as '
                        'they do when the bridge has made the robot sit down [s]; 0 lets the '
                        'servos go at once', 0.0, 30.0)})
#: Least time between two warnings that a servo does not answer, s.
QUIET = 5.0


class ServoBus(StartedNode):
    """One thread takes commands, drives the servos and publishes where they are."""

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
        self._timeout: float = self._value('command_timeout')
        self._commands = PolledSubscription(self, Float64MultiArray, Servos.command_topic,
                                            command_qos())
        self._publisher = self.create_publisher(JointState, Servos.state_topic, command_qos())
        #: Where servos that cannot be asked are taken to be: at rest, until they are commanded.
        self._assumed = self._calibration.rest
        #: When angles were last commanded, s.
        self._driven, self._heard = False, -math.inf
        self._board = open_board(self._calibration)
        self.thread = self._ticker = Ticker(self, self._value('rate'), self._tick, lambda: None,
                                            self._failed, lambda _: None)
        self._warn_of_unknown()

    def _tick(self, dt: float, stamp: int) -> None:
        now = time.monotonic()
        if (message := self._commands.newest()) is not None:
            self._take(np.array(message.data, dtype=float), now)
        if self._driven and now - self._heard > self._timeout:
            self._let_go(f'no command for {1e3 * self._timeout:.0f} ms')
        if self._driven:
            self._board.write(self._calibration.units(self._assumed))
        angles = self._assumed
        if self._calibration.board != 'pca9685':
            units = self._board.read()
            if units is None:
                self.get_logger().warning('not all servos answer', throttle_duration_sec=QUIET)
                return
            angles = self._calibration.angles(units)
        self._publisher.publish(JointState(
            header=Header(stamp=Time(nanoseconds=stamp).to_msg()),
            name=self._calibration.joints, position=angles.tolist()))

    def _take(self, angles: np.ndarray, now: float) -> None:
        """Follow a command, or let the servos go if it has no angles or cannot be used."""
        wanted = len(self._calibration.joints)
        if not angles.size:
            self._let_go('as commanded')
        elif len(angles) != wanted:
            self._let_go(f'a command has {len(angles)} angles for {wanted} servos')
        elif not np.isfinite(angles).all():
            self._let_go('a command is not a number')
        else:
            if not self._driven:
                self.get_logger().info('the servos are driven')
            self._assumed, self._heard, self._driven = angles, now, True

    def _let_go(self, reason: str) -> None:
        if self._driven:
            self._driven = False
            self._board.detach()
            self.get_logger().warning(f'the servos are let go: {reason}')

    def _failed(self, error: BaseException) -> None:
        """End: in one line if it is the bus or a servo."""
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
        """End the thread, and let the servos go, whatever has failed."""
        longest = time.monotonic() + self._value('end_timeout')
        # Not until they are let go: the watchdog does that, too, while the bridge is late.
        while self.failure is None and time.monotonic() < min(longest,
                                                              self._heard + self._timeout):
            time.sleep(0.02)
        self._ticker.end()
        self._ticker.join(timeout=1.0)
        try:
            self._board.detach()
        except OSError:
            self.get_logger().fatal('the servos could not be let go: cut their power')
        self._board.close()


def main(args: list[str] | None = None) -> int:
    """Run the node until a signal ends it; return the exit code."""
    return run(ServoBus, NAME, 'Drives servos on I2C or a serial bus.', SPECS, args)


if __name__ == '__main__':
    sys.exit(main())

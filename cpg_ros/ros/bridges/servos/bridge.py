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

"""The node ``servo_bridge``: drives a robot of servo motors from a generator's output."""

import secrets

from cpg_ros.common.errors import InputError
from cpg_ros.motion.robot import Robot
from cpg_ros.ros.bridges.bridge import BridgeNode
from cpg_ros.ros.bridges.robot_state import (
    bridge_specs,
    BridgeSettings,
    check_joints,
    settings_for,
)
from cpg_ros.ros.bridges.servos.calibration import load_calibration
from cpg_ros.ros.bridges.servos.interfaces import ServoCommand, Servos, ServoState
from cpg_ros.ros.node.node_base import run
from cpg_ros.ros.node.parameters import fixed, Spec
import numpy as np

NAME = Servos.bridge_name()
#: UNSUPPORTED: settings of a bridge that this one lacks: servos limit their torque themselves and
#: measure no tilt or temperature.
UNSUPPORTED = 'torque_factor', 'feedforward', 'tilt', 'hottest', 'sensor_rate'
SPECS = fixed({
    **{name: spec for name, spec in bridge_specs('', calibration=Spec(
        '', 'calibration file of the servos', constraints='the path of a YAML file')).items()
       if name not in UNSUPPORTED},
    'rate': Spec(50.0, 'commands per second [Hz]', 10.0, 200.0),
    # Servos that hold their last angle do not mind a computer that is late.
    'state_timeout': Spec(0.5, 'time without a new state, or without a tick of the bridge, after '
                          'which servo torque is disabled [s]', 0.05, 5.0)})


class ServoBridge(BridgeNode):
    """Commands of a generator as angles for ``servo_bus``."""

    interface, specs = Servos, SPECS
    state_hint = ': is servo_bus running, and do all servos answer?'

    def make_state(self) -> ServoState:
        """Return a state without joints, which the calibration file names."""
        self._state = ServoState()
        return self._state

    def make_settings(self, robot: Robot, common: dict[str, float]) -> BridgeSettings:
        """Return the settings of the robot file, in the order of the calibration file."""
        if not self._value('calibration'):
            raise InputError('parameter calibration is empty: name the calibration file')
        calibration = load_calibration(self._value('calibration'))
        joints = calibration.joints
        self._state.expect(joints)
        check_joints(robot, joints, 'these servos')
        ones = np.ones(len(joints))
        # Infinite torque: a servo goes to its angle with what it has.
        return settings_for(robot, joints, kp=ones, kd=0.0 * ones, torque=np.inf * ones,
                            lying=calibration.rest, **common)

    def make_command(self) -> ServoCommand:
        """Return a command for the joints of the calibration file."""
        # Two bridges of one name are two senders, too.
        return ServoCommand(len(self._state.q),
                            f'{self.get_fully_qualified_name()} {secrets.token_hex(4)}')

    def dry_report(self) -> str:
        """Return the distances that the servos would move."""
        away = np.abs(self.supervisor.command.q - self._state.q).max()
        return f'the largest movement to a commanded angle would be {away:.2f} rad'


def main(args: list[str] | None = None) -> int:
    """Run the node until a signal ends it; return the exit code."""
    return run(ServoBridge, NAME, "Drives a robot with servos from a generator's output.", SPECS,
               args)

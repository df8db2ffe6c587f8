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

"""Messages between the bridge to servos, its watchdog and the node that has their bus."""

from cpg_ros.ros.bridges.robot_state import JointCommand, RobotState
from cpg_ros.ros.bridges.watchdog_link import RobotInterface
import numpy as np
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, MultiArrayDimension, MultiArrayLayout


class ServoState(RobotState):
    """Angles; there is no IMU, no speed and no temperature."""

    def __init__(self) -> None:
        """Prepare without joints."""
        super().__init__(0)
        self._names: tuple[str, ...] = ()

    def expect(self, names: tuple[str, ...]) -> None:
        """Set the joints, in this order."""
        self._names = names
        self.q, self.dq = np.zeros((2, len(names)))

    def read(self, message: JointState) -> bool:
        """Copy a JointState; return whether it has all joints."""
        if tuple(message.name) != self._names or len(message.position) != len(self._names):
            return False
        self.q[:] = message.position
        return True


class ServoCommand(JointCommand):
    """Angles. Servos take no gains: they hold their angle, or nothing."""

    def __init__(self, joints: int, sender: str) -> None:
        """Command servos as ``sender``, by which the bus tells its bridge from others."""
        super().__init__(joints)
        self._layout = MultiArrayLayout(dim=[MultiArrayDimension(label=sender)])

    def encode(self) -> Float64MultiArray:
        """Return the angles, rad; empty to disable torque."""
        return Float64MultiArray(layout=self._layout,
                                 data=self.q.tolist() if self.kp.any() else [])


def sender_of(command: Float64MultiArray) -> str:
    """Return the sender of a command, '' if it is not given."""
    dimensions = command.layout.dim
    return dimensions[0].label if dimensions else ''


class Servos(RobotInterface):
    """Topics and messages of servos; topics are relative, so that namespaces separate robots."""

    maker = 'servo'
    command_topic, state_topic = 'servo/commands', 'servo/joint_states'

    @staticmethod
    def command_type() -> type:
        """Return the type of angles."""
        return Float64MultiArray

    @staticmethod
    def state_type() -> type:
        """Return the type of measured, or assumed, angles."""
        return JointState

    @staticmethod
    def make_command() -> ServoCommand:
        """Return the watchdog's command, without joints: it disables the torque of all."""
        return ServoCommand(0, Servos.watchdog_name())

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

"""A bridge to a biped of four servo motors, with messages of ROS only: all that a bridge needs.

States are JointState on /servo/joint_states; commands are Float64MultiArray on /servo/commands,
with the angles of all motors, then their gains kp, then kd.
"""

import sys

from cpg_ros.nodes.bridge_base import BridgeNode
from cpg_ros.nodes.bridge_interface import RobotInterface
from cpg_ros.nodes.bridge_parameters import bridge_specs
from cpg_ros.nodes.node_base import run
from cpg_ros.nodes.parameter_spec import Spec
from cpg_ros.safety.bridge_settings import motor_places, settings_for
from cpg_ros.safety.robot_state import JointCommand, RobotState
import numpy as np
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

#: In the order of the motors, which is not that of the robot file.
JOINTS = ('right_ankle_joint', 'right_knee_joint', 'left_ankle_joint', 'left_knee_joint')
#: Largest torque of a motor, N m; pose that the biped sits down to, rad.
TORQUE, LYING = 20.0, (-0.8, 1.8, -0.8, 1.8)


class ServoState(RobotState):
    """Angles and speeds; there is no IMU and no temperature."""

    def read(self, message):
        """Take a JointState over; return whether it has the motors' joints."""
        if tuple(message.name) != JOINTS:
            return False
        self.q[:], self.dq[:] = message.position, message.velocity
        return True


class ServoCommand(JointCommand):
    """Angles and gains."""

    def encode(self):
        """Return q, kp and kd, one after another."""
        return Float64MultiArray(data=np.concatenate([self.q, self.kp, self.kd]).tolist())


class Servos(RobotInterface):
    """Topics and messages of the biped."""

    maker = 'servo'
    command_topic, state_topic = '/servo/commands', '/servo/joint_states'

    @staticmethod
    def command_type():
        return Float64MultiArray

    @staticmethod
    def state_type():
        return JointState

    @staticmethod
    def make_command():
        return ServoCommand(len(JOINTS))


class ServoBridge(BridgeNode):
    """Drives the biped."""

    interface = Servos
    specs = {
        **bridge_specs('biped', kp=Spec(30.0, 'proportional gain [N m / rad]', 0.0, 100.0)),
        'rate': Spec(100.0, 'commands per second [Hz]', 10.0, 500.0),
        # Servos that hold their last angle do not mind a computer that is late.
        'state_timeout': Spec(5.0, 'time without a state [s]', 0.005, 10.0)}
    state_hint = ': are the servos on?'

    def __init__(self):
        super().__init__(ServoState(len(JOINTS)))

    def make_settings(self, robot, common):
        """Return the same gains and torque for all motors."""
        ones = np.ones(len(JOINTS))
        return settings_for(robot, motor_places(robot, JOINTS, 'these servos'),
                            kp=self._value('kp') * ones, kd=ones,
                            torque=self._value('torque_factor') * TORQUE * ones,
                            lying=np.array(LYING), **common)


def main():
    """Run the node; return the exit code."""
    return run(ServoBridge, Servos.bridge_name(), 'Drives a biped of servo motors.',
               ServoBridge.specs)


if __name__ == '__main__':
    # The watchdog imports this module by its name, which __main__ is not.
    import servo_bridge
    sys.exit(servo_bridge.main())

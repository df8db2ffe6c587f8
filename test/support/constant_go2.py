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

"""A Go2 whose joints reach their commanded angles at once, 100 times a second; no physics."""

import threading

import numpy as np
import rclpy
from rclpy.executors import SingleThreadedExecutor
from std_msgs.msg import Float64MultiArray

LYING = (0.0, 1.36, -2.65)


class ConstantGo2:
    """LowState out, LowCmd in, in a namespace.

    Attributes:
        driven: number of commands that drove the joints.
        contacts: the bridge's last message of foot_contacts.

    """

    def __init__(self, domain, namespace, feet=(0, 0, 0, 0)):
        from unitree_go.msg import LowCmd, LowState
        self._state, self.driven, self.contacts = LowState(), 0, None
        self._state.imu_state.quaternion = np.array([1.0, 0.0, 0.0, 0.0], dtype=np.float32)
        self._state.foot_force = np.array(feet, dtype=np.int16)
        for motor, angle in zip(self._state.motor_state, LYING * 4, strict=False):
            motor.q, motor.mode = angle, 1
        self._context = rclpy.Context()
        rclpy.init(context=self._context, domain_id=domain)
        self.node = rclpy.create_node('go2', namespace=namespace, context=self._context,
                                      enable_rosout=False)
        self._publisher = self.node.create_publisher(LowState, 'lowstate', 1)
        self.node.create_subscription(LowCmd, 'lowcmd', self._obey, 1)
        self.node.create_subscription(Float64MultiArray, 'foot_contacts', self._listen, 1)
        self.node.create_timer(0.01, self._publish)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self.node)
        self._thread = threading.Thread(target=self._executor.spin, daemon=True)
        self._thread.start()

    def _publish(self):
        self._state.tick += 1
        self._publisher.publish(self._state)

    def _obey(self, message):
        for command, motor in zip(message.motor_cmd[:12], self._state.motor_state[:12],
                                  strict=True):
            if command.kp > 0.0:
                motor.q = command.q
                self.driven += 1

    def _listen(self, message):
        self.contacts = message.data.tolist()

    def end(self):
        """Leave the graph."""
        self._executor.shutdown()
        self._thread.join()
        self.node.destroy_node()
        rclpy.shutdown(context=self._context)

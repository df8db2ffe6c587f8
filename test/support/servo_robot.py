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

"""Robots of simulated servos, each with its bus and its bridge, and nodes that command them."""

import contextlib
import math
import socket
import threading
import time

from cpg_ros.motion.robot_file import load_robot
from cpg_ros.ros.bridges.watchdog_link import TickMonitor
from graph import EXECUTABLE, Process, until
import numpy as np
import rclpy
from rclpy.executors import SingleThreadedExecutor
from servo_chain import calibrated, JOINTS, LYING, servo_steps, ServoChain
from std_msgs.msg import Float64MultiArray

TARGETS = 'forward_position_controller/commands'
#: Angles of motors in the order of the robot file.
ORDER = [JOINTS.index(name) for name in load_robot('biped').order]
SERVOS = (1, 2, 3, 4)
STAND = (-0.1, 0.5, -0.1, 0.5)


class ServoRobot:
    """A bus with simulated servos, and its bridge once it is started, in a namespace."""

    def __init__(self, folder, namespace, domain, *parameters):
        self.namespace, self.domain = namespace, domain
        self.chain = ServoChain(dict(zip(SERVOS, servo_steps(LYING).tolist(), strict=True)))
        folder = folder / namespace
        folder.mkdir()
        self._path = calibrated(folder, self.chain.path)
        self.bus = self._start('servo_bus', *parameters).wait_for('4 servos')
        self.bridge = None

    def _start(self, name, *parameters):
        words = [word for one in (f'calibration:={self._path}', *parameters)
                 for word in ('-p', one)]
        return Process('-r', f'__ns:=/{self.namespace}', *words, domain=self.domain,
                       executable=EXECUTABLE.with_name(name))

    def start(self, *parameters):
        """Start the bridge."""
        self.bridge = self._start('servo_bridge', 'robot:=biped', 'command:=forward_position',
                                  'target_timeout:=1.0', *parameters)
        return self.bridge

    def goals(self):
        """Return the servos' goals, in steps."""
        return np.array([self.chain.goals[servo] for servo in SERVOS])

    def end(self):
        """End all, also a watchdog that was left behind."""
        for process in filter(None, (self.bridge, self.bus)):
            process.end()
        with (contextlib.suppress(ConnectionRefusedError),
              socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as line):
            line.connect(f'\0cpg_ros/servo/watchdog/{self.domain}/{self.namespace}/servo/commands')
            line.send(TickMonitor.END)
        self.chain.end()


class Sender:
    """Publishes angles, fixed or of a function, on a topic of commands, 100 times a second."""

    def __init__(self, domain, topic, angles, name='stranger'):
        self._context = rclpy.Context()
        rclpy.init(context=self._context, domain_id=domain)
        self._node = node = rclpy.create_node(name, context=self._context, enable_rosout=False)
        publisher = node.create_publisher(Float64MultiArray, topic, 10)
        until(publisher.get_subscription_count, f'who listens to {topic}')
        given = angles if callable(angles) else lambda: angles
        node.create_timer(0.01, lambda: publisher.publish(
            Float64MultiArray(data=[float(angle) for angle in given()])))
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(node)
        self._thread = threading.Thread(target=self._executor.spin, daemon=True)
        self._thread.start()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self._executor.shutdown()
        self._thread.join()
        # Left to the garbage collector, it stays in the graph of later tests.
        self._node.destroy_node()
        rclpy.shutdown(context=self._context)


def swinging(amplitude, frequency=0.5):
    """Return a function of targets that swing about the stand, rad, in the robot's order."""
    def angles():
        swing = amplitude * math.sin(2.0 * math.pi * frequency * time.monotonic())
        return (np.array(STAND) + swing)[ORDER]
    return angles

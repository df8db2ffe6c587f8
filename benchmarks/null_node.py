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

"""A node that publishes constants on the generator's topics with the same thread and services.

Its messages are typed, built once and filled in place: what publishing in Python costs at the
least without serialised messages. Rate and robot are parameters, as in the generator.
"""

from array import array
import gc
import signal
import sys
import threading
from types import SimpleNamespace

from cpg_ros.motion.robot import Robot
from cpg_ros.motion.robot_file import load_robot
from cpg_ros.ros.generator import Diagnostics
from cpg_ros.ros.node.health import OtherPublishers
from cpg_ros.ros.node.node_base import exit_code
from cpg_ros.ros.node.ticker import RealTime, Ticker
import numpy as np
import rclpy
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, MultiArrayDimension
from std_srvs.srv import SetBool


def view_of(message: object, field: str, n: int) -> np.ndarray:
    """Give a message's field n zeros and return a view of the memory it publishes from."""
    setattr(message, field, array('d', bytes(8 * n)))
    return np.frombuffer(getattr(message, field), dtype=float)


class TypedOutputs:
    """Joint states of each leg and of all joints, and the phases, as messages of their types."""

    def __init__(self, node: Node, robot: Robot) -> None:
        places = np.arange(len(robot.joints))
        parts, start = {}, 0
        for leg, joints in robot.legs.items():
            parts[f'{leg}/joint_states'] = slice(start, start + len(joints))
            start += len(joints)
        parts['joint_states'] = robot.order_indices
        self._stamps, self._views, self._publish = [], [], []
        for topic, part in parts.items():
            names = [robot.joints[k].name for k in places[part]]
            message = JointState(name=names)
            self._stamps.append(message.header.stamp)
            self._views.append((*(view_of(message, field, len(names))
                                  for field in ('position', 'velocity')), part))
            self._publish.append((node.create_publisher(
                JointState, topic, QoSProfile(depth=100)).publish, message))
        phases = Float64MultiArray()
        self._phases = view_of(phases, 'data', len(robot.legs))
        phases.layout.dim = [MultiArrayDimension(label=','.join(robot.legs), stride=1,
                                                 size=len(robot.legs))]
        self._publish.append((node.create_publisher(
            Float64MultiArray, '~/phase', QoSProfile(depth=100)).publish, phases))

    def publish(self, stamp: int, position: np.ndarray, velocity: np.ndarray, phases: np.ndarray
                ) -> None:
        seconds, nanoseconds = divmod(stamp, 1_000_000_000)
        for time_now in self._stamps:
            time_now.sec = seconds
            time_now.nanosec = nanoseconds
        for positions, velocities, part in self._views:
            positions[:] = position[part]
            velocities[:] = velocity[part]
        self._phases[:] = phases
        for publish, message in self._publish:
            publish(message)


def main() -> int:
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    node = Node('null_node')
    rate = node.declare_parameter('rate', 100.0).value
    node.declare_parameter('nothing', '')
    real_time = RealTime(node.declare_parameter('thread_priority', 0).value)
    robot = load_robot(node.declare_parameter('robot', 'quadruped').value)
    outputs = TypedOutputs(node, robot)
    position, velocity = robot.column('offset'), np.zeros(len(robot.joints))
    phases = np.zeros(len(robot.legs))
    stop = threading.Event()

    def tick(dt: float, stamp: int) -> None:
        outputs.publish(stamp, position, velocity, phases)

    ticker = Ticker(node, rate, tick, lambda: None, lambda error: stop.set(),
                    begin=lambda: real_time.request(node.get_logger()))
    plan = SimpleNamespace(name='null', frequency=1.0, gain=1.0,
                              character='none', orbit=SimpleNamespace(
                                  period=1.0, network=SimpleNamespace(name='none')))
    still = SimpleNamespace(plan=plan, robot=robot, body=SimpleNamespace(seated=False), faults=0,
                            held=0, recovering=False, standing=True)
    deaf = SimpleNamespace(out='', active=False, state=lambda now: {})
    diagnostics = Diagnostics(node, still, ticker, OtherPublishers(node, ()), None, deaf,
                              lambda: '', lambda: '')
    node.create_service(SetBool, '~/enable', lambda request, response: response)
    executor = SingleThreadedExecutor()
    executor.add_node(node)

    def spin() -> None:
        try:
            while not stop.is_set():
                executor.spin_once()
        except ExternalShutdownException:
            pass

    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: stop.set())
    sys.setswitchinterval(2e-4)
    serving = threading.Thread(target=spin, name='executor', daemon=True)
    gc.collect()
    gc.freeze()
    ticker.start()
    serving.start()
    print(f'publishing at {rate:g} Hz', flush=True)
    while not stop.wait(0.2):
        pass
    ticker.end()
    ticker.join(timeout=0.2)
    executor.shutdown(timeout_sec=0.1)
    rclpy.shutdown()
    del diagnostics
    return exit_code(0, ticker, serving)


if __name__ == '__main__':
    sys.exit(main())

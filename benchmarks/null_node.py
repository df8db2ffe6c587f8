"""The generator without a pattern: the same thread, messages, topics, services; constant angles.

It is what publishing costs; the generator's own work is the difference to it. Rate and robot are
parameters, as in the generator.
"""

import gc
import signal
import sys
import threading
import time
from types import SimpleNamespace

import numpy as np
import rclpy
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.signals import SignalHandlerOptions
from std_srvs.srv import SetBool

from cpg_ros.nodes.deadline_thread import Ticker
from cpg_ros.nodes.diagnostics import Diagnostics
from cpg_ros.nodes.generator import find_robot
from cpg_ros.nodes.joint_publishers import Outputs
from cpg_ros.nodes.rivals import Rivals


def main() -> None:
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    node = Node('null_node')
    rate = node.declare_parameter('rate', 100.0).value
    node.declare_parameter('nothing', '')
    robot = find_robot(node.declare_parameter('robot', 'quadruped').value)
    outputs = Outputs(node, robot, 'joint_states', 'none')
    position, velocity = robot.column('offset'), np.zeros(len(robot.joints))
    phases = np.zeros(len(robot.legs))
    stop = threading.Event()

    def tick(dt: float, stamp: int) -> None:
        outputs.publish(stamp, dt, position, velocity, phases)

    ticker = Ticker(node, rate, tick, lambda: None, lambda error: stop.set())
    program = SimpleNamespace(name='null', frequency=1.0, gain=1.0,
                              character='none', orbit=SimpleNamespace(
                                  period=1.0, network=SimpleNamespace(name='none')))
    still = SimpleNamespace(program=program, robot=robot, faults=0, held=0, recovering=False,
                            standing=True)
    diagnostics = Diagnostics(node, still, ticker, Rivals(node, ()), None)
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
    time.sleep(0.05)
    executor.shutdown(timeout_sec=0.1)
    rclpy.shutdown()
    del diagnostics


if __name__ == '__main__':
    main()

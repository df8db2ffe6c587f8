"""Record topics to a bag, as `ros2 bag record` would: raw messages, until SIGINT.

Usage: python recorder.py BAG TOPIC...
"""

import signal
import sys
from functools import partial

import rclpy
from bags import JOINT_STATE, STORE
from rclpy.executors import SingleThreadedExecutor
from rclpy.signals import SignalHandlerOptions
from rosbags.rosbag2 import StoragePlugin, Writer
from sensor_msgs.msg import JointState


def main(path, *topics):
    # The context stays valid while the executor builds its next wait on it.
    rclpy.init(signal_handler_options=SignalHandlerOptions.NO)
    node = rclpy.create_node('recorder')
    with Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        for topic in topics:
            connection = writer.add_connection(topic, JOINT_STATE, typestore=STORE)

            def write(connection, message):
                writer.write(connection, node.get_clock().now().nanoseconds, message)

            node.create_subscription(JointState, topic, partial(write, connection), 5000,
                                     raw=True)
        ending = []
        signal.signal(signal.SIGINT, lambda *_: ending.append(True))
        print('recording', flush=True)
        executor = SingleThreadedExecutor()
        executor.add_node(node)
        while not ending:
            # In vain waits end: a signal that comes in one is seen at its end only.
            executor.spin_once(timeout_sec=0.2)
    rclpy.shutdown()


if __name__ == '__main__':
    main(*sys.argv[1:])

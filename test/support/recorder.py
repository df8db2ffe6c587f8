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

"""Record topics to a bag, as `ros2 bag record` would: raw messages, until SIGINT.

Says 'listening' once it has subscribed, and 'recording' once it knows publishers of all topics.

Usage: python recorder.py BAG TOPIC...
"""

from functools import partial
import signal
import sys

from bags import JOINT_STATE, STORE
import rclpy
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
        executor = SingleThreadedExecutor()
        executor.add_node(node)
        print('listening', flush=True)
        heard = False
        while not ending:
            if not heard and all(map(node.count_publishers, topics)):
                heard = True
                print('recording', flush=True)
            # In vain waits end: a signal that comes in one is seen at its end only.
            executor.spin_once(timeout_sec=0.2)
    rclpy.shutdown()


if __name__ == '__main__':
    main(*sys.argv[1:])

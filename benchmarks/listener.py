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

"""Record when each message of joint_states arrived, was published, and is stamped: one process.

Arguments: seconds, file. SIGINT ends it early. Raw messages, of which only the stamp is read, a
deep queue, rclpy's wait set without an executor (which takes 40 % of a core at 1 kHz) and no
garbage collection, so that what is seen is the publisher's timing. Arrays in the file, ns:
`arrival` (monotonic clock, comparable between processes), `source` (when the middleware took it
from the publisher, system clock), `stamp`, and the publisher's `sequence` numbers; `health` is the
first and the last status on /diagnostics as JSON.
"""

from array import array
import gc
import json
import signal
import struct
import sys
import time

from diagnostic_msgs.msg import DiagnosticArray
import numpy as np
import rclpy
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.qos import QoSProfile
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import JointState


def main(seconds: float, path: str) -> None:
    ending = False

    def end(*_: object) -> None:
        nonlocal ending
        ending = True

    signal.signal(signal.SIGINT, end)
    rclpy.init(args=[], signal_handler_options=SignalHandlerOptions.NO)
    node = rclpy.create_node('listener')

    def ignore(_: object) -> None:
        """Subscriptions want a callback; here messages are taken by hand."""

    joints = node.create_subscription(JointState, 'joint_states', ignore, QoSProfile(depth=5000),
                                      raw=True)
    diagnostics = node.create_subscription(DiagnosticArray, '/diagnostics', ignore, 10)
    arrival, source, stamp, sequence = (array('q') for _ in range(4))
    health: list[dict[str, str]] = []
    unpack, clock = struct.Struct('<iI').unpack_from, time.monotonic_ns
    gc.collect()
    gc.disable()
    print('listening', flush=True)
    deadline = float('inf')
    with node.handle, joints.handle, diagnostics.handle, node.context.handle:
        waiting = rclpy_implementation.WaitSet(2, 0, 0, 0, 0, 0, node.context.handle)
        while not ending and time.monotonic() < deadline:
            waiting.clear_entities()
            waiting.add_subscription(joints.handle)
            waiting.add_subscription(diagnostics.handle)
            waiting.wait(100_000_000)
            while (taken := joints.handle.take_message(JointState, True)) is not None:
                arrival.append(clock())
                message, info = taken
                whole, rest = unpack(message, 4)
                stamp.append(1_000_000_000 * whole + rest)
                source.append(info['source_timestamp'])
                sequence.append(info['publication_sequence_number'])
            if len(arrival) and deadline == float('inf'):
                deadline = time.monotonic() + seconds
            while (taken := diagnostics.handle.take_message(DiagnosticArray, False)) is not None:
                for status in taken[0].status:
                    if status.name.endswith(': pattern'):  # not a panel's
                        health[1:] = [{'message': status.message, **{
                            value.key: value.value for value in status.values}}]
    np.savez(path, arrival=np.array(arrival), source=np.array(source), stamp=np.array(stamp),
             sequence=np.array(sequence), health=json.dumps(health))
    rclpy.shutdown()


if __name__ == '__main__':
    main(float(sys.argv[1]), sys.argv[2])

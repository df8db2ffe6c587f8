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

"""The generator with feedback beside robot_sim at 500 Hz in real time, and without it as well.

The real-time factor, the CPU time of the generator, and the time from an IMU message's
publication to that of the first command that a tick can have made of it; then each input wrong
in mid-walk, each way, by a relay between the two: dead, frozen, not finite, 200 ms late, ten times
as large.
"""

import argparse
from collections import deque
import sys
import time

from common import emit, log, ROOT
from nav_msgs.msg import Odometry
import numpy as np
from processes import enter_workspace, GENERATOR, Process
import rclpy
from rclpy.node import Node
from rclpy.qos import QoSProfile, ReliabilityPolicy
from rclpy.serialization import deserialize_message, serialize_message
from sensor_msgs.msg import Imu, JointState
from std_msgs.msg import Float64MultiArray

SIM = [str(ROOT / 'install/cpg_ros/lib/cpg_ros/robot_sim')]
RATE = 500.0
TOPICS = {'imu': Imu, 'joint_states': JointState, 'foot_contacts': Float64MultiArray}
FAULTS = ('dead', 'frozen', 'nan', 'delayed', 'scaled')
TARGETS = {'real_time_factor': 0.99, 'cpu_more_percent': 5.0, 'latency_ms': 3.0, 'falls': 0}
#: A command that leaves sooner after a message cannot have been made with it, s.
SOONEST = 2e-4


def node(**more: object) -> Process:
    return Process(GENERATOR, robot='unitree_go2', rate=RATE, combined_topic="''",
                   **more).wait_for('publishing')


class Probe:
    """Notes when messages were published, and where the robot is."""

    def __init__(self) -> None:
        self.node = rclpy.create_node('probe')
        self.sensed: list[int] = []
        self.commanded: list[int] = []
        self.upright, self.stamps = True, deque(maxlen=2)
        best = QoSProfile(depth=50, reliability=ReliabilityPolicy.BEST_EFFORT)
        for kind, topic, kept in ((Imu, 'imu', self.sensed), (JointState, 'lh/joint_states',
                                                              self.commanded)):
            self.node.create_subscription(
                kind, topic, lambda _, info, kept=kept: kept.append(info['source_timestamp']),
                best, raw=True)
        self.node.create_subscription(Odometry, 'odom', self._odom, best)
        self.began: tuple[float, float] | None = None

    def _odom(self, message: Odometry) -> None:
        turned = message.pose.pose.orientation
        self.upright = 1.0 - 2.0 * (turned.x**2 + turned.y**2) > 0.5

    def spin(self, seconds: float) -> None:
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            rclpy.spin_once(self.node, timeout_sec=0.01)

    def latency_ms(self) -> dict[str, float]:
        commanded = np.sort(np.array(self.commanded))
        sensed = np.sort(np.array(self.sensed))
        place = np.searchsorted(commanded, sensed + round(1e9 * SOONEST))
        good = place < commanded.size
        waited = 1e-6 * (commanded[place[good]] - sensed[good])
        return dict(zip(('p50', 'p95', 'p99'), np.percentile(waited, [50, 95, 99]).tolist(),
                        strict=True))


class Relay:
    """Hands on the robot's messages, one topic of them wrong."""

    def __init__(self, node: Node) -> None:
        self.wrong: tuple[str, str] = ('', '')
        self._late = {topic: deque[bytes](maxlen=round(0.2 * RATE)) for topic in TOPICS}
        self._frozen: dict[str, bytes] = {}
        best = QoSProfile(depth=5, reliability=ReliabilityPolicy.BEST_EFFORT)
        for topic, kind in TOPICS.items():
            out = node.create_publisher(kind, f'relay/{topic}', 5)
            node.create_subscription(
                kind, topic, lambda data, topic=topic, out=out: self._pass(topic, data, out),
                best, raw=True)

    def _pass(self, topic: str, data: bytes, out: object) -> None:
        late = self._late[topic]
        late.append(data)
        how = self.wrong[1] if self.wrong[0] == topic else ''
        if how != 'frozen':
            self._frozen.pop(topic, None)
        if how == 'dead':
            return
        if how == 'delayed':
            data = late[0]
        elif how == 'frozen':
            first = self._frozen.setdefault(topic, data)
            # Stamped anew, as by a driver that keeps its last measurement.
            data = data[:12] + first[12:] if topic != 'foot_contacts' else first
        elif how:
            data = spoilt(topic, data, np.nan if how == 'nan' else 10.0)
        out.publish(data)  # type: ignore[attr-defined]


def spoilt(topic: str, data: bytes, factor: float) -> bytes:
    """Multiply all measured numbers."""
    message = deserialize_message(data, TOPICS[topic])
    parts = ('orientation', 'angular_velocity', 'linear_acceleration')
    for held in (getattr(message, part) for part in parts if hasattr(message, part)):
        for axis in (axis for axis in 'xyzw' if hasattr(held, axis)):
            setattr(held, axis, factor * getattr(held, axis))
    for field in ('position', 'velocity', 'effort', 'data'):
        if hasattr(message, field):
            setattr(message, field, [factor * value for value in getattr(message, field)])
    return serialize_message(message)


def walked(seconds: float, feedback: bool) -> dict[str, object]:
    """Walk; return the CPU time of both nodes, the real-time factor and the latency."""
    log(f'feedback {feedback}: {seconds:g} s')
    probe = Probe()
    try:
        with Process(SIM, robot='unitree_go2').wait_for('simulating') as sim, \
                node(**{'feedback.enabled': str(feedback).lower()}) as rhythm:
            probe.spin(4.0)
            probe.sensed.clear()
            probe.commanded.clear()
            before, began = (rhythm.cpu_s(), sim.cpu_s()), time.monotonic()
            probe.spin(seconds)
            spent = time.monotonic() - began
            return {'cpu_generator_percent': 100.0 * (rhythm.cpu_s() - before[0]) / spent,
                    'cpu_robot_sim_percent': 100.0 * (sim.cpu_s() - before[1]) / spent,
                    'real_time_factor': len(probe.sensed) / spent / RATE,
                    'commands_per_s': len(probe.commanded) / spent,
                    'latency_ms': probe.latency_ms(), 'upright': probe.upright}
    finally:
        probe.node.destroy_node()


def faults(seconds: float) -> dict[str, bool]:
    """Make each input wrong each way in one walk; return what was upright afterwards."""
    probe = Probe()
    relay, found = Relay(probe.node), {}
    topics = {f'feedback.{name}_topic': f'relay/{topic}' for name, topic in (
        ('imu', 'imu'), ('joint_states', 'joint_states'), ('contacts', 'foot_contacts'))}
    with Process(SIM, robot='unitree_go2').wait_for('simulating'), \
            node(**{'feedback.enabled': 'true'}, **topics):
        probe.spin(4.0)
        for topic in TOPICS:
            for how in FAULTS:
                log(f'{topic} {how}')
                relay.wrong = topic, how
                probe.spin(seconds)
                relay.wrong = '', ''
                probe.spin(1.0)
                found[f'{topic} {how}'] = probe.upright
    return found


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--seconds', type=float, default=15.0)
    parser.add_argument('--no-faults', action='store_true', help='only walk')
    arguments = parser.parse_args()
    enter_workspace()
    rclpy.init()
    closed, open_ = walked(arguments.seconds, True), walked(arguments.seconds, False)
    upright = {} if arguments.no_faults else faults(1.0)
    more = closed['cpu_generator_percent'] - open_['cpu_generator_percent']  # type: ignore
    falls = sum(not one for one in upright.values())
    met = (closed['real_time_factor'] >= TARGETS['real_time_factor']  # type: ignore[operator]
           and more <= TARGETS['cpu_more_percent']
           and closed['latency_ms']['p50'] <= TARGETS['latency_ms']  # type: ignore[index]
           and not falls)
    emit(benchmark='feedback_live', rate=RATE, seconds=arguments.seconds, closed=closed,
         open=open_, cpu_more_percent=more, upright_after_faults=upright, falls=falls,
         targets=TARGETS, met=met)
    return 0 if met else 1


if __name__ == '__main__':
    sys.exit(main())

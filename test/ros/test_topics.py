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

"""What the generator publishes, as another process on the graph sees it."""

from dataclasses import replace
from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from cpg_ros.motion.robot_file import read_robot, write_robot
from diagnostic_msgs.msg import DiagnosticStatus
from graph import off_grid, until
import numpy as np
import pytest
from rclpy.qos import ReliabilityPolicy
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray
from trajectory_msgs.msg import JointTrajectory

CONFIG = Path(get_package_share_directory('cpg_ros')) / 'config'
QUADRUPED = read_robot(CONFIG / 'quadruped.yaml')


def collect(watcher, kind, topic, count=50):
    messages = []
    subscription = watcher.node.create_subscription(kind, topic, messages.append, 1000)
    until(lambda: len(messages) >= count, f'{count} messages on {topic}')
    watcher.destroy(subscription)
    return messages


def test_each_leg_has_its_joints(running):
    _, watcher = running
    for leg, joints in QUADRUPED.legs.items():
        message = collect(watcher, JointState, f'/{leg}/joint_states', 3)[-1]
        assert list(message.name) == [joint.name for joint in joints]
        assert len(message.position) == len(message.velocity) == len(joints)
        assert not message.effort


def test_combined_message_has_all_joints_in_the_declared_order(running):
    _, watcher = running
    watcher.record(0.1)
    assert tuple(watcher.names) == QUADRUPED.order


def compared_by_name(watcher):
    """Compare the legs' messages with combined ones of their instants; return how many angles."""
    legs = {leg: collect(watcher, JointState, f'/{leg}/joint_states', 100)
            for leg in QUADRUPED.legs}
    by_stamp = {round(1e9 * stamp): (p, v) for stamp, p, v in watcher.samples}
    compared = 0
    for leg, messages in legs.items():
        for message in messages:
            stamp = message.header.stamp
            whole = by_stamp.get(round(1e9 * (stamp.sec + 1e-9 * stamp.nanosec)))
            if whole is None:
                continue
            for name, position, velocity in zip(message.name, message.position, message.velocity,
                                                strict=True):
                k = watcher.names.index(name)
                assert (position, velocity) == (whole[0][k], whole[1][k]), leg
                compared += 1
    return compared


def test_legs_and_combined_message_are_of_one_instant(running):
    _, watcher = running
    assert compared_by_name(watcher) > 300


def test_angles_go_with_their_names_in_whatever_order_a_file_declares(stepped, tmp_path):
    path, order = tmp_path / 'reversed.yaml', QUADRUPED.order[::-1]
    write_robot(path, replace(QUADRUPED, order=order))
    _, watcher = stepped('-p', f'robot:={path}')
    assert compared_by_name(watcher) > 300
    assert tuple(watcher.names) == order


def test_stamps_are_a_period_apart(running):
    _, watcher = running
    times, _, _ = watcher.record(2.0)
    assert np.diff(times) == pytest.approx(0.005, abs=1e-6)


@pytest.mark.alone
def test_it_keeps_its_rate_by_the_clock_on_the_wall(start):
    _, watcher = start('-p', 'rate:=200.0')
    times, _, _ = watcher.record(2.0)
    # The stamp is that of the deadline; what is left is the time between two clock readings.
    assert off_grid(times, 0.005) < 1e-3
    assert abs(np.median(np.diff(times)) - 0.005) < 5e-6
    until(lambda: len(watcher.diagnostics) >= 3, 'diagnostics')
    ticks = next(pair.value for pair in watcher.diagnostics[-1].values
                 if pair.key == 'ticks in the last second')
    assert abs(int(ticks) - 200) <= 20


def test_velocity_is_the_derivative_of_position(running):
    _, watcher = running
    _, positions, velocities = watcher.record(2.0)
    # Fourth-order central difference on the exact grid of 5 ms.
    slope = (positions[:-4] - 8 * positions[1:-3] + 8 * positions[3:-1] - positions[4:]) / 0.06
    assert np.abs(slope - velocities[2:-2]).max() < 2e-3 * np.abs(velocities).max()


def test_frequency_is_in_strides_a_second(running):
    _, watcher = running
    _, positions, _ = watcher.record(10.0)
    x = positions[:, watcher.names.index('lh_thigh_joint')] - 0.8
    k = np.nonzero((x[:-1] < 0) & (x[1:] >= 0))[0]
    crossings = 0.005 * (k + x[k] / (x[k] - x[k + 1]))
    strides = (crossings.size - 1) / (crossings[-1] - crossings[0])
    assert strides == pytest.approx(2.0, rel=1e-5)


def test_amplitude_is_in_radians(running):
    _, watcher = running
    _, positions, _ = watcher.record(3.0)
    swing = positions[:, watcher.names.index('rf_thigh_joint')] - 0.8
    # 100 samples a stride miss the peak by at most (1 - cos(pi/100)) of it.
    assert swing.max() == pytest.approx(0.25, abs=2e-4)
    assert swing.min() == pytest.approx(-0.25, abs=2e-4)


def test_phases_are_those_of_the_trot(running):
    _, watcher = running
    for message in collect(watcher, Float64MultiArray, '/cpg_generator/phase', 100):
        lh, rh, lf, rf = message.data
        assert message.layout.dim[0].label == 'lh,rh,lf,rf'
        for phase, expected in ((rh, 0.5), (lf, 0.5), (rf, 0.0)):
            assert abs((phase - lh - expected + 0.5) % 1 - 0.5) < 1e-5


def test_gait_is_latched(running):
    _, watcher = running
    until(lambda: watcher.gaits, 'the latched gait')
    assert watcher.gaits[-1] == 'trot'


def test_diagnostics_are_ok_once_a_second(running):
    _, watcher = running
    until(lambda: len(watcher.diagnostics) >= 3, 'diagnostics')
    status = watcher.diagnostics[-1]
    values = {pair.key: pair.value for pair in status.values}
    assert status.level in (DiagnosticStatus.OK, DiagnosticStatus.WARN)
    assert status.hardware_id == 'quadruped'
    assert values['gait'] == 'trot'
    assert int(values['ticks in the last second']) > 0


def test_goat_on_topics_of_another_name(stepped):
    _, watcher = stepped('-p', 'robot:=goat', '-p', 'combined_topic:=all_joints',
                               '-r', 'lh/joint_states:=left_hind')
    message = collect(watcher, JointState, '/left_hind', 3)[-1]
    assert list(message.name) == ['lh_tarsal_joint', 'lh_toe_joint']
    assert len(collect(watcher, JointState, '/all_joints', 3)[-1].name) == 8
    assert watcher.node.count_publishers('/joint_states') == 0


def test_joint_trajectory_for_ros2_control(stepped):
    _, watcher = stepped('-p', 'command:=joint_trajectory', '-p', 'gait:=walk',
                         '-p', 'assume_stand:=true')
    messages = collect(watcher, JointTrajectory, '/joint_trajectory_controller/joint_trajectory')
    for message in messages:
        (point,) = message.points
        assert tuple(message.joint_names) == QUADRUPED.order
        assert len(point.positions) == len(point.velocities) == 12
        assert point.time_from_start.nanosec == 10_000_000
    assert np.ptp([message.points[0].positions for message in messages], axis=0).max() > 0.1


def test_forward_position_for_ros2_control(stepped):
    _, watcher = stepped('-p', 'command:=forward_position', '-p', 'rate:=50', '-p',
                         'assume_stand:=true')
    commands = collect(watcher, Float64MultiArray, '/forward_position_controller/commands')
    sent = {tuple(message.data) for message in commands}
    assert len(sent & {tuple(p) for _, p, _ in watcher.samples}) > 30


def test_quality_of_service_can_be_overridden(stepped):
    name = 'qos_overrides./joint_states.publisher.reliability'
    _, watcher = stepped('-p', f'{name}:=best_effort')
    infos = until(lambda: watcher.node.get_publishers_info_by_topic('/joint_states'), 'publisher')
    assert infos[0].qos_profile.reliability == ReliabilityPolicy.BEST_EFFORT

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

"""The bridge to servos: state machine, start, watchdog and bus in real processes."""

import contextlib
import signal
import socket
import threading
import time

from cpg_ros.motion.robot_file import load_robot
from cpg_ros.ros.bridges.watchdog_link import TickMonitor
from graph import EXECUTABLE, free_domain, Process, until
import numpy as np
import pytest
import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import JointState
from servo_chain import calibrated, JOINTS, LYING, servo_steps, ServoChain
from std_msgs.msg import Float64MultiArray, String
from std_srvs.srv import Trigger

BRIDGE, BUS = EXECUTABLE.with_name('servo_bridge'), EXECUTABLE.with_name('servo_bus')
BIPED = load_robot('biped')
#: The stand of the robot file, in motor order: knees 0.5 rad, ankles -0.1 rad.
STAND = np.array([-0.1, 0.5, -0.1, 0.5])
#: Angles of motors in the order of the robot file.
ORDER = [JOINTS.index(name) for name in BIPED.order]


class Biped:
    """A bus of servos that reach their angles at once, and a generator of constant targets."""

    def __init__(self, domain):
        self.q, self.driven = np.array(LYING), False
        self.target, self.states, self.received = None, [], 0
        self._context = rclpy.Context()
        rclpy.init(context=self._context, domain_id=domain)
        self.node = rclpy.create_node('biped', context=self._context, enable_rosout=False)
        self._publisher = self.node.create_publisher(JointState, 'servo/joint_states', 1)
        self._targets = self.node.create_publisher(
            Float64MultiArray, 'forward_position_controller/commands', 10)
        self.node.create_subscription(Float64MultiArray, 'servo/commands', self._command, 10)
        self.node.create_subscription(
            String, '/servo_bridge/state', lambda message: self.states.append(message.data),
            QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL))
        self._restart = self.node.create_client(Trigger, '/servo_bridge/start')
        self.node.create_timer(0.01, self._publish)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self.node)
        self._thread = threading.Thread(target=self._executor.spin, daemon=True)
        self._thread.start()

    def _command(self, message):
        self.driven = len(message.data) > 0
        self.received += 1
        if self.driven:
            self.q = np.array(message.data)

    def _publish(self):
        self._publisher.publish(JointState(name=JOINTS, position=self.q))
        if self.target is not None:
            self._targets.publish(Float64MultiArray(data=self.target[ORDER].tolist()))

    def wait_for(self, *states):
        """Wait until the bridge's last states are these."""
        until(lambda: tuple(self.states[-len(states):]) == states, f'{states}: {self.states}')

    def rise(self):
        """Wait for the stand, and start again where a shared machine stood still on the way."""
        until(lambda: self.states and self.states[-1] in ('standing', 'damping'), 'the stand')
        for _ in range(10):
            if self.states[-1] == 'standing':
                break
            until(lambda: not self.driven, 'damping')
            self.restart()
            until(lambda: self.states[-1] in ('standing', 'damping'), 'the stand')
        self.wait_for('rising', 'standing')

    def restart(self):
        count = len(self.states)
        future = self._restart.call_async(Trigger.Request())
        until(future.done, 'an answer')
        assert future.result().success, future.result().message
        until(lambda: len(self.states) > count, 'a start')

    def end(self):
        self._executor.shutdown()
        self._thread.join()
        self.node.destroy_node()
        rclpy.shutdown(context=self._context)


@pytest.fixture
def calibration(tmp_path):
    """Write a calibration file; return its path."""
    return calibrated(tmp_path, '/dev/none')


def started(domain, calibration, *parameters, executable=BRIDGE):
    given = [f'calibration:={calibration}', *parameters]
    if executable == BRIDGE:
        given[:0] = ('robot:=biped', 'command:=forward_position', 'target_timeout:=1.0',
                     'state_timeout:=5.0', 'watchdog_timeout:=1.0')
    return Process(*(word for name in given for word in ('-p', name)), domain=domain,
                   executable=executable)


def test_it_rises_follows_sits_and_leaves_a_killed_bridge_to_the_watchdog(calibration):
    domain = free_domain()
    biped = Biped(domain)
    bridge = started(domain, calibration)
    try:
        biped.rise()
        # Whoever listens late hears the last state only.
        assert set(biped.states) <= {'idle', 'rising', 'damping', 'standing'}
        until(lambda: np.allclose(biped.q, STAND, atol=0.01), 'the stand')
        biped.target = STAND + 0.3
        biped.wait_for('standing', 'following')
        until(lambda: np.allclose(biped.q, biped.target, atol=1e-6), 'the target')
        # A generator that ends is no reason to fall.
        biped.target = None
        biped.wait_for('following', 'sitting', 'damping')
        until(lambda: np.allclose(biped.q, LYING, atol=0.01), 'lying')
        until(lambda: not biped.driven, 'damping')
        biped.restart()
        biped.rise()
        bridge.signal(signal.SIGKILL)
        bridge.wait()
        until(lambda: not biped.driven, 'the watchdog')
        count = biped.received
        until(lambda: biped.received > count + 10, 'more of the watchdog')
        # The next bridge takes the watchdog over, and ends it with itself.
        biped.states.clear()
        bridge = started(domain, calibration)
        biped.rise()
        # Ctrl-C from the terminal, and from what launched it, is one.
        bridge.signal(signal.SIGINT)
        bridge.signal(signal.SIGINT)
        assert bridge.wait() == 0, bridge.log
        biped.wait_for('standing', 'sitting', 'damping')
        assert 'damping: it has sat down: SIGINT' in bridge.log
        with pytest.raises(ConnectionRefusedError):
            end_watchdog(domain)
    finally:
        bridge.end()
        biped.end()
        with contextlib.suppress(ConnectionRefusedError):
            end_watchdog(domain)


def test_who_presses_ctrl_c_once_more_lets_go_on_the_way_down(calibration):
    domain = free_domain()
    biped, bridge = Biped(domain), started(domain, calibration)
    try:
        biped.rise()
        bridge.signal(signal.SIGINT)
        biped.wait_for('standing', 'sitting')
        time.sleep(0.6)
        bridge.signal(signal.SIGINT)
        assert bridge.wait() == 0 and 'damping: SIGINT again' in bridge.log, bridge.log
        until(lambda: not biped.driven, 'damping')
    finally:
        bridge.end()
        biped.end()


def end_watchdog(domain):
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as line:
        line.connect(f'\0cpg_ros/servo/watchdog/{domain}/servo/commands')
        line.send(TickMonitor.END)
        time.sleep(0.1)


@pytest.mark.parametrize(('parameter', 'words'), [
    ('robot:=goat', "'goat' has no joint 'right_ankle_joint'; these servos have right_ankle"),
    ('rate:=1000.0', 'parameter rate: 1000.0 is not from 10 to 200'),
    ('command:=thoughts', "command 'thoughts' is not one of joint_states, "),
    ('calibration:=/no.yaml', '/no.yaml: No such file')])
def test_what_cannot_be_used_is_refused_in_one_line(calibration, parameter, words):
    bridge = started(free_domain(), calibration, parameter)
    assert bridge.wait() == 1
    assert words in bridge.log and len(bridge.lines) == 1


def test_servos_that_cannot_say_where_they_are_are_not_driven_unasked(tmp_path):
    path = tmp_path / 'servos.yaml'
    path.write_text('board: pca9685\ndevice: /dev/null\nservos:\n  knee: {channel: 0, '
                    'centre: 1500, direction: 1, per_rad: 600, lower: 600, upper: 2400, '
                    'rest: 0}\n')
    bus = started(free_domain(), path, executable=BUS)
    assert bus.wait() == 1
    assert 'set no_position_feedback to true' in bus.log and len(bus.lines) == 1
    # /dev/null is no bus: asked for, it goes on to open it.
    bus = started(free_domain(), path, 'no_position_feedback:=true', executable=BUS)
    assert bus.wait() == 1 and '/dev/null' in bus.log


@pytest.fixture
def chain():
    """Serve Feetech servos that lie."""
    servos = ServoChain(dict(zip((1, 2, 3, 4), servo_steps(LYING).tolist(), strict=True)))
    yield servos
    servos.end()


def test_a_bus_that_ends_with_its_bridge_waits_for_its_way_down(tmp_path, chain):
    domain, path = free_domain(), calibrated(tmp_path, chain.path)
    bus = started(domain, path, 'command_timeout:=5.0', 'end_timeout:=30.0', executable=BUS)
    bridge = started(domain, path)
    try:
        bridge.wait_for('standing: it has risen')
        until(lambda: all(chain.torque.values()), 'torque')
        # As Ctrl-C in a terminal, or ros2 launch, to all.
        bus.signal(signal.SIGINT)
        bridge.signal(signal.SIGINT)
        assert bridge.wait() == 0 and bus.wait() == 0, bridge.log + bus.log
        assert not any(chain.torque.values())
        goals = [chain.goals[k] for k in (1, 2, 3, 4)]
        assert np.abs(goals - servo_steps(LYING)).max() <= 1, bridge.log + bus.log
    finally:
        for process in (bridge, bus):
            process.end()
        with contextlib.suppress(ConnectionRefusedError):
            end_watchdog(domain)


def test_a_bridge_drives_servos_on_a_serial_bus_which_are_let_go_whatever_fails(tmp_path, chain):
    domain = free_domain()

    def goals():
        return np.array([chain.goals[k] for k in (1, 2, 3, 4)])

    path = calibrated(tmp_path, chain.path)
    # Longer than the watchdog's, which is to be the first.
    bus = started(domain, path, 'command_timeout:=5.0', executable=BUS)
    bridge = None
    try:
        bus.wait_for(r'4 servos \(feetech_sts\)')
        until(lambda: chain.packets > 5, 'questions')
        assert not any(chain.torque.values())
        bridge = started(domain, path)
        bridge.wait_for('standing: it has risen')
        # The bus is a few ticks behind what the bridge commands.
        until(lambda: all(chain.torque.values())
              and np.abs(goals() - servo_steps(STAND)).max() <= 1, 'the stand')
        # The watchdog lets them go when the bridge is killed.
        bridge.signal(signal.SIGKILL)
        bus.wait_for('servo torque disabled: as commanded')
        until(lambda: not any(chain.torque.values()), 'no torque')
        bridge = started(domain, path)
        bridge.wait_for('standing: it has risen')
        chain.error = 0x20
        bus.wait_for('servo . reports the error 0x20')
        assert bus.wait() == 1
        assert not any(chain.torque.values())
        bridge.wait_for('damping: no fresh state of the robot for 5000 ms')
    finally:
        for process in filter(None, (bridge, bus)):
            process.end()
        with contextlib.suppress(ConnectionRefusedError):
            end_watchdog(domain)

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

"""A bridge of one's own: state machine, start and watchdog in real processes, std messages."""

import contextlib
import os
from pathlib import Path
import signal
import socket
import stat
import sys
import threading
import time

from cpg_ros.robots.robot_file import load_robot
from cpg_ros.safety.tick_monitor import TickMonitor
from graph import free_domain, Process, until
import numpy as np
import pytest
import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import JointState
from servo_bridge import JOINTS, LYING, TORQUE
from std_msgs.msg import Float64MultiArray, String
from std_srvs.srv import Trigger

SUPPORT = Path(__file__).resolve().parents[1] / 'support'
BIPED = load_robot('biped')
#: The stand of the robot file, in motor order: knees 0.5 rad, ankles -0.1 rad.
STAND = np.array([-0.1, 0.5, -0.1, 0.5])
#: Angles of motors in the order of the robot file.
ORDER = [JOINTS.index(name) for name in BIPED.order]


class Biped:
    """Servos that reach the commanded angles at once, and a generator of constant targets."""

    def __init__(self, domain):
        self.q, self.kp, self.kd = np.array(LYING), np.zeros(4), np.zeros(4)
        self.target, self.states, self.received, self.torque = None, [], 0, 0.0
        self._context = rclpy.Context()
        rclpy.init(context=self._context, domain_id=domain)
        self.node = rclpy.create_node('biped', context=self._context, enable_rosout=False)
        self._publisher = self.node.create_publisher(JointState, '/servo/joint_states', 1)
        self._targets = self.node.create_publisher(
            Float64MultiArray, 'forward_position_controller/commands', 10)
        self.node.create_subscription(Float64MultiArray, '/servo/commands', self._command, 10)
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
        q, self.kp, self.kd = np.array(message.data).reshape(3, 4)
        self.torque = max(self.torque, np.abs(self.kp * (q - self.q)).max())
        self.received += 1
        if self.kp.any():
            self.q = q

    def _publish(self):
        self._publisher.publish(JointState(name=JOINTS, position=self.q, velocity=np.zeros(4)))
        if self.target is not None:
            self._targets.publish(Float64MultiArray(data=self.target[ORDER].tolist()))

    @property
    def damped(self):
        return not self.kp.any() and (self.kd == 5.0).all()

    def wait_for(self, *states):
        """Wait until the bridge's last states are these."""
        until(lambda: tuple(self.states[-len(states):]) == states, f'{states}: {self.states}')

    def rise(self):
        """Wait for the stand, and start again where a shared machine stood still on the way."""
        until(lambda: self.states and self.states[-1] in ('standing', 'damping'), 'the stand')
        for _ in range(10):
            if self.states[-1] == 'standing':
                break
            until(lambda: self.damped, 'damping')
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
def script(tmp_path):
    """Return an executable that runs the bridge."""
    path = tmp_path / 'servo_bridge'
    path.write_text(f'#!/bin/sh\nexec {sys.executable} {SUPPORT / "servo_bridge.py"} "$@"\n')
    path.chmod(path.stat().st_mode | stat.S_IXUSR)
    return path


def started(script, domain, *parameters):
    path = os.pathsep.join([str(SUPPORT), os.environ.get('PYTHONPATH', '')])
    words = [word for name in ('command:=forward_position', 'target_timeout:=1.0', *parameters)
             for word in ('-p', name)]
    return Process(*words, domain=domain, executable=script, environment={'PYTHONPATH': path})


def test_it_rises_follows_sits_and_leaves_a_killed_bridge_to_the_watchdog(script):
    domain = free_domain()
    biped = Biped(domain)
    bridge = started(script, domain)
    try:
        biped.rise()
        assert biped.states[:2] == ['idle', 'rising']
        assert np.allclose(biped.q, STAND, atol=0.01)
        biped.target = STAND + 0.3
        biped.wait_for('standing', 'following')
        until(lambda: np.allclose(biped.q, biped.target, atol=1e-6), 'the target')
        # A generator that ends is no reason to fall.
        biped.target = None
        biped.wait_for('following', 'sitting', 'damping')
        assert np.allclose(biped.q, LYING, atol=0.01) and biped.torque < TORQUE * (1.0 + 1e-9)
        until(lambda: biped.damped, 'damping')
        biped.restart()
        biped.rise()
        bridge.signal(signal.SIGKILL)
        bridge.wait()
        until(lambda: biped.damped, 'the watchdog')
        count = biped.received
        until(lambda: biped.received > count + 10, 'more of the watchdog')
        # The next bridge takes the watchdog over, and ends it with itself.
        biped.states.clear()
        bridge = started(script, domain)
        biped.rise()
        bridge.signal(signal.SIGINT)
        assert bridge.wait() == 0, bridge.log
        biped.wait_for('standing', 'sitting', 'damping')
        with pytest.raises(ConnectionRefusedError):
            end_watchdog(domain)
    finally:
        bridge.end()
        biped.end()
        with contextlib.suppress(ConnectionRefusedError):
            end_watchdog(domain)


def end_watchdog(domain):
    with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as line:
        line.connect(f'\0cpg_ros/servo/watchdog/{domain}/servo/commands')
        line.send(TickMonitor.END)
        time.sleep(0.1)


@pytest.mark.parametrize(('parameter', 'words'), [
    ('robot:=goat', "'goat' has no joint 'right_ankle_joint'; these servos have right_ankle"),
    ('kp:=200.0', 'parameter kp: 200.0 is not from 0 to 100'),
    ('command:=thoughts', "command 'thoughts' is not one of joint_states, ")])
def test_what_cannot_be_used_is_refused_in_one_line(script, parameter, words):
    bridge = started(script, free_domain(), parameter)
    assert bridge.wait() == 1
    assert words in bridge.log and len(bridge.lines) == 1

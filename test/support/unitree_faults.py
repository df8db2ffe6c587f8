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

"""A stand-in robot, a bridge and a walking generator; and the faults of the table in docs."""

import contextlib
import math
import os
from pathlib import Path
import signal
import socket
import struct
import subprocess
import sys
import time

from cpg_ros.ros.bridges.watchdog_link import TickMonitor
from graph import EXECUTABLE, free_domain, Process, until, Watcher
import numpy as np
from rclpy.qos import DurabilityPolicy, QoSProfile
from stand_in import StandIn
from std_msgs.msg import Float64MultiArray, String
from std_srvs.srv import Trigger

BRIDGE = EXECUTABLE.with_name('unitree_bridge')
COMMANDS = 'forward_position_controller/commands'


def name_of(kind, domain):
    """Return the name of a socket of the bridge or the watchdog in the abstract name space."""
    return f'\0cpg_ros/unitree/{kind}/{domain}/lowcmd'


class Stranger:
    """A process of another user: feeds a watchdog, or takes its name or the bridge's.

    Use as a context; only root can start one.
    """

    def __init__(self, does, kind, domain):
        self._process = subprocess.Popen(
            [sys.executable, str(Path(__file__).with_name('unitree_stranger.py')), does,
             name_of(kind, domain)[1:]], stdout=subprocess.PIPE)
        assert self._process.stdout.readline(), 'it does not run'

    @property
    def pid(self):
        return self._process.pid

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self._process.kill()
        self._process.wait()
        self._process.stdout.close()


class Walk:
    """All three of them, with what has been seen of the bridge's phases."""

    def __init__(self, *parameters, services=False, frequency=2.0, model='go2'):
        self.domain = free_domain()
        self.robot = StandIn(self.domain, services=services, model=model)
        self._given = [f'robot:=unitree_{model}', *(
            ['network:=biped', 'gait:=walk'] if model == 'g1' else
            ['gait:=trot', f'frequency:={frequency}'])]
        self._parameters = [word for name in (
            f'model:={model}', f'robot:=unitree_{model}', 'command:=forward_position',
            f'motion_switcher:={str(services).lower()}', 'exclusive:=false', *parameters)
            for word in ('-p', name)]
        self.phases = []
        self.robot.start()
        self.watcher = Watcher(self.domain, '/unitree_bridge')
        self.watcher.node.create_subscription(
            String, '/unitree_bridge/state',
            lambda message: self.phases.append((time.monotonic(), message.data)),
            QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL))
        self.other = self.watcher.node.create_publisher(Float64MultiArray, COMMANDS, 10)
        self.bridge = self.generator = None
        self.start_generator()
        self.start_bridge()

    def start_bridge(self):
        self.bridge = Process(*self._parameters, domain=self.domain, executable=BRIDGE)

    def start_generator(self):
        self.generator = Process(*(word for name in (
            *self._given, 'rate:=500.0', "combined_topic:=''", 'feedback.enabled:=false',
            'command:=forward_position', 'exclusive:=false', 'assume_stand:=true')
            for word in ('-p', name)), domain=self.domain)

    @property
    def phase(self):
        return self.phases[-1][1] if self.phases else ''

    def wait_for(self, phase):
        before, lines = len(self.phases), len(self.bridge.lines)
        until(lambda: self.phase == phase or not self.bridge.alive or
              any(one == 'damping' for _, one in self.phases[before:])
              or 'not started' in '\n'.join(self.bridge.lines[lines:]), phase)
        assert self.phase == phase, self.bridge.log
        return self

    def walking(self):
        """Walk, whatever was before."""
        if not self.generator.alive:
            self.start_generator()
            self.generator.wait_for('publishing')
        if self.robot.leaning:
            # A robot whose legs fold amid a stride may roll over.
            self.robot.lift = True
            until(lambda: not self.robot.lift, 'somebody who lifts it')
        if self.phase == 'damping':
            self.call('start')
        if self.robot.humanoid and self.phase != 'following':
            # It hangs in a rack, and is sent on.
            self.wait_for('hanging').call('start')
        self.wait_for('following')
        time.sleep(1.2)
        assert self.phase == 'following', self.bridge.log
        return self

    def call(self, service):
        """Call a service of the bridge."""
        answer = self.watcher.call(Trigger, f'/unitree_bridge/{service}', Trigger.Request())
        assert answer.success, answer.message

    def publish(self, angles, seconds):
        """Publish targets beside the generator for some time."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            self.other.publish(Float64MultiArray(data=[float(angle) for angle in angles]))
            time.sleep(0.005)

    def damped_after(self, instant):
        """Seconds from an instant until the first command that damps for good."""
        def for_good():
            # A watchdog that a busy machine made look up damps for a tick or two.
            rows = self.robot.commands
            return rows[-1, 0] > instant and not rows[-25:, 1].any()

        until(for_good, 'damping')
        rows = self.robot.since(instant)
        return rows[np.flatnonzero(rows[:, 1] > 0.0).max(initial=-1) + 1, 0] - instant

    def to_watchdog(self):
        """Return a connection to the watchdog."""
        line = socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        line.connect(name_of('watchdog', self.domain))
        return line

    @property
    def watchdog(self):
        """The watchdog's process."""
        with self.to_watchdog() as line:
            return struct.unpack('3i', line.getsockopt(
                socket.SOL_SOCKET, socket.SO_PEERCRED, 12))[0]

    def end(self):
        for one in (self.generator, self.bridge):
            one.signal(signal.SIGCONT) if one.alive else None
        self.bridge.end()
        # A bridge that has never driven leaves the watchdog of the one before at work.
        with contextlib.suppress(ConnectionRefusedError), self.to_watchdog() as line:
            line.send(TickMonitor.END)
        for one in (self.generator, self.watcher, self.robot):
            one.end()


def generator_killed(walk):
    walk.generator.signal(signal.SIGKILL)
    return time.monotonic()


def generator_stopped(walk):
    walk.generator.signal(signal.SIGSTOP)
    return time.monotonic()


def generator_restarted(walk):
    began = generator_killed(walk)
    walk.generator.wait()
    walk.start_generator()
    return began


def nan_target(walk):
    began = time.monotonic()
    walk.publish([math.nan] * 12, 0.004)
    return began


def target_leaps(walk):
    began = generator_stopped(walk)
    walk.publish(walk.robot.q[:12] + 1.0, 0.3)
    return began


def state_frozen(walk):
    walk.robot.frozen = True
    return time.monotonic()


def tilt(walk):
    walk.robot.lean = 1.0
    return time.monotonic()


def motor_error(walk):
    """Let a motor report an error; only humanoids do."""
    walk.robot.error = 0x10
    return time.monotonic()


def bridge_killed(walk):
    walk.bridge.signal(signal.SIGKILL)
    return time.monotonic()


def fed_by_another_user(walk):
    """Stop the bridge while another user's process says what a living bridge would."""
    with Stranger('feed', 'watchdog', walk.domain):
        time.sleep(0.2)
        walk.bridge.signal(signal.SIGSTOP)
        instant = time.monotonic()
        time.sleep(0.5)
        damped = walk.robot.damped
        walk.bridge.signal(signal.SIGCONT)
        assert damped, 'a watchdog that another user feeds does not damp'
        until(lambda: walk.phase == 'damping', 'damping')
    return instant


def bridge_and_watchdog_killed(walk):
    """Kill both at once; return the number of commands after 0.1 s, and whether joints are held.

    Nothing of ours is left to send: the stand-in keeps the last command, as Unitree's simulators.
    """
    watchdog = walk.watchdog
    walk.bridge.signal(signal.SIGSTOP)
    # Stopped first: the watchdog would see the bridge go, and send once.
    os.kill(watchdog, signal.SIGKILL)
    walk.bridge.signal(signal.SIGKILL)
    instant = time.monotonic()
    time.sleep(1.1)
    return len(walk.robot.since(instant + 0.1)), bool(walk.robot.commands[-1, 1] > 0.0)


def network_cut(walk):
    walk.robot.cut = True
    time.sleep(1.0)
    walk.robot.cut = False
    return time.monotonic()


def interrupted(walk):
    walk.bridge.signal(signal.SIGINT)
    return time.monotonic()


#: What is done -> within how many s it must damp; and when it must begin to sit, if it does.
FAULTS = {generator_killed: (1.6 + 0.1, 0.1), generator_stopped: (1.6 + 0.1, 0.1),
          generator_restarted: (1.6 + 0.1, 0.1), nan_target: (0.02, None),
          target_leaps: (1.6 + 0.1, 0.1), state_frozen: (0.04, None), tilt: (0.02, None),
          bridge_killed: (0.04, None), network_cut: (0.02, None),
          interrupted: (0.5 + 1.5 + 0.1, 0.02)}
if os.geteuid() == 0:
    FAULTS[fed_by_another_user] = (0.04, None)
#: Model -> its faults.
FAULTS_OF = {'go2': FAULTS, 'g1': {**FAULTS, motor_error: (0.02, None)}}


def mend(walk):
    """Undo a fault."""
    walk.robot.frozen, walk.robot.lean, walk.robot.error = False, 0.0, 0
    if walk.generator.alive:
        walk.generator.signal(signal.SIGCONT)
    if not walk.bridge.alive:
        walk.bridge._process.wait()
        walk.phases.clear()
        walk.start_bridge()


def inflict(walk, fault):
    """Let a fault happen; return seconds until it damped, and what was seen meanwhile.

    When it began to sit, s; largest torque commanded by what the joint bears; largest step of it
    in N m between two commands that both hold the joints; whether the robot is upright.
    """
    seen = len(walk.phases)
    instant = fault(walk)
    damped = walk.damped_after(instant)
    rows = walk.robot.since(instant - 1.0)
    held = (rows[1:, 1] > 0.0) & (rows[:-1, 1] > 0.0)
    if fault is generator_restarted:
        walk.generator.wait_for('publishing')
        time.sleep(0.5)
    assert walk.robot.damped and not walk.robot.wrong
    if fault is interrupted:
        walk.bridge.wait()
    sat = [at - instant for at, phase in walk.phases[seen:] if phase == 'sitting']
    return (damped, sat, rows[:, 2].max(), rows[1:, 3][held].max(initial=0.0),
            not walk.robot.leaning)

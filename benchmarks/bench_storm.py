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

"""A generator at 500 Hz of every network under storms of requests; all it publishes is checked.

Parameters (hostile and fair), cmd_vel, ~/enable and SIGSTOP; with --pipe nobody reads the log
during the second half of each storm, and the pipe is closed before its end. The row 'humanoid' is
a simulated humanoid in lockstep with its generator, which walks with feedback through the same
storm (a Unitree G1 if its model is installed); it is put on its feet every 10 s.
"""

import argparse
from importlib.util import find_spec
import os
import random
import signal
import subprocess
import threading
import time

from client import NoAnswer, ParameterClient
from common import emit, log
from geometry_msgs.msg import Twist
from hostile import requests
import numpy as np
from processes import ends_with_us, enter_workspace, GENERATOR, Process
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
import rclpy
from rclpy.qos import QoSProfile
from sensor_msgs.msg import JointState
from stage import SIM
from std_srvs.srv import SetBool, Trigger

RATE = 500.0
NETWORKS = ('delayed', 'quadruped', 'biped', 'hopf', 'matsuoka', 'phase', 'humanoid')
#: Robots that the networks move; the others move the generic quadruped.
ROBOTS = {'delayed': 'unitree_go2', 'quadruped': 'unitree_go2', 'biped': 'biped',
          'humanoid': 'unitree_g1' if find_spec('mjlab') else 'humanoid'}
STEERED = ('unitree_go2', 'unitree_g1', 'humanoid')
#: Topic of all commands; a simulated robot publishes what it measures on joint_states.
COMMANDS = 'joint_commands'
#: The simulated robot is put on its feet as often, s.
RESET_EVERY = 10.0
TYPES = {bool: ParameterType.PARAMETER_BOOL, int: ParameterType.PARAMETER_INTEGER,
         float: ParameterType.PARAMETER_DOUBLE, str: ParameterType.PARAMETER_STRING}
#: A node that does not end within this time is killed, s.
PATIENCE = 5.0
TARGETS = {'limits_crossed': 0, 'exit_code': 0}
#: What a velocity may differ from those published before and after a step, fraction of the limit.
TOLERANCE = 0.1


class Piped:
    """A generator whose log is a pipe that can be left unread, and closed."""

    def __init__(self, **parameters: object) -> None:
        words = [word for name, value in parameters.items() for word in ('-p', f'{name}:={value}')]
        self.child = subprocess.Popen([*GENERATOR, '--ros-args', *words], stdout=subprocess.PIPE,
                                      stderr=subprocess.STDOUT, preexec_fn=ends_with_us)
        self.reading, self.output = threading.Event(), b''
        self.reading.set()
        threading.Thread(target=self._read, daemon=True).start()

    def _read(self) -> None:
        descriptor = self.child.stdout.fileno()
        try:
            while chunk := os.read(descriptor, 1 << 16):
                self.output += chunk
                self.reading.wait()
        except OSError:
            return

    def wait_for(self, text: bytes) -> None:
        """Wait until its log contains a text (the first start compiles)."""
        deadline = time.monotonic() + 180.0
        while text not in self.output:
            if self.child.poll() is not None or time.monotonic() > deadline:
                raise RuntimeError(f'no {text!r} in:\n{self.output.decode()}')
            time.sleep(0.05)

    def end(self) -> int | None:
        """Interrupt it; return its exit code, or None if it had to be killed."""
        self.child.send_signal(signal.SIGINT)
        try:
            return self.child.wait(PATIENCE)
        except subprocess.TimeoutExpired:
            self.child.kill()
            self.child.wait()
            return None


class Checker:
    """Listens to joint states and compares each message with the robot's limits."""

    def __init__(self, robot: str, simulated: bool) -> None:
        from cpg_ros.motion.robot_file import load_robot
        from cpg_ros.ros.node.polled import PolledSubscription
        joints = load_robot(robot).joints
        self._limits = {joint.name: (joint.lower, joint.upper, joint.velocity)
                        for joint in joints}
        self._simulated = simulated
        self.node = rclpy.create_node('checker')
        # At RATE, more than arrives while a request waits in vain for its answer.
        self._topic = PolledSubscription(self.node, JointState, COMMANDS,
                                         QoSProfile(depth=10000), overridable=False)
        self.messages, self.crossed, self.fastest, self.off = 0, [], 0.0, 0.0
        self._before: tuple[float, np.ndarray, np.ndarray] | None = None

    def take(self) -> None:
        """Check what has arrived."""
        for message, _ in self._topic.receive():
            self._check(message)

    def _check(self, message: JointState) -> None:
        lower, upper, limit = np.array([self._limits[name] for name in message.name]).T
        stamp = message.header.stamp.sec + 1e-9 * message.header.stamp.nanosec
        position, velocity = np.array(message.position), np.array(message.velocity)
        self.messages += 1
        wrong = ''
        if not (np.isfinite(position).all() and np.isfinite(velocity).all()):
            wrong = 'not finite'
        elif (position < lower - 1e-9).any() or (position > upper + 1e-9).any():
            wrong = 'position'
        elif (np.abs(velocity) > limit * (1.0 + 1e-9)).any():
            wrong = 'published velocity'
        elif self._before is not None:
            then, old, before = self._before
            # A message is a tick, however long the process was stopped before it.
            step = (position - old) * RATE
            self.fastest = max(self.fastest, float(np.max(np.abs(step) / limit)))
            # A stop goes on by the steady clock where simulated time stands still.
            again = stamp <= then and not self._simulated
            if again or (np.abs(step) > limit * (1.0 + 1e-3)).any():
                wrong = f'moved {np.max(np.abs(step) / limit):.3g} of the limit'
            elif stamp - then < 1.5 / RATE:
                low, high = np.minimum(before, velocity), np.maximum(before, velocity)
                off = float(np.max(np.maximum(low - step, step - high) / limit))
                self.off = max(self.off, off)
                if off > TOLERANCE:
                    worst = np.argmax(np.maximum(low - step, step - high) / limit)
                    wrong = (f'{message.name[worst]}: velocity {before[worst]:.4g}, then '
                             f'{velocity[worst]:.4g}, step {step[worst]:.4g} rad/s')
        if wrong:
            self.crossed.append(f'{stamp:.3f}: {wrong}')
        self._before = stamp, position, velocity

    def end(self) -> None:
        self.take()
        self.node.destroy_node()


def fair(rng: random.Random, gaits: list[str]) -> list[Parameter]:
    """Return a batch that a user might send."""
    name = rng.choice(['gait', 'frequency', 'ramp', 'transition', 'amplitude'])
    if name == 'gait' and gaits:
        return [Parameter(name=name, value=ParameterValue(
            type=ParameterType.PARAMETER_STRING, string_value=rng.choice(gaits)))]
    high = {'frequency': 3.0, 'amplitude': 1.2}.get(name, 0.5)
    name = name if name != 'gait' else 'frequency'
    number = rng.choice([0.0, rng.uniform(0.0, high)])
    return [Parameter(name=name, value=ParameterValue(
        type=ParameterType.PARAMETER_DOUBLE, double_value=number))]


def storm(row: str, seconds: float, pipe: bool, seed: int) -> dict[str, object]:
    from cpg_ros.networks.registry import PRESETS
    rng = random.Random(f'{row} {seed}')
    robot = ROBOTS.get(row, 'quadruped')
    simulated = row == 'humanoid'
    network = 'biped' if simulated else row
    body = Process(SIM, robot=robot, model=robot, lockstep='true') if simulated else None
    node = Piped(rate=RATE, network=network, robot=robot, ramp=0.2,
                 cmd_vel=str(robot in STEERED).lower(), combined_topic=COMMANDS,
                 use_sim_time=str(simulated).lower(),
                 **{'feedback.enabled': str(simulated).lower()})
    node.wait_for(b'publishing')
    checker, client = Checker(robot, simulated), ParameterClient()
    walk = client.node.create_publisher(Twist, 'cmd_vel', 10)
    enable = client.node.create_client(SetBool, 'cpg_generator/enable')
    reset = client.node.create_client(Trigger, 'robot_sim/reset')
    names = [name for name in client.names() if not name.startswith('qos_overrides')]
    values = client.get(names)
    types = {name: TYPES[type(value)] for name, value in values.items() if type(value) in TYPES}
    odd = requests(types, 1 << 30, seed)
    gaits, counts = list(PRESETS[network]), dict.fromkeys(
        ('requests', 'accepted', 'unanswered', 'stops', 'enables', 'cmd_vels'), 0)
    began, closed, put_up = time.monotonic(), False, 0.0
    while (past := time.monotonic() - began) < seconds and node.child.poll() is None:
        if pipe and past > seconds / 2:
            node.reading.clear()
        if pipe and past > 0.75 * seconds and not closed:
            closed = True
            node.child.stdout.close()
            node.reading.set()
        if simulated and past > put_up + RESET_EVERY:
            put_up = past
            reset.call_async(Trigger.Request())
        twist = Twist()
        twist.linear.x, twist.angular.z = rng.uniform(-1.0, 1.0), rng.uniform(-1.0, 1.0)
        walk.publish(twist)
        counts['cmd_vels'] += 1
        draw = rng.random()
        if draw < 0.03:
            node.child.send_signal(signal.SIGSTOP)
            time.sleep(rng.uniform(0.001, 0.4))
            node.child.send_signal(signal.SIGCONT)
            counts['stops'] += 1
        elif draw < 0.15:
            enable.call_async(SetBool.Request(data=rng.random() < 0.7))
            counts['enables'] += 1
        atomically, batch = (True, fair(rng, gaits)) if draw > 0.5 else next(odd)
        try:
            results = client.set(batch, atomically)
            counts['accepted'] += sum(result.successful for result in results)
        except NoAnswer:
            counts['unanswered'] += 1
        counts['requests'] += 1
        checker.take()
    code = node.end()
    time.sleep(0.5)
    checker.end()
    client.node.destroy_node()
    if body:
        body.end()
    log(f'{row}: {checker.messages} messages, {len(checker.crossed)} wrong, code {code}')
    return {**counts, 'messages': checker.messages, 'limits_crossed': len(checker.crossed),
            'first': checker.crossed[:3], 'fastest': checker.fastest,
            'velocity_off': checker.off, 'exit_code': code}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--seconds', type=float, default=100.0, help='of each network')
    parser.add_argument('--pipe', action=argparse.BooleanOptionalAction, default=True,
                        help='leave the log unread, then close its pipe (default: yes)')
    parser.add_argument('--networks', nargs='+', default=NETWORKS, choices=NETWORKS)
    parser.add_argument('--seed', type=int, default=0)
    arguments = parser.parse_args()
    enter_workspace()
    rclpy.init(args=[])
    found = {network: storm(network, arguments.seconds, arguments.pipe, arguments.seed)
             for network in arguments.networks}
    rclpy.shutdown()
    emit(benchmark='storm', rate=RATE, seconds=arguments.seconds, pipe=arguments.pipe, **found,
         targets=TARGETS, passed=all(one['messages'] > 0 and all(
             one[key] == target for key, target in TARGETS.items()) for one in found.values()))


if __name__ == '__main__':
    main()

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

"""Real processes on a real ROS graph: a generator in a domain of its own, and its watcher."""

import itertools
import os
from pathlib import Path
import re
import signal
import subprocess
import threading
import time
import weakref

from ament_index_python.packages import get_package_prefix
from diagnostic_msgs.msg import DiagnosticArray
import numpy as np
from rcl_interfaces.msg import Parameter as ParameterMessage
from rcl_interfaces.srv import (
    GetParameters,
    ListParameters,
    SetParameters,
    SetParametersAtomically,
)
import rclpy
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, qos_profile_parameters, QoSProfile
from rclpy.subscription import Subscription
from rosgraph_msgs.msg import Clock
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray, String

EXECUTABLE = Path(get_package_prefix('cpg_ros')) / 'lib' / 'cpg_ros' / 'generator'
#: Long enough for a loaded machine; nothing waits that long when all is well.
PATIENCE = 60.0
#: For the last lines of a process that has ended, s.
HELD = 3.0
#: A request that may be made twice, and has no answer for so long, is sent again, s.
TWICE = GetParameters, ListParameters, SetParameters, SetParametersAtomically
LOST = 10.0
#: Which of the processes that share the tests this one is, and how many there are.
WORKER = int(os.environ.get('PYTEST_XDIST_WORKER', 'gw0')[2:])
WORKERS = int(os.environ.get('PYTEST_XDIST_WORKER_COUNT', '1'))
#: Those whose ports the system gives to nobody else, without that of make; other processes that
#: share the tests have others, however many tests each of them has run.
DOMAINS = [domain for domain in range(1, 101) if domain != 42][WORKER::WORKERS]
#: Those of nodes that outlive a test.
OCCUPIED: set[int] = set()
_domains = itertools.count()
#: The processes of running tests, and how many of their last lines an error shows.
_processes: weakref.WeakSet = weakref.WeakSet()
SHOWN = 25


def free_domain() -> int:
    """Give every test a ROS domain of its own, apart from other test runs on the machine."""
    run = os.getpid() if WORKERS == 1 else os.getppid()
    # 13 divides none of the numbers of domains that there are: every run begins elsewhere.
    return next(domain for one in _domains if (
        domain := DOMAINS[(one + 13 * run) % len(DOMAINS)]) not in OCCUPIED)


class Process:
    """The installed generator in a domain of its own, its log kept unless it goes elsewhere."""

    def __init__(self, *ros_args: str, domain: int | None = None, executable: Path = EXECUTABLE,
                 environment: dict[str, str] | None = None,
                 output: int = subprocess.PIPE) -> None:
        self.domain = free_domain() if domain is None else domain
        variables = {**os.environ, 'ROS_DOMAIN_ID': str(self.domain),
                     'ROS_PYTHON_CHECK_FIELDS': '1', 'PYTHONUNBUFFERED': '1',
                     **(environment or {})}
        command = [str(executable), *(['--ros-args', *ros_args] if ros_args else [])]
        self._process = subprocess.Popen(command, env=variables, stdout=output,
                                         stderr=subprocess.STDOUT, text=True)
        self.pid, self.name = self._process.pid, executable.name
        self.lines: list[str] = []
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()
        _processes.add(self)

    def _read(self) -> None:
        for line in self._process.stdout or ():
            self.lines.append(line.rstrip())

    @property
    def log(self) -> str:
        """All it has printed."""
        return '\n'.join(self.lines)

    @property
    def alive(self) -> bool:
        """Tell whether it runs."""
        return self._process.poll() is None

    def wait_for(self, pattern: str) -> 'Process':
        """Wait for a line of its log."""
        until(lambda: re.search(pattern, self.log) or not self.alive, f"'{pattern}' in a log")
        assert re.search(pattern, self.log), f"ended without '{pattern}':\n{self.log}"
        return self

    def signal(self, number: int) -> None:
        """Send a signal."""
        self._process.send_signal(number)

    def wait(self) -> int:
        """Wait for its end and return the exit code."""
        code = self._process.wait(PATIENCE)
        # A watchdog that outlives it holds its output open.
        self._reader.join(HELD)
        return code

    def end(self) -> None:
        """End it, whatever state it is in."""
        if self.alive:
            self.signal(signal.SIGCONT)
            self.signal(signal.SIGINT)
            try:
                self._process.wait(10.0)
            except subprocess.TimeoutExpired:
                self._process.kill()
                self._process.wait()


def until(condition, what: str):
    """Wait until the condition holds, and return what it returned."""
    end = time.monotonic() + PATIENCE
    while time.monotonic() < end:
        result = condition()
        if result:
            return result
        time.sleep(0.002)
    raise AssertionError(f'waited {PATIENCE} s in vain for {what}{_logs()}')


def _logs() -> str:
    """Return the last lines of all processes that run."""
    return ''.join(f'\n-- {one.name} in domain {one.domain}:\n' +
                   '\n'.join(one.lines[-SHOWN:]) for one in _processes if one.alive)


def off_grid(times, period: float) -> float:
    """Largest distance of the gaps between times from whole periods, in s.

    A stalled generator leaves periods out, which a loaded machine may make it do.
    """
    gaps = np.diff(times)
    return float(np.abs(gaps - period * np.maximum(np.round(gaps / period), 1.0)).max())


class Watcher:
    """A node that records joint states and calls the generator's parameter services."""

    def __init__(self, domain: int, generator: str = '/cpg_generator',
                 topic: str = 'joint_states') -> None:
        self.context = rclpy.Context()
        rclpy.init(context=self.context, domain_id=domain)
        self.node = rclpy.create_node('watcher', context=self.context, enable_rosout=False)
        self.generator = generator
        self.names: list[str] = []
        self.samples: list[tuple[float, list, list]] = []
        self.diagnostics: list = []
        self.gaits: list[str] = []
        prefix = generator.rsplit('/', 1)[0]
        self.node.create_subscription(JointState, f'{prefix}/{topic}', self._joints,
                                      QoSProfile(depth=5000))
        self.node.create_subscription(DiagnosticArray, '/diagnostics', self._health, 10)
        self.node.create_subscription(
            String, f'{generator}/gait', lambda m: self.gaits.append(m.data),
            QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL))
        self.phases: list[list[float]] = []
        self.node.create_subscription(Float64MultiArray, f'{generator}/phase',
                                      lambda m: self.phases.append(m.data.tolist()), 100)
        self._clients: dict = {}
        self._executor = SingleThreadedExecutor(context=self.context)
        self._executor.add_node(self.node)
        self._ending = False
        self._thread = threading.Thread(target=self._spin, daemon=True)
        self._thread.start()

    def _spin(self) -> None:
        while not self._ending:
            self._executor.spin_once(timeout_sec=0.1)

    def _joints(self, message: JointState) -> None:
        self.names = list(message.name)
        stamp = message.header.stamp
        self.samples.append((stamp.sec + 1e-9 * stamp.nanosec, message.position.tolist(),
                             message.velocity.tolist()))

    def _health(self, message: DiagnosticArray) -> None:
        self.diagnostics += [s for s in message.status if s.name.startswith(self.generator + ':')]

    def client(self, kind: type, name: str):
        """Return the client of a service, which has room for many answers, once it is there."""
        if name not in self._clients:
            self._clients[name] = self.node.create_client(kind, name,
                                                          qos_profile=qos_profile_parameters)
        assert self._clients[name].wait_for_service(PATIENCE), f'no service {name}'
        return self._clients[name]

    def call(self, kind: type, name: str, request):
        """Call a service and return its response."""
        client = self.client(kind, name)
        # A server drops its first answer if it does not know the client's reader within 0.1 s.
        futures, again = [], 0.0

        def answered():
            nonlocal again
            if time.monotonic() >= again and (kind in TWICE or not futures):
                futures.append(client.call_async(request))
                again = time.monotonic() + LOST
            return next((one for one in futures if one.done()), None)

        return until(answered, f'an answer of {name}').result()

    def set(self, **values):  # noqa: A003
        """Set parameters one by one (``delayed_tau`` for delayed.tau); return the results."""
        request = SetParameters.Request(parameters=_messages(values))
        return self.call(SetParameters, f'{self.generator}/set_parameters', request).results

    def set_together(self, **values):
        """Set parameters atomically; return the result."""
        request = SetParametersAtomically.Request(parameters=_messages(values))
        name = f'{self.generator}/set_parameters_atomically'
        return self.call(SetParametersAtomically, name, request).result

    def get(self, *names: str) -> list:
        """Read parameters."""
        response = self.call(GetParameters, f'{self.generator}/get_parameters',
                             GetParameters.Request(names=list(names)))
        return [Parameter.from_parameter_msg(ParameterMessage(name=n, value=v)).value
                for n, v in zip(names, response.values, strict=True)]

    def record(self, seconds: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Record for some time by the stamps; return times, positions, velocities."""
        first = len(self.samples)
        until(lambda: len(self.samples) > first and
              self.samples[-1][0] - self.samples[first][0] >= seconds, 'joint states')
        times, positions, velocities = zip(*self.samples[first:], strict=True)
        return np.array(times), np.array(positions), np.array(velocities)

    def next_phases(self, count: int) -> np.ndarray:
        """Wait for the next phases of the legs, shape (count, legs)."""
        first = len(self.phases)
        until(lambda: len(self.phases) >= first + count, 'phases')
        return np.array(self.phases[first:first + count])

    def destroy(self, one: Publisher | Subscription) -> None:
        """End a publisher or subscription of the node, where the thread that spins does not wait.

        rclpy's executor ends with an error if what it is about to wait for is destroyed.
        """
        end = (self.node.destroy_subscription if isinstance(one, Subscription)
               else self.node.destroy_publisher)
        until(self._executor.create_task(end, one).done, f'the end of {one.topic_name}')

    def end(self) -> None:
        """Leave the graph."""
        self._ending = True
        self._thread.join()
        self._executor.shutdown()
        self.node.destroy_node()
        rclpy.shutdown(context=self.context)


def _messages(values: dict) -> list[ParameterMessage]:
    return [Parameter(re.sub('^(delayed|quadruped|biped|two_legs)_', r'\1.', name), value=value)
            .to_parameter_msg() for name, value in values.items()]


class SimulatedTime:
    """A /clock that the test advances."""

    def __init__(self, watcher: Watcher, listeners: int = 1) -> None:
        self._watcher = watcher
        self._publisher = watcher.node.create_publisher(Clock, '/clock', 100)
        until(lambda: self._publisher.get_subscription_count() >= listeners,
              f'{listeners} listeners to /clock')

    def _tell(self, now: float) -> None:
        message = Clock()
        message.clock.sec, message.clock.nanosec = int(now), int(now % 1 * 1e9)
        self._publisher.publish(message)

    def run(self, start: float, end: float, step: float = 0.01) -> None:
        """Advance, twice as fast as the wall clock or slower."""
        for now in np.arange(start, end, step):
            self._tell(now)
            time.sleep(0.5 * step)

    def lead(self, start: float, end: float, step: float, *others: Watcher) -> None:
        """Go on after run, each step once joint states of those before have come, others' too.

        Who has published nothing yet is waited for while time passes: without it, nothing comes.
        """
        moving = [watcher.samples for watcher in (self._watcher, *others)]
        for now in np.arange(start, end, step):
            self._tell(now)
            if not all(moving):
                time.sleep(5.0 * step)
            ends, waits = time.monotonic() + PATIENCE, 0
            while any(samples and samples[-1][0] < now - 2.5 * step for samples in moving):
                assert time.monotonic() < ends, f'waited {PATIENCE} s for joint states{_logs()}'
                time.sleep(0.0002)
                waits += 1
                if waits % 1000 == 0:
                    # It is sent best effort.
                    self._tell(now)
        assert all(moving), f'no joint states{_logs()}'

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

"""Compilation before a node moves anything, announced in advance."""

from collections.abc import Iterator
from contextlib import contextmanager
import subprocess
import sys
import threading
import time
from typing import Any

from cpg_ros.dynamics.integration.c_kernel import is_missing
from cpg_ros.dynamics.integration.compilation import COMPILED, on_compile
from cpg_ros.motion.core import core, precompile
from cpg_ros.networks.registry import find_network
from cpg_ros.ros.node.health import START_STATUS
from cpg_ros.ros.node.node_base import StartError
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.node import Node

# Progress of a node that starts, on /diagnostics, where pages find it.

#: PROGRESS_PERIOD: period in which the progress is published, s.
PROGRESS_PERIOD = 1.0


class StartProgress:
    """Thread that publishes the duration of a step of the start until it ends."""

    def __init__(self, node: Node, what: str, seconds: float) -> None:
        """Publish that ``node`` waits for ``what``, for about ``seconds``."""
        self._node, self._what, self._seconds, self._began = node, what, seconds, time.monotonic()
        self._publisher = node.create_publisher(DiagnosticArray, '/diagnostics', 10)
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._publish, name='progress', daemon=True)
        self._thread.start()

    def _publish(self) -> None:
        name = self._node.get_fully_qualified_name()
        while not self._ended.wait(PROGRESS_PERIOD):
            message = DiagnosticArray(status=[DiagnosticStatus(
                level=DiagnosticStatus.OK, name=f'{name}: {START_STATUS}',
                message=f'{self._what}, {self.passed:.0f} of about {self._seconds:.0f} s')])
            message.header.stamp = self._node.get_clock().now().to_msg()
            self._publisher.publish(message)

    @property
    def passed(self) -> float:
        """Elapsed time, s."""
        return time.monotonic() - self._began

    def end(self) -> None:
        """Stop publishing."""
        self._ended.set()
        self._thread.join()
        self._node.destroy_publisher(self._publisher)


#: Durations of compilation on one core of 2023, s. FEEDBACK_TIME: the kernels of the feedback;
#: BALANCE_TIME: those of a biped's balance; NETWORK_TIME: a network in C.
FEEDBACK_TIME, BALANCE_TIME, NETWORK_TIME = 35.0, 40.0, 2.0
#: How often it is seen whether a compiling process has ended, s.
POLL_PERIOD = 0.05


def compile_kernels(network: str, node: Node) -> None:
    """Compile or load a network's code in C; the name is as of find_network.

    Another process derives the equations: sympy takes 35 MB, which would stay.

    Raises:
        CpgError: there is no C compiler.

    """
    if not COMPILED:
        node.get_logger().info('numba is not installed: there is no feedback')
    # Without a compiler it ends here.
    core()
    if is_missing(find_network(network)):
        compile_apart(node, network, f"network '{network}'", NETWORK_TIME)
    precompile(network)


@contextmanager
def announced(node: Node, what: str, seconds: float) -> Iterator[None]:
    """Announce compilations, which take about ``seconds``, in the log and on /diagnostics."""
    begun: list[StartProgress] = []

    def compiling() -> None:
        if not begun:
            node.get_logger().info(f'compiling {what}: about {seconds:g} s, only at its first '
                                   'start on this installation')
            begun.append(StartProgress(node, f'compiling {what}', seconds))
    try:
        with on_compile(compiling):
            yield
        for progress in begun:
            node.get_logger().info(f'compiled in {progress.passed:.1f} s')
    finally:
        for progress in begun:
            progress.end()


def compile_apart(node: Any, part: str, what: str, seconds: float, moving: bool = False) -> None:
    """Compile a part of ``precompile`` in another process, and load it in this one.

    A compiler holds the interpreter's lock for up to seconds, for which Python's ticks would wait.

    Args:
        node: that waits for it.
        part: as ``precompile`` takes it.
        what: description for the log.
        seconds: approximate duration of the first time.
        moving: whether the node moves a robot meanwhile, and has priority.

    Raises:
        StartError: the node ends.

    """
    node.get_logger().info(f'making the {what} ready in a process of its own: about {seconds:g} s '
                           'at its first start on this installation')
    progress = StartProgress(node, f'compiling the {what}', seconds)
    # Ctrl-C in the terminal is for the node.
    child = subprocess.Popen(
        [*(['nice'] if moving else []), sys.executable, '-P', '-m', 'cpg_ros.ros.cli.precompile',
         part],
        stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE,
        start_new_session=True)
    try:
        while child.poll() is None:
            if node.stop.wait(POLL_PERIOD):
                raise StartError(f'the node ends while it makes the {what} ready')
        if child.returncode:
            assert child.stderr is not None
            lines = child.stderr.read().decode(errors='replace').split('\n')
            node.get_logger().warning(f'the process that compiles the {what} failed, and the node '
                                      f'does it: {next(filter(None, lines[::-1]), "no reason")}')
        else:
            node.get_logger().info(f'ready after {progress.passed:.1f} s')
    finally:
        child.kill()
        child.wait()
        progress.end()

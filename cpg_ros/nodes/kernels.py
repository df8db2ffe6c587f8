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

"""Compilation before a node moves anything, announced before it begins."""

from collections.abc import Iterator
from contextlib import contextmanager
import threading
import time

from cpg_ros.integration.compilation import noticing
from cpg_ros.motion.network_kernels import precompile
from cpg_ros.nodes.health_publisher import START
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.node import Node

#: How often it says so, s.
EVERY = 1.0
#: How long a network's kernels and those of the feedback take, on one core of 2023, s.
NETWORK, FEEDBACK = 20.0, 25.0


def compile_kernels(network: str, node: Node) -> None:
    """Compile or load the kernels of a network, named as for find_network."""
    with announced(node, f"the network '{network}'", NETWORK):
        precompile(network)


@contextmanager
def announced(node: Node, what: str, seconds: float) -> Iterator[None]:
    """Announce compilations, if there are any: in the log, and as they go on on /diagnostics.

    Args:
        node: that waits for them.
        what: is compiled.
        seconds: that it takes, s.

    """
    begun: list[_Progress] = []

    def compiling() -> None:
        if not begun:
            node.get_logger().info(f'compiling {what}: about {seconds:g} s, only at its first '
                                   'start on this installation')
            begun.append(_Progress(node, what, seconds))
    try:
        with noticing(compiling):
            yield
        for progress in begun:
            node.get_logger().info(f'compiled in {progress.passed:.1f} s')
    finally:
        for progress in begun:
            progress.end()


class _Progress:
    """A thread that publishes how long a compilation has taken."""

    def __init__(self, node: Node, what: str, seconds: float) -> None:
        self._node, self._what, self._seconds, self._began = node, what, seconds, time.monotonic()
        self._publisher = node.create_publisher(DiagnosticArray, '/diagnostics', 10)
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._publish, name='progress', daemon=True)
        self._thread.start()

    def _publish(self) -> None:
        name = self._node.get_fully_qualified_name()
        while not self._ended.wait(EVERY):
            message = DiagnosticArray(status=[DiagnosticStatus(
                level=DiagnosticStatus.OK, name=f'{name}: {START}', message=f'compiling '
                f'{self._what}, {self.passed:.0f} of about {self._seconds:g} s')])
            message.header.stamp = self._node.get_clock().now().to_msg()
            self._publisher.publish(message)

    @property
    def passed(self) -> float:
        """How long it has taken, s."""
        return time.monotonic() - self._began

    def end(self) -> None:
        """Publish no more."""
        self._ended.set()
        self._thread.join()
        self._node.destroy_publisher(self._publisher)

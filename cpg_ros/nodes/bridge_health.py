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

"""The health of a bridge, once a second on /diagnostics."""

from collections.abc import Mapping

from cpg_ros.nodes.deadline_thread import Ticker
from cpg_ros.nodes.log_queue import QUEUE
from cpg_ros.safety.supervisor import BridgeState, Supervisor
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.node import Node


class BridgeHealth:
    """Reports ERROR while the robot sits down or is damped, WARN while no state arrives."""

    def __init__(self, node: Node, hardware: str, supervisor: Supervisor, ticker: Ticker) -> None:
        """Prepare the publisher.

        Args:
            node: the bridge.
            hardware: name of the robot.
            supervisor: whose state is reported.
            ticker: of the bridge.

        """
        self._node, self._hardware = node, hardware
        self._supervisor, self._ticker = supervisor, ticker
        self._before = 0, 0, 0
        self._publisher = node.create_publisher(DiagnosticArray, '/diagnostics', 10)

    def publish(self, received: int, sent: int, refusal: str, dry: bool,
                measured: Mapping[str, object]) -> bool:
        """Publish a status; return whether a state has arrived since the last one.

        Args:
            received: number of states so far.
            sent: number of commands so far.
            refusal: why the last start was refused, or ''.
            dry: whether nothing is sent.
            measured: further values, by name.

        """
        supervisor, ticker, before = self._supervisor, self._ticker, self._before
        self._before = counts = ticker.ticks, received, sent
        ticks, received, sent = (new - old for new, old in zip(counts, before, strict=True))
        state = supervisor.state
        if state in (BridgeState.DAMPING, BridgeState.SITTING):
            level, text = DiagnosticStatus.ERROR, f'{state.value}: {supervisor.reason}'
        elif refusal and state is BridgeState.IDLE:
            level, text = DiagnosticStatus.ERROR, f'not started: {refusal}'
        elif not received:
            level, text = DiagnosticStatus.WARN, 'the robot is not heard'
        else:
            level, text = DiagnosticStatus.OK, state.value + ' (dry run)' * dry
        values = {
            'phase': state.value, 'ticks in the last second': ticks,
            'states in the last second': received, 'commands in the last second': sent,
            'late ticks': ticker.late, 'dropped ticks': ticker.dropped,
            'worst delay of a tick [ms]': f'{1e3 * ticker.worst:.3f}',
            'log lines dropped': QUEUE.dropped, **measured}
        message = DiagnosticArray(status=[DiagnosticStatus(
            level=level, name=f'{self._node.get_fully_qualified_name()}: robot', message=text,
            hardware_id=self._hardware,
            values=[KeyValue(key=key, value=str(value)) for key, value in values.items()])])
        message.header.stamp = self._node.get_clock().now().to_msg()
        self._publisher.publish(message)
        return received > 0

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

"""The motion modes of a Unitree robot, which must be off while a bridge commands it."""

from collections.abc import Callable
import json
import time
from typing import Any

from cpg_ros.nodes.bridge_start import StartRefused, Wait
from cpg_ros.nodes.polled_group import PolledSubscription
from cpg_ros.nodes.unitree.interfaces import message
from rclpy.node import Node
from rclpy.qos import QoSProfile

#: Numbers of unitree_api: of the service motion_switcher, and of sport.
CHECK_MODE, RELEASE_MODE, STAND_DOWN = 1001, 1003, 1005
#: How long an answer, and the release of all modes, may take, s.
ANSWER, RELEASED = 3.0, 30.0
#: What the robot needs to lie down, s, and then to give up a mode.
LYING, SETTLING = 4.0, 1.0


class RobotService:
    """One of the robot's own services behind ``unitree_api``."""

    def __init__(self, node: Node, name: str, wait: Wait) -> None:
        """Connect; ``wait`` sleeps for some seconds, or raises StartRefused."""
        self._name, self._wait, self._node = name, wait, node
        self._request = message('unitree_api/Request')
        self._publisher = node.create_publisher(self._request, f'/api/{name}/request',
                                                QoSProfile(depth=10))
        self._answers = PolledSubscription(node, message('unitree_api/Response'),
                                           f'/api/{name}/response', QoSProfile(depth=10))

    def call(self, number: int) -> dict[str, Any]:
        """Send a request; return the data of the answer.

        Raises:
            StartRefused: there is no answer, or the robot refuses.

        """
        request = self._request()
        request.header.identity.id = time.monotonic_ns()
        request.header.identity.api_id = number
        request.parameter = '{}'
        end = time.monotonic() + ANSWER
        while not (self._publisher.get_subscription_count()
                   and self._node.count_publishers(self._answers.topic)):
            if time.monotonic() > end:
                raise StartRefused(f"the robot has no service '{self._name}'; a simulator has "
                                   'none: motion_switcher:=false')
            self._wait(0.05)
        self._publisher.publish(request)
        while time.monotonic() < end + ANSWER:
            for answer, _ in self._answers.take():
                if answer.header.identity.id == request.header.identity.id:
                    if code := answer.header.status.code:
                        raise StartRefused(f"the robot's service '{self._name}' refuses request "
                                           f'{number} with code {code}')
                    return json.loads(answer.data or '{}')
            self._wait(0.02)
        raise StartRefused(f"the robot's service '{self._name}' does not answer request {number}")


def release(node: Node, wait: Wait, log: Callable[[str], None]) -> None:
    """Make the robot lie down and release its motion modes.

    Args:
        node: the bridge.
        wait: sleeps for some seconds, or raises StartRefused.
        log: takes a line for each step.

    Raises:
        StartRefused: the robot has no such service, or does not release a mode.

    """
    switcher = RobotService(node, 'motion_switcher', wait)
    sport, end = None, time.monotonic() + RELEASED
    while name := switcher.call(CHECK_MODE).get('name', ''):
        if time.monotonic() > end:
            raise StartRefused(f"the robot does not release its motion mode '{name}'")
        if sport is None:
            sport = RobotService(node, 'sport', wait)
            log(f"its motion mode '{name}' is active: it is asked to lie down")
            sport.call(STAND_DOWN)
            wait(LYING)
        log(f"its motion mode '{name}' is to be released")
        switcher.call(RELEASE_MODE)
        wait(SETTLING)
    log('no motion mode of its own is active')

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

"""The way from a robot that walks by itself to one that can be commanded, step by step."""

from collections.abc import Callable
import json
import threading
import time
from typing import Any

from cpg_ros.errors import CpgError
from cpg_ros.nodes.polled_group import PolledSubscription
from cpg_ros.nodes.unitree.interfaces import message
from cpg_ros.nodes.unitree.robot_graph import BRIDGE, Others
from rclpy.node import Node
from rclpy.qos import QoSProfile

#: Numbers of unitree_api: of the service motion_switcher, and of sport.
CHECK_MODE, RELEASE_MODE, STAND_DOWN = 1001, 1003, 1005
#: How long each step may take, s: until a state is heard, an answer, a released mode.
STATE, ANSWER, RELEASED = 10.0, 3.0, 30.0
#: What the robot needs to lie down, s, and then to give up a mode.
LYING, SETTLING = 4.0, 1.0
#: Two programs on a network have found each other after this time, s.
MATCHED = 1.0
#: A dead bridge is forgotten by the network after this time, s.
FORGOTTEN = 25.0


class Refused(CpgError):
    """The robot is not started; the message is one line for the user."""


class Service:
    """One of the robot's own services behind ``unitree_api``."""

    def __init__(self, node: Node, name: str, wait: Callable[[float], None]) -> None:
        """Connect; ``wait`` sleeps for some seconds, or raises Refused."""
        self._name, self._wait, self._node = name, wait, node
        self._request = message('unitree_api/Request')
        self._publisher = node.create_publisher(self._request, f'/api/{name}/request',
                                                QoSProfile(depth=10))
        self._answers = PolledSubscription(node, message('unitree_api/Response'),
                                           f'/api/{name}/response', QoSProfile(depth=10))

    def call(self, number: int) -> dict[str, Any]:
        """Ask for something; return what the answer says.

        Raises:
            Refused: there is no answer, or the robot refuses.

        """
        request = self._request()
        request.header.identity.id = time.monotonic_ns()
        request.header.identity.api_id = number
        request.parameter = '{}'
        end = time.monotonic() + ANSWER
        while not (self._publisher.get_subscription_count()
                   and self._node.count_publishers(self._answers.topic)):
            if time.monotonic() > end:
                raise Refused(f"the robot has no service '{self._name}'; a simulator has none: "
                              'motion_switcher:=false')
            self._wait(0.05)
        self._publisher.publish(request)
        while time.monotonic() < end + ANSWER:
            for answer, _ in self._answers.take():
                if answer.header.identity.id == request.header.identity.id:
                    if code := answer.header.status.code:
                        raise Refused(f"the robot's service '{self._name}' refuses request "
                                      f'{number} with code {code}')
                    return json.loads(answer.data or '{}')
            self._wait(0.02)
        raise Refused(f"the robot's service '{self._name}' does not answer request {number}")


class Start(threading.Thread):
    """Leads through the steps in a thread of its own; each is said, and refused with a reason."""

    def __init__(self, node: Node, others: Others, harmful: Callable[[], str],
                 heard: Callable[[], bool], watched: Callable[[], str], rise: Callable[[], str],
                 switch: bool, ended: Callable[[str], None]) -> None:
        """Be ready to start.

        Args:
            node: for the log and the services.
            others: who must not command the robot, too.
            harmful: what on the network would crash the robot's software, or ''.
            heard: whether a state has come.
            watched: starts the watchdog; returns why not, or ''.
            rise: lets the robot rise; returns why not, or ''.
            switch: whether the robot's motion modes are to be released.
            ended: called with why the robot was not started, or ''.

        """
        super().__init__(name='start', daemon=True)
        self._node, self._others, self._harmful, self._heard = node, others, harmful, heard
        self._watched, self._rise, self._switch, self._ended = watched, rise, switch, ended
        self._given_up = threading.Event()
        self._reason = ''

    @property
    def given_up(self) -> bool:
        """Whether it is not wanted any more."""
        return self._given_up.is_set()

    def give_up(self, reason: str) -> None:
        """Refuse at the next chance."""
        self._reason = reason
        self._given_up.set()

    def run(self) -> None:
        """Go through the steps."""
        try:
            self._hear()
            self._look_for_others()
            if reason := self._watched():
                raise Refused(reason)
            # So that the robot knows its publisher, too, before it is needed.
            self._wait(MATCHED)
            if self._switch:
                self._release()
            self._look_for_others()
            self._wait(0.0)
            reason = self._rise()
        except Refused as error:
            reason = str(error)
        except Exception as error:
            # Whatever else goes wrong, the robot has not been touched.
            reason = f'{type(error).__name__}: {error}'
        self._ended(reason)

    def _say(self, text: str) -> None:
        self._node.get_logger().info(f'start: {text}')

    def _wait(self, seconds: float) -> None:
        if self._given_up.wait(seconds):
            raise Refused(self._reason)

    def _hear(self) -> None:
        end = time.monotonic() + STATE
        while not self._heard():
            if time.monotonic() > end:
                raise Refused(
                    f'no LowState for {STATE:g} s: is the cable in, the address of this computer '
                    'in 192.168.123.*, ROS_AUTOMATIC_DISCOVERY_RANGE=SUBNET, and ROS_DOMAIN_ID 0 '
                    "for a robot, 1 for Unitree's simulator?")
            self._wait(0.02)
        self._say('the robot is heard')

    def _look_for_others(self) -> None:
        if found := self._harmful():
            raise Refused(f"{found} is on this network: it crashes the 0.10 in Unitree's "
                          'firmware; stop it')
        end, told = time.monotonic() + FORGOTTEN, False
        while found := self._others.found():
            if not found.endswith(f'/{BRIDGE}') or ',' in found:
                raise Refused(f'the robot is commanded by {found}, too')
            if time.monotonic() > end:
                raise Refused(f'the robot is commanded by another bridge ({found}), too')
            if not told:
                self._say(f'waiting for {found} to be gone from the network')
            told = True
            self._wait(0.1)
        self._say('nobody else commands it')

    def _release(self) -> None:
        switcher = Service(self._node, 'motion_switcher', self._wait)
        sport, end = None, time.monotonic() + RELEASED
        while name := switcher.call(CHECK_MODE).get('name', ''):
            if time.monotonic() > end:
                raise Refused(f"the robot does not release its motion mode '{name}'")
            if sport is None:
                sport = Service(self._node, 'sport', self._wait)
                self._say(f"its motion mode '{name}' is active: it is asked to lie down")
                sport.call(STAND_DOWN)
                self._wait(LYING)
            self._say(f"its motion mode '{name}' is to be released")
            switcher.call(RELEASE_MODE)
            self._wait(SETTLING)
        self._say('no motion mode of its own is active')

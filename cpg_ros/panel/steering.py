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

"""Steering with a dead man: the robot walks only as long as somebody holds on."""

from collections.abc import Callable
import math
from typing import Any

from geometry_msgs.msg import Twist, Wrench

#: Who steers must say so again within this time, s.
HOLD = 0.3
#: The stop is sent this many times: messages are cheap, a robot that walks on is not.
STOPS = 5


class Steering:
    """Turns what one page at a time asks for into ``cmd_vel``.

    Attributes:
        asked: forward speed in m/s and turn in rad/s, (0, 0) where nobody steers.

    """

    def __init__(self, publish: Callable[[Any], None], fastest: tuple[float, float]) -> None:
        """Publish through this; a whole deflection is this speed in m/s and turn in rad/s."""
        self._publish, self._fastest = publish, fastest
        self._holder: object = None
        self._until, self._stops = -math.inf, 0
        self.asked = (0.0, 0.0)

    def hold(self, who: object, now: float, speed: float, turn: float) -> None:
        """Steer from now on, now in s, by shares of the fastest; who came last steers."""
        self._holder, self._until, self._stops = who, now + HOLD, STOPS
        self.asked = speed * self._fastest[0], turn * self._fastest[1]

    def release(self, who: object) -> None:
        """Stop, if it is this one that steers."""
        if who is self._holder:
            self.stop()

    def stop(self) -> None:
        """Stop, whoever steers."""
        self._until, self._holder = -math.inf, None

    def beat(self, now: float) -> None:
        """Send what is to be sent at a time, s; nothing if nobody has steered."""
        if now > self._until:
            self.asked, self._holder = (0.0, 0.0), None
            if not self._stops:
                return
            self._stops -= 1
        message = Twist()
        message.linear.x, message.angular.z = self.asked
        self._publish(message)


def push(force: float, direction: float) -> Wrench:
    """Return a push of a force in N in a direction in degrees, from ahead to the left."""
    message = Wrench()
    message.force.x = force * math.cos(math.radians(direction))
    message.force.y = force * math.sin(math.radians(direction))
    return message

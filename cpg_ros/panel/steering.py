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

#: A command may be this old when it is published, s; what is older is zero.
HOLD = 0.3
#: The stop is sent this many times: messages are cheap, a robot that walks on is not.
STOPS = 5


class SteeringPublisher:
    """Turns the newest command of a page into ``cmd_vel``, as long as it is fresh.

    Attributes:
        target: forward speed in m/s and turn in rad/s, (0, 0) where nobody steers.

    """

    def __init__(self, publish: Callable[[Any], None], fastest: tuple[float, float]) -> None:
        """Publish through this; a whole deflection is this speed in m/s and turn in rad/s."""
        self._publish, self._fastest = publish, fastest
        self._until, self._stops = -math.inf, 0
        self.target = (0.0, 0.0)

    @property
    def idle(self) -> bool:
        """Tell whether nobody steers and every stop has been sent."""
        return self._until == -math.inf and not self._stops

    def hold(self, stamp: float, speed: float, turn: float) -> None:
        """Steer by shares of the fastest, with a command that was given after a time, s."""
        self._until, self._stops = stamp + HOLD, STOPS
        self.target = speed * self._fastest[0], turn * self._fastest[1]

    def stop(self) -> None:
        """Stop, whoever steers."""
        self._until = -math.inf

    def beat(self, now: float) -> None:
        """Send what is to be sent at a time, s; nothing if nobody has steered."""
        if now > self._until:
            self.stop()
            self.target = 0.0, 0.0
            if not self._stops:
                return
            self._stops -= 1
        message = Twist()
        message.linear.x, message.angular.z = self.target
        self._publish(message)


def push(force: float, direction: float) -> Wrench:
    """Return a push of a force in N in a direction in degrees, from ahead to the left."""
    message = Wrench()
    message.force.x = force * math.cos(math.radians(direction))
    message.force.y = force * math.sin(math.radians(direction))
    return message

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

"""The topic ``kp_scale``: the factor of the servos' proportional gain that the feedback wants.

It is 1, or more while the body recovers from a push (law ``stiffen``). Whoever drives servos that
take gains multiplies theirs by it, and falls back to 1 when no message has come for STALE.
"""

from cpg_ros.feedback.stiffen import LAW
from cpg_ros.nodes.polled_group import PolledSubscription
from rclpy.node import Node
from std_msgs.msg import Float64

TOPIC = 'kp_scale'
#: While it is not 1, it is repeated this often; without a message for STALE it is 1 again, s.
REPEAT, STALE = 0.02, 0.1
LARGEST = LAW.gains['stiffen_kp'].high


class KpScalePublisher:
    """Publishes the factor when it changes, and repeats it while it is not 1."""

    def __init__(self, node: Node) -> None:
        self._publisher = node.create_publisher(Float64, TOPIC, 1)
        self._message, self._elapsed = Float64(data=1.0), 0.0

    def publish(self, dt: float, scale: float) -> None:
        """Publish the factor if it is time; dt since the last call, s."""
        self._elapsed += dt
        if scale != self._message.data or (scale != 1.0 and self._elapsed >= REPEAT):
            self._message.data, self._elapsed = scale, 0.0
            self._publisher.publish(self._message)


class KpScaleSubscription:
    """Takes the factor from the topic."""

    def __init__(self, node: Node) -> None:
        self._subscription = PolledSubscription(node, Float64, TOPIC)
        self._scale, self._received = 1.0, 0.0

    def take(self, now: float) -> float:
        """Return the factor, from 1 to LARGEST; 1 if the last message is out of range or old.

        Args:
            now: s, from any origin.

        """
        if (message := self._subscription.newest()) is not None:
            valid = 1.0 <= message.data <= LARGEST
            self._scale, self._received = message.data if valid else 1.0, now
        if self._scale != 1.0 and not 0.0 <= now - self._received < STALE:
            self._scale = 1.0
        return self._scale

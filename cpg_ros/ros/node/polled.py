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

"""Subscriptions, services and clients without an executor: the caller takes messages.

No code of the process runs when messages arrive, however many; the middleware drops those that are
not taken in time.
"""

from collections.abc import Iterator
from typing import Any

from rclpy.callback_groups import CallbackGroup
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.qos_overriding_options import QoSOverridingOptions
from std_msgs.msg import String

# Qualities of service that more than one node uses.

#: OVERRIDABLE: option of topics whose QoS can be overridden by parameters of the node.
OVERRIDABLE = QoSOverridingOptions.with_default_policies()


def latched(depth: int = 1) -> QoSProfile:
    """Return the QoS of a topic whose last messages reach later subscribers."""
    return QoSProfile(depth=depth, durability=DurabilityPolicy.TRANSIENT_LOCAL)


def latched_text(node: Node, topic: str, text: str) -> Publisher:
    """Publish a text that later subscribers receive, too; return the publisher."""
    publisher = node.create_publisher(String, topic, latched())
    publisher.publish(String(data=text))
    return publisher


def command_qos() -> QoSProfile:
    """Return the QoS of commands: only the newest one counts."""
    return QoSProfile(depth=1)


def best_effort(depth: int = 1) -> QoSProfile:
    """Return the QoS of a subscription that matches every publisher and delays none."""
    return QoSProfile(depth=depth, reliability=ReliabilityPolicy.BEST_EFFORT)


class PolledGroup(CallbackGroup):
    """Callback group that keeps its entities from the executor."""

    def can_execute(self, entity: object) -> bool:
        """Return False."""
        return False

    def beginning_execution(self, entity: object) -> bool:
        """Return False."""
        return False

    def ending_execution(self, entity: object) -> None:
        """Do nothing."""


class PolledSubscription:
    """A subscription without a callback.

    Attributes:
        topic: resolved name.
        depth: largest number of waiting messages.

    """

    def __init__(self, node: Node, kind: type, topic: str, quality: QoSProfile | None = None,
                 raw: bool = False, overridable: bool = True) -> None:
        """Subscribe.

        Args:
            node: that subscribes.
            kind: message type.
            topic: name.
            quality: QoS, by default best effort and the newest message.
            raw: take messages as bytes, as decoding is far more expensive.
            overridable: allow QoS overrides by parameters.

        """
        self._node = node
        self._subscription: Any = node.create_subscription(
            kind, topic, lambda _: None, quality or best_effort(), callback_group=PolledGroup(),
            raw=raw, qos_overriding_options=OVERRIDABLE if overridable else None)
        self.topic: str = self._subscription.topic_name
        self._kind, self._raw = kind, raw
        self.depth: int = self._subscription.qos_profile.depth

    def receive(self) -> Iterator[tuple[Any, int]]:
        """Take the messages that have arrived, each with its time of arrival, ns (system time)."""
        handle = self._subscription.handle
        with handle:
            while (sample := handle.take_message(self._kind, self._raw)) is not None:
                yield sample[0], sample[1]['received_timestamp']

    def newest(self) -> Any:
        """Return the newest message since the last call, or None."""
        newest, handle = None, self._subscription.handle
        with handle:
            # No more than these can wait.
            for _ in range(self.depth):
                if (sample := handle.take_message(self._kind, self._raw)) is None:
                    break
                newest = sample[0]
        return newest

    @property
    def handle(self) -> Any:
        """Context manager with the ``pointer``, which keeps the subscription alive."""
        return self._subscription.handle

    def close(self) -> None:
        """End the subscription."""
        self._node.destroy_subscription(self._subscription)

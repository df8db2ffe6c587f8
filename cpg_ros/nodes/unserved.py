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

"""Subscriptions and services that an executor leaves alone: what comes waits to be taken."""

from collections.abc import Iterator
from typing import Any

from rclpy.callback_groups import CallbackGroup
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.qos_overriding_options import QoSOverridingOptions
from rclpy.subscription import Subscription


class Unserved(CallbackGroup):
    """Keeps subscriptions and services from the executor."""

    def can_execute(self, entity: object) -> bool:
        """Never."""
        return False

    def beginning_execution(self, entity: object) -> bool:
        """Never."""
        return False

    def ending_execution(self, entity: object) -> None:
        """None has begun."""


def subscribe(node: Node, kind: type, topic: str, quality: QoSProfile, raw: bool = False
              ) -> Subscription:
    """Subscribe to a topic whose messages are only taken, raw: as bytes."""
    return node.create_subscription(
        kind, topic, lambda _: None, quality, callback_group=Unserved(), raw=raw,
        qos_overriding_options=QoSOverridingOptions.with_default_policies())


def taken(subscription: Subscription) -> Iterator[tuple[Any, int]]:
    """Take what has arrived: each message, and when it did, ns of system time."""
    handle, kind, raw = subscription.handle, subscription.msg_type, subscription.raw
    with handle:
        while (found := handle.take_message(kind, raw)) is not None:
            yield found[0], found[1]['received_timestamp']

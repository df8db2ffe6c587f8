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

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


def subscribe(node: Node, kind: type, topic: str, quality: QoSProfile) -> Subscription:
    """Subscribe to a topic whose messages are only taken."""
    return node.create_subscription(
        kind, topic, lambda _: None, quality, callback_group=Unserved(),
        qos_overriding_options=QoSOverridingOptions.with_default_policies())


def taken(subscription: Subscription) -> Iterator[tuple[Any, int]]:
    """Take what has arrived: each message, and when it did, ns of system time."""
    handle, kind = subscription.handle, subscription.msg_type
    with handle:
        while (found := handle.take_message(kind, False)) is not None:
            yield found[0], found[1]['received_timestamp']

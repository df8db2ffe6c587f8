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

"""Topics looked at now and then: what comes in between, the middleware drops by itself.

Each subscription keeps as little as is wanted and is in no executor: nothing of this process runs
when a message comes, however many there are, and a best-effort reader holds nobody up.
"""

from collections.abc import Iterator
from typing import Any

from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy


def latched() -> QoSProfile:
    """Return the quality of service of a topic whose last message waits for who comes later."""
    return QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


class Topic:
    """The newest messages of one topic; its node must not be spun."""

    def __init__(self, node: Node, kind: type, name: str, quality: QoSProfile | None = None,
                 depth: int = 1, raw: bool = False) -> None:
        self.name = name
        self._node = node
        self._subscription: Any = node.create_subscription(
            kind, name, lambda _: None, quality or QoSProfile(
                depth=depth, reliability=ReliabilityPolicy.BEST_EFFORT), raw=raw)

    def take(self) -> Iterator[tuple[Any, int]]:
        """Yield the messages that have come and were kept, and when each came, in ns."""
        subscription = self._subscription
        while True:
            with subscription.handle:
                found = subscription.handle.take_message(subscription.msg_type, subscription.raw)
            if found is None:
                return
            message, about = found
            yield message, about['received_timestamp']

    def newest(self) -> Any:
        """Return the newest message since the last call, None if none has come."""
        found = None
        for found, _ in self.take():  # noqa: B007
            pass
        return found

    def close(self) -> None:
        """Listen no more."""
        self._node.destroy_subscription(self._subscription)

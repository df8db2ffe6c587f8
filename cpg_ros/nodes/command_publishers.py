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

"""Other publishers of the commands that move a robot, and the QoS of commands."""

from rclpy.node import Node
from rclpy.qos import QoSProfile

#: Name that the graph gives to DDS participants without ROS.
BARE = '_CREATED_BY_BARE_DDS_APP_'
#: Name that the graph gives to a node until it learns the name.
UNKNOWN = '_NODE_NAMESPACE_UNKNOWN_/_NODE_NAME_UNKNOWN_'


def command_qos() -> QoSProfile:
    """Return the QoS of commands: only the newest one matters."""
    return QoSProfile(depth=1)


class OtherCommandPublishers:
    """Other publishers of a bridge's commands, apart from its watchdog."""

    def __init__(self, node: Node, topic: str, watchdog: str, *, own: int, tolerated: int) -> None:
        """Monitor a topic.

        Args:
            node: the bridge.
            topic: resolved.
            watchdog: name of the watchdog's node.
            own: number of the bridge's own publishers, without the watchdog's.
            tolerated: number of the robot's own publishers.

        """
        self._node, self._topic, self._watchdog = node, topic, f'/{watchdog}'
        self._own, self._tolerated = own, tolerated

    def names(self) -> str:
        """Return who else publishes there, or ''."""
        if self._node.count_publishers(self._topic) <= self._own + self._tolerated:
            return ''
        names = [f'{one.node_namespace.rstrip("/")}/{one.node_name}'
                 for one in self._node.get_publishers_info_by_topic(self._topic)]
        # On a busy machine, the watchdog's name is known later than its publisher.
        for name in (*[self._node.get_fully_qualified_name()] * self._own,
                     self._watchdog if self._watchdog in names else UNKNOWN):
            if name in names:
                names.remove(name)
        if len(names) <= self._tolerated:
            return ''
        return ', '.join('a program without ROS' if BARE in name else name
                         for name in sorted(names))

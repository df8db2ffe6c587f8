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

"""What of the ROS graph belongs to a Unitree robot: topics, and who else commands it."""

from rclpy.node import Node
from rclpy.qos import QoSProfile

#: Names of the nodes, of which there is one each.
BRIDGE, WATCHDOG = 'unitree_bridge', 'unitree_watchdog'
#: Names as DDS participants without ROS have them in the graph.
BARE = '_CREATED_BY_BARE_DDS_APP_'
#: What the graph calls a node until it has heard the name.
UNKNOWN = '_NODE_NAMESPACE_UNKNOWN_/_NODE_NAME_UNKNOWN_'


def quality() -> QoSProfile:
    """Return the quality of service of commands: an old one is of no use any more."""
    return QoSProfile(depth=1)


class Others:
    """Who else publishes the commands that move the robot."""

    def __init__(self, node: Node, topic: str, own: int, tolerated: int) -> None:
        """Look at a topic.

        Args:
            node: that looks, and publishes there.
            topic: resolved.
            own: how many publishers of it the bridge has itself, without the watchdog's.
            tolerated: how many the robot has by itself.

        """
        self._node, self._topic, self._own, self._tolerated = node, topic, own, tolerated

    def found(self) -> str:
        """Return who else publishes there, or ''."""
        if self._node.count_publishers(self._topic) <= self._own + self._tolerated:
            return ''
        names = [f'{one.node_namespace.rstrip("/")}/{one.node_name}'
                 for one in self._node.get_publishers_info_by_topic(self._topic)]
        watchdog = f'/{WATCHDOG}'
        # On a busy machine the watchdog's name comes later than its publisher.
        for name in (*[self._node.get_fully_qualified_name()] * self._own,
                     watchdog if watchdog in names else UNKNOWN):
            if name in names:
                names.remove(name)
        if len(names) <= self._tolerated:
            return ''
        return ', '.join('a program without ROS' if BARE in name else name
                         for name in sorted(names))

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

"""Who else commands a robot, by what the ROS graph says of its publishers."""

from types import SimpleNamespace

from cpg_ros.ros.node.health import others_on, UNKNOWN_NODE
import pytest

BRIDGE, WATCHDOG = ('/', 'unitree_bridge'), ('/', 'unitree_watchdog')
UNKNOWN = '_NODE_NAMESPACE_UNKNOWN_', '_NODE_NAME_UNKNOWN_'
BARE = '_CREATED_BY_BARE_DDS_APP_', '_CREATED_BY_BARE_DDS_APP_'


def graph(*publishers):
    """Return a bridge's node in a graph with these publishers of commands."""
    infos = [SimpleNamespace(node_namespace=space, node_name=name) for space, name in publishers]
    return SimpleNamespace(count_publishers=lambda topic: len(infos),
                           get_publishers_info_by_topic=lambda topic: infos,
                           get_fully_qualified_name=lambda: '/unitree_bridge')


def others(publishers, tolerated):
    return others_on(graph(*publishers), '/lowcmd', 1, tolerated, '/unitree_watchdog')


@pytest.mark.parametrize(('publishers', 'found'), [
    ([BRIDGE], ''), ([BRIDGE, WATCHDOG], ''),
    ([BRIDGE, WATCHDOG, ('/', 'rival')], '/rival'), ([BRIDGE, ('/lab', 'rival')], '/lab/rival'),
    ([BRIDGE, WATCHDOG, BRIDGE], '/unitree_bridge'), ([BRIDGE, BARE], 'a program without ROS'),
    # The watchdog's name may come later than its publisher.
    ([BRIDGE, UNKNOWN], ''), ([BRIDGE, WATCHDOG, UNKNOWN], UNKNOWN_NODE),
    ([BRIDGE, UNKNOWN, UNKNOWN], UNKNOWN_NODE)])
def test_who_else_commands(publishers, found):
    assert others(publishers, 0) == found


def test_publishers_of_the_robot_itself_are_tolerated():
    assert others([BRIDGE, WATCHDOG, BARE], 1) == ''

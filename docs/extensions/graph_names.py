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

"""Topics and services of the nodes, asked of the nodes themselves."""

from collections.abc import Callable, Iterator
import gc
import os
import time
from typing import Any

from cpg_ros.ros.bridges.unitree.bridge import UnitreeBridge
from cpg_ros.ros.generator import Generator
from cpg_ros.ros.inversion_node import Inversion
from cpg_ros.ros.node.node_base import StartedNode
from cpg_ros.ros.robot_sim import RobotSim
import rclpy

#: Node -> what makes one, and the parameters under which it has all of its topics.
KINDS: dict[str, tuple[Callable[[], StartedNode], tuple[dict[str, str], ...]]] = {
    'generator': (Generator, (
        {'command': 'joint_trajectory', 'exclusive': 'false', 'robot': 'unitree_go2',
         'assume_stand': 'true',
         'cmd_vel': 'true'},
        {'command': 'forward_position', 'exclusive': 'false', 'combined_topic': '""',
         'assume_stand': 'true'},
        {'robot': 'unitree_go2', 'feedback.enabled': 'true', 'combined_topic': '""',
         'feedback.odometry_topic': 'odom', 'stamped': 'true'})),
    'robot_sim': (RobotSim, ({'clock': 'true', 'stamped': 'true', 'feedforward': '0.5'},
                             {'command': 'joint_trajectory'}, {'command': 'forward_position'})),
    'unitree_bridge': (UnitreeBridge, ({'stamped': 'true', 'feedforward': '0.5'},
                                       {'command': 'joint_trajectory'},
                                       {'command': 'forward_position'})),
    'inversion': (Inversion, ({},))}
#: Topics whose names are the same in every namespace.
ABSOLUTE = ('/diagnostics', '/clock', '/tf', '/lowcmd', '/lowstate')
#: Of another build of the documentation on this machine, at the same time, there are nodes, too.
DOMAIN = 180 + os.getpid() % 50
#: Every node of ROS has these.
COMMON = ('/rosout', '/parameter_events', 'parameters', 'parameter_types',
          'parameters_atomically', 'get_type_description', 'logger_levels')


def of(kind: str) -> dict[str, tuple[str, str]]:
    """Return name -> (direction, type) of a node's topics and services."""
    make, runs = KINDS[kind]
    found: dict[str, tuple[str, str]] = {}
    for given in runs:
        words = [word for name, value in given.items() for word in ('-p', f'{name}:={value}')]
        # The graph is of no concern here: nobody else is on this domain of this machine.
        os.environ['ROS_AUTOMATIC_DISCOVERY_RANGE'] = 'LOCALHOST'
        rclpy.init(args=['--ros-args', *words, '--log-level', 'ERROR'], domain_id=DOMAIN)
        try:
            for name, (direction, type_) in _settled(make()):
                before = found.get(name, (direction, type_))[0]
                both = before if direction in before else f'{before}, {direction}'
                found[name] = both, type_
        finally:
            rclpy.shutdown()
            # What a node locks against a second one, it holds until it is gone.
            gc.collect()
    return found


def _settled(node: Any) -> list[tuple[str, tuple[str, str]]]:
    """Return what the node has, once the graph has heard of all of it."""
    found: list[tuple[str, tuple[str, str]]] = []
    while (now := sorted(_names(node))) != found or not found:
        found = now
        time.sleep(0.3)
    return found


def _names(node: Any) -> Iterator[tuple[str, tuple[str, str]]]:
    own, space = node.get_name(), node.get_namespace()
    asked = {'published': node.get_publisher_names_and_types_by_node,
             'subscribed': node.get_subscriber_names_and_types_by_node,
             'service': node.get_service_names_and_types_by_node}
    for direction, ask in asked.items():
        for name, kinds in ask(own, space):
            if name.endswith(COMMON):
                continue
            plain = name.replace(f'/{own}/', '~/') if name.startswith(f'/{own}/') else (
                name if name in ABSOLUTE else name.lstrip('/'))
            yield plain, (direction, kinds[0].replace('/msg/', '/').replace('/srv/', '/'))

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

"""The nodes and topics that a page can show or use, recognised by topics and services."""

from collections.abc import Iterable
from dataclasses import dataclass

from rclpy.node import Node

#: Topics and services of each kind of node: name below the node's own -> type.
GENERATOR = {'phase': 'std_msgs/msg/Float64MultiArray', 'gait': 'std_msgs/msg/String',
             'enable': 'std_srvs/srv/SetBool'}
SIMULATION = {'push': 'geometry_msgs/msg/Wrench', 'reset': 'std_srvs/srv/Trigger'}
INVERSION = {'fit': 'std_srvs/srv/Trigger'}


@dataclass(frozen=True)
class Graph:
    """Full names of the nodes of each kind, sorted, and the type of each topic."""

    generators: tuple[str, ...] = ()
    simulations: tuple[str, ...] = ()
    inversions: tuple[str, ...] = ()
    topics: frozenset[tuple[str, str]] = frozenset()

    def beside(self, generator: str, kind: tuple[str, ...]) -> str:
        """Return the first of a kind in a generator's namespace, '' if there is none."""
        space = namespace(generator)
        return next((name for name in kind if namespace(name) == space), '')


def namespace(node: str) -> str:
    """Return a node's namespace as a prefix of names: '' or '/robot'."""
    return node.rpartition('/')[0]


def look(node: Node) -> Graph:
    """Return the graph as a node sees it."""
    topics = {(name, kind) for name, kinds in node.get_topic_names_and_types() for kind in kinds}
    services = {(name, kind) for name, kinds in node.get_service_names_and_types()
                for kind in kinds}
    known = topics | services

    def having(what: dict[str, str]) -> tuple[str, ...]:
        first = next(iter(what))
        owners: Iterable[str] = (name.removesuffix(f'/{first}') for name, kind in known
                                 if name.endswith(f'/{first}') and kind == what[first])
        return tuple(sorted(owner for owner in owners if owner and all(
            (f'{owner}/{end}', kind) in known for end, kind in what.items())))

    return Graph(having(GENERATOR), having(SIMULATION), having(INVERSION), frozenset(topics))

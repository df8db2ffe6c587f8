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
from typing import Any

from rclpy.node import Node

#: Topics and services of each kind of node: name below the node's own -> type.
GENERATOR = {'phase': 'std_msgs/msg/Float64MultiArray', 'gait': 'std_msgs/msg/String',
             'enable': 'std_srvs/srv/SetBool'}
SIMULATION = {'push': 'geometry_msgs/msg/Wrench', 'reset': 'std_srvs/srv/Trigger'}
INVERSION = {'fit': 'std_srvs/srv/Trigger'}
BRIDGE = {'state': 'std_msgs/msg/String', 'stop': 'std_srvs/srv/Trigger',
          'damp': 'std_srvs/srv/Trigger'}
#: Levels of /diagnostics, as pages name them.
LEVELS = {0: 'ok', 1: 'warn', 2: 'error', 3: 'stale'}


def level(status: Any) -> str:
    """Return the level of a diagnostic status, which rclpy has as bytes, as pages name it."""
    number = status.level if isinstance(status.level, int) else ord(status.level)
    return LEVELS.get(number, 'stale')


@dataclass(frozen=True)
class Graph:
    """Full names of the nodes of each kind, sorted, and the type of each topic."""

    generators: tuple[str, ...] = ()
    simulations: tuple[str, ...] = ()
    inversions: tuple[str, ...] = ()
    bridges: tuple[str, ...] = ()
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
            there(f'{owner}/{end}', kind) for end, kind in what.items())))

    def there(name: str, kind: str) -> bool:
        # The panel's own clients keep the name of a service on the graph.
        return (name, kind) in known and ('/srv/' not in kind or node.count_services(name) > 0)

    return Graph(having(GENERATOR), having(SIMULATION), having(INVERSION), having(BRIDGE),
                 frozenset(topics))

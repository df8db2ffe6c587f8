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

"""Shell completion of ``cpg``, with the parameters and topics of a running graph.

It needs the library argcomplete, which comes with colcon.
"""

from argparse import ArgumentParser, Namespace
import asyncio
from collections.abc import Callable, Coroutine
from importlib.util import find_spec
from typing import Any, TYPE_CHECKING

from cpg_ros.errors import CpgError

if TYPE_CHECKING:
    from cpg_ros.nodes.node_client import NodeClient
    from rclpy.node import Node

#: How long a node may take to answer, s: somebody waits for the word, but an announcement of DDS
#: that was lost comes again only after 3 s.
PATIENCE = 4.0


class NoCompletion(CpgError):
    """The library is not installed."""

    exit_code = 1


def complete(parser: ArgumentParser) -> None:
    """Print completions and exit, if a shell requests them."""
    if find_spec('argcomplete') is not None:
        import argcomplete
        argcomplete.autocomplete(parser)


def shell_code() -> str:
    """Return the code that bash evaluates.

    Raises:
        NoCompletion: the library is not installed.

    """
    if find_spec('argcomplete') is None:
        raise NoCompletion('completion needs argcomplete: pip install argcomplete')
    from argcomplete.shell_integration import shellcode
    return str(shellcode(['cpg']))


def _looked_up(look: Callable[['Node'], list[Any]]) -> list[Any]:
    import rclpy
    from rclpy.utilities import try_shutdown
    rclpy.init(args=[])
    try:
        return look(rclpy.create_node('cpg_completion', enable_rosout=False))
    except CpgError:
        # No node responds, so there is nothing to offer.
        return []
    finally:
        try_shutdown()


def _of_node(chosen: Namespace, look: Callable[['NodeClient'], Coroutine[Any, Any, list[Any]]]
             ) -> list[Any]:
    from cpg_ros.nodes.node_client import NodeClient, ServiceClients
    return _looked_up(lambda node: asyncio.run(
        look(NodeClient(ServiceClients(node, PATIENCE), chosen.node))))


def _choices(chosen: Namespace, name: str) -> list[str]:
    from cpg_ros.nodes.parameter_spec import choices
    return [word for one in _of_node(chosen, lambda other: other.descriptors([name]))
            for word in choices(one.additional_constraints)]


def parameters(parsed_args: Namespace, **_: Any) -> list[str]:
    """Return the names of the node's parameters."""
    return _of_node(parsed_args, lambda other: other.parameters())


def gaits(parsed_args: Namespace, **_: Any) -> list[str]:
    """Return the gaits of the node."""
    return _choices(parsed_args, 'gait')


def values(parsed_args: Namespace, **_: Any) -> list[str]:
    """Return the values of a parameter that has a list of choices."""
    return _choices(parsed_args, parsed_args.parameter)


def topics(parsed_args: Namespace, **_: Any) -> list[str]:
    """Return the graph's topics."""
    from cpg_ros.tools.graph_topics import topics as graph_topics
    return _looked_up(lambda node: list(graph_topics(node)))

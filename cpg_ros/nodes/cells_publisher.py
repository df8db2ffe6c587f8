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

"""The cells of the network, for whoever looks on: no more often than people can see."""

from cpg_ros.networks.network import Network
from cpg_ros.nodes.message_block import MessageBlock, Template
import numpy as np
from rclpy.node import Node
from std_msgs.msg import Float64MultiArray, MultiArrayDimension

#: At most this many messages a second.
FASTEST = 50.0


class CellsPublisher:
    """Publishes the network on ``~/cells``: a row for each variable of a cell, one for each rate.

    Rates are in model time.
    """

    def __init__(self, node: Node, network: type[Network]) -> None:
        rows = [*network.states, *(f'd{name}/dt' for name in network.states)]
        count = len(rows) * network.cells
        message = Float64MultiArray()
        message.layout.dim = [
            MultiArrayDimension(label=','.join(rows), size=len(rows), stride=count),
            MultiArrayDimension(label='cells', size=network.cells, stride=network.cells)]
        self._block = MessageBlock(node, count, [
            ('~/cells', Template(message, numbers=[(message, 'data', np.arange(count))]))])
        self._elapsed = 1.0 / FASTEST

    def publish(self, dt: float, state: np.ndarray) -> None:
        """Publish a state and its rate, if it is time.

        Args:
            dt: since the last call, s.
            state: and its rate, shape (2, variables * cells).

        """
        self._elapsed += dt
        if self._elapsed >= (1.0 - 1e-6) / FASTEST:
            self._elapsed = 0.0
            self._block.values[:] = state.ravel()
            self._block.publish(0)

"""The cells of the network, for whoever looks on: no more often than people can see."""

import numpy as np
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.qos_overriding_options import QoSOverridingOptions
from std_msgs.msg import Float64MultiArray, MultiArrayDimension

from cpg_ros.networks.network import Network
from cpg_ros.nodes.array_view import view_of

#: At most this many messages a second.
FASTEST = 50.0


class Cells:
    """Publishes the network's state on ``~/cells``: one row for each variable of a cell."""

    def __init__(self, node: Node, network: type[Network]) -> None:
        self._message = Float64MultiArray()
        self._view = view_of(self._message, 'data', network.cells * network.variables)
        self._message.layout.dim = [
            MultiArrayDimension(label=','.join(network.states), size=network.variables,
                                stride=network.variables * network.cells),
            MultiArrayDimension(label='cells', size=network.cells, stride=network.cells)]
        self._publisher = node.create_publisher(
            Float64MultiArray, '~/cells', QoSProfile(depth=10),
            qos_overriding_options=QoSOverridingOptions.with_default_policies())
        self._elapsed = 1.0 / FASTEST

    def publish(self, dt: float, state: np.ndarray) -> None:
        """Publish a state, shape (variables * cells,), if it is time; dt in s since the last."""
        self._elapsed += dt
        if self._elapsed >= (1.0 - 1e-6) / FASTEST:
            self._elapsed = 0.0
            self._view[:] = state
            self._publisher.publish(self._message)

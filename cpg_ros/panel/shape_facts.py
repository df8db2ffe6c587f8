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

"""What the graph tells of a robot's shape."""

import asyncio
from typing import Any

from cpg_ros.nodes.node_client import NodeClient, ServiceClients
from cpg_ros.nodes.polled_group import PolledSubscription
from cpg_ros.nodes.qos_profiles import latched
from cpg_ros.panel.graph import Graph, namespace
from cpg_ros.panel.shape_source import Known, shipped_robot
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import String

#: How long a topic may be silent before nothing is expected of it, s.
PATIENCE = 1.0


def descriptions(space: str) -> tuple[str, str]:
    """Return the topics on which ROS users have a robot's URDF, that of the namespace first."""
    return f'{space}/robot_description', '/robot_description'


async def ask(watch: Node, services: ServiceClients, graph: Graph, generator: str, robot: str,
              urdf: str) -> Known:
    """Ask the graph.

    Args:
        watch: a node that is not spun.
        services: of others.
        graph: what is on it.
        generator: full name of the node that moves the robot.
        robot: its robot file.
        urdf: file that the user names, '' for none.

    Raises:
        CallError: the simulation does not answer.

    """
    space, description, model = namespace(generator), '', ''
    for topic in descriptions(space):
        if not (urdf or description) and (topic, 'std_msgs/msg/String') in graph.topics:
            description = getattr(await _once(watch, String, topic), 'data', '')
    simulation = graph.beside(generator, graph.simulations)
    if simulation:
        model, = await NodeClient(services, simulation).values(['model'])
    legs = {}
    for topic, kind in () if shipped_robot(robot) is not None else sorted(graph.topics):
        leg = topic.removeprefix(f'{space}/').removesuffix('/joint_states')
        if kind == 'sensor_msgs/msg/JointState' and '/' not in leg and leg != 'joint_states':
            message = await _once(watch, JointState, topic)
            legs[leg] = list(message.name) if message else []
    return Known(urdf, description, model if isinstance(model, str) else '', robot, legs)


async def _once(watch: Node, kind: type, name: str) -> Any:
    """Return a topic's next or latched message, None if it is silent."""
    topic = PolledSubscription(watch, kind, name, latched() if kind is String else None,
                               overridable=False)
    try:
        for _ in range(round(PATIENCE / 0.02)):
            if (message := topic.newest()) is not None:
                return message
            await asyncio.sleep(0.02)
        return None
    finally:
        topic.close()

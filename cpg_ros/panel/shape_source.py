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

"""Which shape a robot gets: the best that the graph, the user and this package know."""

import asyncio
from collections.abc import Callable
from dataclasses import dataclass, field
import json
from pathlib import Path
from typing import Any

from cpg_ros.errors import CpgError
from cpg_ros.files.regular_file import one_line
from cpg_ros.files.shared_resources import share
from cpg_ros.nodes.node_client import NodeClient, ServiceClients
from cpg_ros.nodes.polled_group import PolledSubscription
from cpg_ros.nodes.qos_profiles import latched
from cpg_ros.panel import stick_figure, urdf_shape
from cpg_ros.panel.body_shape import Shape
from cpg_ros.panel.graph import Graph, namespace
from cpg_ros.panel.pages import LONGEST
from cpg_ros.robots.robot import Robot
from cpg_ros.robots.robot_file import load_robot, RobotError
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import String

#: Robot files of this package -> the model or the URDF that goes with each.
SHIPPED = {'unitree_go2': 'go2', 'quadruped': 'quadruped.urdf'}
#: A topic that is silent for this long has no message, s.
PATIENCE = 1.0


class ShapeError(CpgError):
    """A shape is too large for the page; one line for the user."""


@dataclass(frozen=True)
class Known:
    """What the graph and the user specify about a robot.

    Attributes:
        urdf: file that the user names, '' for none.
        description: text on ``robot_description``, '' for none.
        model: of the simulation, '' where none runs.
        robot: robot file of the generator, a name or a path, which is not opened.
        legs: leg -> joints, as their topics name them.

    """

    urdf: str = ''
    description: str = ''
    model: str = ''
    robot: str = ''
    legs: dict[str, list[str]] = field(default_factory=dict)


def shipped_robot(name: str) -> Robot | None:
    """Return a robot of this package, None for any other.

    Anyone on the graph can name a file, and a robot file can name a Python file with its network:
    no file that the graph names is opened here.
    """
    shipped = {file.stem for file in (share() / 'config').glob('*.yaml')}
    try:
        return load_robot(name) if name in shipped else None
    except RobotError:  # what else is in that folder
        return None


def descriptions(space: str) -> tuple[str, str]:
    """Return the usual topics of a robot's URDF, that of the namespace first."""
    return f'{space}/robot_description', '/robot_description'


async def ask(watch: Node, services: ServiceClients, graph: Graph, generator: str, robot: str,
              urdf: str) -> Known:
    """Collect what the graph knows.

    Args:
        watch: a node that is not spun.
        services: clients of other nodes.
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
    """Return a topic's next or latched message, None if none arrives in time."""
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


def find(known: Known, report: Callable[[str], None]) -> Shape:
    """Return the first of: the user's URDF, the description, the model, a stick figure.

    Args:
        known: of the robot.
        report: takes a line about each better shape that is not available.

    """
    robot = shipped_robot(known.robot)
    for make in (_from_urdf, _from_description, _from_model):
        try:
            shape = make(known, robot, report)
            if shape is not None and (size := len(json.dumps(shape.message()))) > LONGEST:
                raise ShapeError(f'{shape.source} is not drawn: its shape has {size / 1e6:.3g} '
                                 f'MB, more than the {LONGEST / 1e6:g} MB that a page is sent')
        except (CpgError, OSError) as error:
            report(str(error))
            continue
        if shape is not None:
            # The generator respects the robot file's limits.
            shape.limits.update(_limits(robot))
            _with_feet(shape, known, robot)
            return shape
    if robot is None and known.robot:
        report(one_line(f"drawn as a stick figure: '{known.robot[:200]}' is not one of the "
                        f"shipped "
                        'robots, and the panel opens no file that a node names; publish '
                        'robot_description, or start the panel with -p urdf:=FILE'))
    return _sticks(known, robot)


def _from_urdf(known: Known, _: Robot | None, report: Callable[[str], None]) -> Shape | None:
    return urdf_shape.from_file(Path(known.urdf).expanduser(), report) if known.urdf else None


def _from_description(known: Known, _: Robot | None, report: Callable[[str], None]
                      ) -> Shape | None:
    if not known.description:
        return None
    return urdf_shape.from_text(known.description, 'robot_description', report)


def _from_model(known: Known, robot: Robot | None, report: Callable[[str], None]) -> Shape | None:
    if robot is None:
        return None
    model = known.model
    if '/' in model or model.endswith(('.xml', '.urdf')):
        report(one_line(f"the model '{model[:200]}' is not drawn: the panel opens no file that a "
                        'node names; publish robot_description, or start the panel with '
                        '-p urdf:=FILE'))
        model = ''
    shipped = not model
    model = model or SHIPPED.get(known.robot, '')
    if not model:
        return None
    if shipped and model.endswith('.urdf'):
        return urdf_shape.from_file(share() / 'urdf' / model, report)
    from cpg_ros.panel.model_shape import from_model
    return from_model(model, robot)


def _limits(robot: Robot | None) -> dict[str, tuple[float, float]]:
    return {joint.name: (joint.lower, joint.upper) for joint in robot.joints} if robot else {}


def _legs(known: Known, robot: Robot | None) -> dict[str, list[str]]:
    if robot is None:
        return known.legs
    return {leg: [joint.name for joint in joints] for leg, joints in robot.legs.items()}


def _with_feet(shape: Shape, known: Known, robot: Robot | None) -> None:
    index = {link.joint: k for k, link in enumerate(shape.links) if link.joint}
    for leg, joints in _legs(known, robot).items():
        ends = [index[joint] for joint in joints if joint in index]
        if not ends or leg in shape.feet:
            continue
        end = max(ends)
        # What is fixed to the last joint's link is the foot.
        place = shape.links[end].place * 0.0
        tips = [link for link in shape.links if link.parent == end and not link.joint]
        if tips:
            place = tips[-1].place
        elif shape.links[end].vertices:
            corners = shape.links[end].vertices[-1].reshape(-1, 3)
            place = corners.mean(axis=0)
        shape.feet[leg] = end, place


def _sticks(known: Known, robot: Robot | None) -> Shape:
    if robot is None:
        legs, name = known.legs, known.robot or 'a robot'
        # Of legs that are called as those of the shipped networks: lh rh lf rf, left right.
        places = {leg: ({'h': -1.0, 'f': 1.0}.get(leg[1:], 0.0), -1.0 if leg[:1] == 'r' else 1.0)
                  for leg in legs}
    else:
        legs, name = _legs(known, robot), robot.name
        places = {leg: ({'fore': 1.0, 'hind': -1.0}.get(robot.girdles.get(leg, ''), 0.0),
                        -1.0 if robot.sides.get(leg) == 'right' else 1.0) for leg in legs}
    return stick_figure.draw(name, legs, places, _limits(robot))

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
from xml.etree import ElementTree as Xml

from cpg_ros.common.errors import CpgError
from cpg_ros.common.files import one_line, resource_folder
from cpg_ros.motion.description import (
    describe,
    DescriptionError,
    JointDescription,
    mesh_folder,
    numbers,
    parse_tree,
    read_tree,
)
from cpg_ros.motion.meshes import find_mesh, MeshError, read_mesh
from cpg_ros.motion.robot import Robot
from cpg_ros.motion.robot_file import load_robot, RobotError
from cpg_ros.motion.rotations import rotation
from cpg_ros.ros.node.client import Graph, namespace, NodeClient, ServiceClients
from cpg_ros.ros.node.polled import latched, PolledSubscription
from cpg_ros.ros.panel import shape as solids
from cpg_ros.ros.panel import shape as stick_figure
from cpg_ros.ros.panel.pages import LONGEST
from cpg_ros.ros.panel.shape import Link, Shape
import numpy as np
from rclpy.node import Node
from sensor_msgs.msg import JointState
from std_msgs.msg import String

# The shape of a robot from its URDF, a file or the text on ``robot_description``.

#: Largest text on ``robot_description``, bytes; triangles and bytes of meshes that are drawn.
LARGEST, TRIANGLES, MESHES = 4_000_000, 100_000, 500_000_000
#: Nothing that is drawn is longer or further away, m.
FURTHEST = 1e4


def from_text(text: str, source: str, report: Callable[[str], None]) -> Shape:
    """Return the shape that a URDF's text on the graph describes.

    Args:
        text: from anyone on the graph: only files of installed packages are opened.
        source: what to call it.
        report: takes a line about each part that cannot be drawn.

    Raises:
        DescriptionError: it is no URDF, is too large, or its links are not one tree.

    """
    data = text.encode(errors='replace')
    if len(data) > LARGEST:
        raise DescriptionError(f'URDF {source}: has {len(data) / 1e6:.4g} MB, more than the '
                        f'{LARGEST / 1e6:g} MB that are read')
    return _shape(parse_tree(data, source), source, None, report)


def from_file(path: Path, report: Callable[[str], None]) -> Shape:
    """Return the shape that a user's URDF file describes.

    Args:
        path: of the file; meshes are found as ``find_mesh`` says.
        report: takes a line about each part that cannot be drawn.

    Raises:
        DescriptionError: it is no URDF, or its links are not one tree.

    """
    return _shape(read_tree(path), path.name, path, report)


def _shape(tree: Xml.Element, source: str, path: Path | None, report: Callable[[str], None]
           ) -> Shape:
    description = describe(tree, source)
    joints = description.joints
    drawing = _Drawing(tree, path)
    visuals = {link.get('name', ''): link.findall('visual') for link in tree.findall('link')}
    shape = Shape(source, [Link(description.root(), -1)])
    shape.limits = {joint.name: (joint.lower, joint.upper) for joint in joints.values()
                    if joint.kind != 'fixed'}
    below: dict[str, list[JointDescription]] = {}
    for joint in joints.values():
        below.setdefault(joint.parent, []).append(joint)
    for index, link in enumerate(shape.links):  # which grows
        if len(shape.links) > len(joints) + 1:
            raise DescriptionError(f'URDF {source}: the links form a loop')
        for joint in below.get(link.name, ()):
            shape.links.append(_held(joint, index))
        for visual in visuals.get(link.name, ()):
            try:
                drawing.add(link, visual)
            except MeshError as error:
                report(f'not drawn: {error}')
    return shape


def _held(joint: JointDescription, parent: int) -> Link:
    fixed = joint.kind == 'fixed' or bool(joint.mimic)
    axis = np.array(joint.axis)
    return Link(joint.child, parent, '' if fixed else joint.name, joint.kind == 'prismatic',
                axis / max(float(np.linalg.norm(axis)), 1e-9), np.array(joint.xyz),
                rotation(joint.rpy))


def _numbers(text: str | None, default: str) -> np.ndarray:
    """Return as many numbers as the default has."""
    count = len(default.split())
    found = np.array(numbers(text or default, count))
    if not len(found) or not (np.abs(found) < FURTHEST).all():
        raise MeshError(f"'{(text or '')[:40]}' is not {count} numbers below {FURTHEST:g}")
    return found


class _Drawing:
    """Draws visuals as triangles, as many as a page can show."""

    def __init__(self, tree: Xml.Element, path: Path | None) -> None:
        self._path, self._folder = path, mesh_folder(tree)
        self._colours = {one.get('name', ''): one for one in tree.findall('material')}
        self._meshes: dict[Path, np.ndarray] = {}
        self._bytes, self._left = 0, TRIANGLES

    def add(self, link: Link, visual: Xml.Element) -> None:
        """Add a visual to its link.

        Raises:
            MeshError: it cannot be drawn.

        """
        origin, material = visual.find('origin'), visual.find('material')
        place = _numbers(None if origin is None else origin.get('xyz'), '0 0 0')
        pose = rotation(tuple(_numbers(None if origin is None else origin.get('rpy'), '0 0 0')))
        colour = solids.GREY if material is None else self._colour(material)
        for one in visual.iterfind('geometry/*'):
            found = self._solid(one)
            if len(found) > self._left:
                raise MeshError(f'what exceeds {TRIANGLES} triangles of the whole robot')
            self._left -= len(found)
            link.add(found, colour, place, pose)

    def _colour(self, material: Xml.Element) -> tuple[float, ...]:
        for one in (material, self._colours.get(material.get('name', ''))):
            if one is not None and (colour := one.find('color')) is not None:
                return tuple(_numbers(colour.get('rgba'), '0.6 0.6 0.6 1'))
        return solids.GREY

    def _solid(self, solid: Xml.Element) -> np.ndarray:
        if solid.tag == 'box':
            return solids.box(0.5 * _numbers(solid.get('size'), '0.1 0.1 0.1'))
        radius, length = (float(_numbers(solid.get(key), '0.1')[0])
                          for key in ('radius', 'length'))
        if solid.tag == 'cylinder':
            return solids.cylinder(radius, 0.5 * length)
        if solid.tag == 'sphere':
            return solids.sphere(radius)
        if solid.tag == 'capsule':
            return solids.capsule(radius, 0.5 * length)
        if solid.tag != 'mesh':
            raise MeshError(f'<{solid.tag}> is not a URDF shape')
        name = solid.get('filename', '')
        found = self._mesh(name) * _numbers(solid.get('scale'), '1 1 1')
        if not (np.abs(found) < FURTHEST).all():
            raise MeshError(f'{name}: a vertex is further than {FURTHEST:g} m away')
        return solids.coarse(found)

    def _mesh(self, name: str) -> np.ndarray:
        path = find_mesh(name, self._path, self._folder)
        if path not in self._meshes:
            mesh = read_mesh(path)
            if not len(mesh.triangles):
                raise MeshError(f'{path}: it has no triangles')
            found = mesh.points[mesh.triangles]
            self._bytes += found.nbytes
            if self._bytes > MESHES:
                raise MeshError(f'{name}: the meshes have more than {MESHES / 1e6:g} MB')
            self._meshes[path] = found
        return self._meshes[path]


#: Robot files of this package -> the model or the URDF that goes with each.
SHIPPED = {'unitree_go2': 'go2', 'quadruped': 'quadruped.urdf'}
#: A topic that is silent for this long has no message, s.
PATIENCE = 1.0


class ShapeError(CpgError):
    """A shape is too large for the page; one line for the user."""


@dataclass(frozen=True)
class RobotInfo:
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
    shipped = {file.stem for file in resource_folder('config').glob('*.yaml')}
    try:
        return load_robot(name) if name in shipped else None
    except RobotError:  # what else is in that folder
        return None


def descriptions(space: str) -> tuple[str, str]:
    """Return the usual topics of a robot's URDF, that of the namespace first."""
    return f'{space}/robot_description', '/robot_description'


async def ask(watch: Node, services: ServiceClients, graph: Graph, generator: str, robot: str,
              urdf: str) -> RobotInfo:
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
    return RobotInfo(urdf, description, model if isinstance(model, str) else '', robot, legs)


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


def find(known: RobotInfo, report: Callable[[str], None]) -> Shape:
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


def _from_urdf(known: RobotInfo, _: Robot | None, report: Callable[[str], None]) -> Shape | None:
    return from_file(Path(known.urdf).expanduser(), report) if known.urdf else None


def _from_description(known: RobotInfo, _: Robot | None, report: Callable[[str], None]
                      ) -> Shape | None:
    if not known.description:
        return None
    return from_text(known.description, 'robot_description', report)


def _from_model(known: RobotInfo, robot: Robot | None,
                report: Callable[[str], None]) -> Shape | None:
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
        return from_file(resource_folder('urdf') / model, report)
    from cpg_ros.ros.panel.shape import from_model
    return from_model(model, robot)


def _limits(robot: Robot | None) -> dict[str, tuple[float, float]]:
    return {joint.name: (joint.lower, joint.upper) for joint in robot.joints} if robot else {}


def _legs(known: RobotInfo, robot: Robot | None) -> dict[str, list[str]]:
    if robot is None:
        return known.legs
    return {leg: [joint.name for joint in joints] for leg, joints in robot.legs.items()}


def _with_feet(shape: Shape, known: RobotInfo, robot: Robot | None) -> None:
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


def _sticks(known: RobotInfo, robot: Robot | None) -> Shape:
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

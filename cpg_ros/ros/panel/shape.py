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

"""The shape that the panel draws of a robot: the best that the graph, the user and files tell.

A shape is links that turn about joints, each with its own meshes and solids.
"""

import base64
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
import json
import math
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
from cpg_ros.motion.meshes import find_mesh, merged, Mesh, MeshError, read_mesh
from cpg_ros.motion.robot import Robot
from cpg_ros.motion.robot_file import load_robot, RobotError
from cpg_ros.motion.rotations import matrix_of, rotation
from cpg_ros.ros.panel.pages import MAX_MESSAGE_LENGTH
from cpg_ros.simulation.robot_model import engine, load
from cpg_ros.simulation.urdf_model import to_urdf
import numpy as np

#: Colour of what has none.
GREY = (0.62, 0.65, 0.70)
#: MERGE_DISTANCES: vertices closer than this are merged, m, tried one after another until a mesh
#: has at most MAX_MESH_TRIANGLES triangles: a page draws a robot, not its screws.
MERGE_DISTANCES, MAX_MESH_TRIANGLES = (1e-5, 0.002, 0.004, 0.008), 30_000
#: NUM_STEPS: number of steps of a coordinate within a mesh.
NUM_STEPS = 65535


@dataclass
class Part:
    """A piece of a link in one colour: a mesh, or a solid with sizes as a geom of MuJoCo has them.

    Attributes:
        kind: mesh, or box, sphere, ellipsoid, capsule or cylinder.
        size: of a solid, m: half lengths, or radius and half length.
        mesh: of a mesh, else None; m.
        colour: red, green and blue, 0 to 1.
        position, pose: in the link: m, and a rotation matrix.

    """

    kind: str
    size: np.ndarray
    mesh: Mesh | None = None
    colour: tuple[float, ...] = GREY
    position: np.ndarray = field(default_factory=lambda: np.zeros(3))
    pose: np.ndarray = field(default_factory=lambda: np.eye(3))

    @property
    def corners(self) -> np.ndarray:
        """Points that enclose it, in the link, m, shape (n, 3)."""
        if self.mesh is not None:
            points = self.mesh.points
        else:
            radius, long = self.size[0], self.size[-1] + (self.kind == 'capsule') * self.size[0]
            half = (self.size if self.kind in ('box', 'ellipsoid') else
                    np.array([radius, radius, radius if self.kind == 'sphere' else long]))
            points = half * (2.0 * np.indices((2, 2, 2)).reshape(3, 8).T - 1.0)
        return points @ self.pose.T + self.position

    def message(self) -> dict[str, Any]:
        """Return the part for a page; a mesh's points are in steps above the lowest ones."""
        message = {'kind': self.kind, 'size': np.round(self.size, 5).tolist(),
                   'colour': np.round(self.colour[:3], 3).tolist(),
                   'frame': _frame(self.position, self.pose)}
        if self.mesh is None:
            return message
        points = self.mesh.points
        low = points.min(axis=0)
        step = max(float(np.ptp(points, axis=0).max()) / NUM_STEPS, 1e-9)
        return {**message, 'low': low.tolist(), 'step': step,
                'points': _base64(np.round((points - low) / step).astype('<u2')),
                'triangles': _base64(self.mesh.triangles.astype('<u4'))}


@dataclass
class Link:
    """A rigid body, and its joint to its parent.

    Attributes:
        name: of it.
        parent: index of the parent, -1 for the base.
        joint: name of the joint between them, '' for a fixed one.
        slides: whether the joint is prismatic, m, not revolute, rad.
        axis: of the joint, in the link's own frame.
        position, pose: of the link in its parent at angle 0: m, and a rotation matrix.
        parts: what is drawn of it.

    """

    name: str
    parent: int
    joint: str = ''
    slides: bool = False
    axis: np.ndarray = field(default_factory=lambda: np.array([0.0, 1.0, 0.0]))
    position: np.ndarray = field(default_factory=lambda: np.zeros(3))
    pose: np.ndarray = field(default_factory=lambda: np.eye(3))
    parts: list[Part] = field(default_factory=list)

    @property
    def corners(self) -> np.ndarray:
        """Points that enclose it, and its origin, m, shape (n, 3)."""
        return np.concatenate([np.zeros((1, 3)), *(part.corners for part in self.parts)])


@dataclass
class Shape:
    """A robot.

    Attributes:
        source: of the shape, for people.
        links: a parent before its children, the base first.
        limits: joint -> lower and upper, rad, infinite where there is none.
        feet: leg -> index of the link that stands on the floor, and where on it, m.

    """

    source: str
    links: list[Link]
    limits: dict[str, tuple[float, float]] = field(default_factory=dict)
    feet: dict[str, tuple[int, np.ndarray]] = field(default_factory=dict)

    def message(self) -> dict[str, Any]:
        """Return the message for a page."""
        links = [{'name': link.name, 'parent': link.parent, 'joint': link.joint,
                  'slides': link.slides, 'axis': np.round(link.axis, 6).tolist(),
                  'frame': _frame(link.position, link.pose),
                  'parts': [part.message() for part in link.parts]} for link in self.links]
        limits = {joint: [value if math.isfinite(value) else None for value in span]
                  for joint, span in self.limits.items()}
        return {'type': 'shape', 'source': self.source, 'links': links, 'limits': limits,
                'feet': {leg: [index, *np.round(position, 5).tolist()]
                         for leg, (index, position) in self.feet.items()}}


def _frame(position: np.ndarray, pose: np.ndarray) -> list[float]:
    """Return the 4 x 4 matrix of a frame, column by column."""
    return np.round(np.r_[np.c_[pose, position], [[0.0, 0.0, 0.0, 1.0]]].T.ravel(), 6).tolist()


def _base64(values: np.ndarray) -> str:
    return base64.b64encode(values.tobytes()).decode('ascii')


def drawable(mesh: Mesh) -> Mesh:
    """Return a mesh with shared vertices, coarser where it has more triangles than are drawn."""
    for grain in MERGE_DISTANCES:
        coarse = merged(mesh, grain)
        if len(coarse.triangles) <= MAX_MESH_TRIANGLES:
            break
    return coarse


def along(start: np.ndarray, end: np.ndarray, radius: float, colour: tuple[float, ...]) -> Part:
    """Return a capsule between two points, m, on a line along y or z."""
    way = end - start
    pose = rotation((0.5 * math.pi, 0.0, 0.0)) if way[1] else np.eye(3)
    return Part('capsule', np.array([radius, 0.5 * np.linalg.norm(way)]), None, colour,
                0.5 * (start + end), pose)


# A stick figure for a robot of which only legs and joints are known.

#: HALF_LENGTH, HALF_WIDTH: half the distance between hips along and across the body, m;
#: LEG_LENGTH: length of a leg, m.
HALF_LENGTH, HALF_WIDTH, LEG_LENGTH = 0.24, 0.11, 0.42
BODY_COLOUR, LEG_COLOUR, FOOT_COLOUR = (0.22, 0.33, 0.45), (0.75, 0.78, 0.82), (0.20, 0.20, 0.20)


def stick_figure(name: str, legs: Mapping[str, Sequence[str]], robot: Robot | None) -> Shape:
    """Return the shape.

    Args:
        name: of the robot, for people.
        legs: leg -> its joints, from the body down. Of three the first turns about the axis that
            points ahead, all others turn about that to the left.
        robot: that says where a leg is; without one the leg's name does, as in the shipped
            networks: lh rh lf rf, left right.

    """
    hips = {}
    for leg in legs:
        girdle, side = ((robot.girdles.get(leg, ''), robot.sides.get(leg, '')) if robot else
                        ({'h': 'hind', 'f': 'fore'}.get(leg[1:], ''), leg))
        hips[leg] = np.array([{'fore': HALF_LENGTH, 'hind': -HALF_LENGTH}.get(girdle, 0.0),
                              -HALF_WIDTH if side[:1] == 'r' else HALF_WIDTH, 0.0])
    long = max((abs(hip[0]) for hip in hips.values()), default=0.0)
    base = Link('base', -1, parts=[
        Part('box', np.array([long + 0.06, 0.7 * HALF_WIDTH, 0.05]), None, BODY_COLOUR),
        Part('box', np.array([0.02, 0.04, 0.02]), None, LEG_COLOUR,
             np.array([long + 0.08, 0.0, 0.02]))])
    shape = Shape(f"stick figure of '{name}'", [base])
    for leg, joints in legs.items():
        parent, position = 0, hips[leg]
        base.parts.append(along(position * [1.0, 0.0, 0.0], position, 0.025, BODY_COLOUR))
        swinging = joints[1:] if len(joints) >= 3 else joints
        for joint in joints:
            swings = joint in swinging
            tip = (np.array([0.0, 0.0, -LEG_LENGTH / len(swinging)]) if swings else
                   np.array([0.0, 0.3 * hips[leg][1], 0.0]))
            link = Link(joint, parent, joint, position=position, axis=np.eye(3)[int(swings)],
                        parts=[along(np.zeros(3), tip, 0.018, LEG_COLOUR),
                               Part('sphere', np.array([0.028]), None, BODY_COLOUR)])
            shape.links.append(link)
            parent, position = len(shape.links) - 1, tip
        shape.links[parent].parts.append(
            Part('sphere', np.array([0.026]), None, FOOT_COLOUR, position))
        shape.feet[leg] = parent, position
    return shape


# The shape of a robot from its MuJoCo model, as robot_sim uses it.

#: Kinds of geoms that are drawn.
GEOM_TYPES = 'mesh', 'box', 'sphere', 'ellipsoid', 'capsule', 'cylinder'
#: Geoms of these groups and above are for collisions, by the custom of the models.
COLLISION_GROUP = 3


def from_model(name: str, robot: Robot) -> Shape:
    """Return the shape of a model.

    Args:
        name: as robot_sim's parameter ``model`` takes it.
        robot: whose joints and legs.

    Raises:
        SimulationError: there is no such model or no MuJoCo, or model and robot do not match.

    """
    mujoco, model = engine(), load(name, robot, visual=True)
    urdf = to_urdf(model, name, 'base_link', {})
    shape = _skeleton(parse_tree(urdf.encode(), name), f"model '{name}'")
    links = {link.name: link for link in shape.links}
    for body in range(1, model.nbody):
        if link := links.get(model.body(body).name or f'body_{body}'):
            _draw(mujoco, model, body, link)
    return shape


def _draw(mujoco: Any, model: Any, body: int, link: Link) -> None:
    """Add a body's geoms to its link, whose origin is at the body's last joint."""
    first, joints = model.body_geomadr[body], model.body_jntnum[body]
    origin = model.jnt_pos[model.body_jntadr[body] + joints - 1] if joints else np.zeros(3)
    geoms = range(first, first + model.body_geomnum[body])
    visual = [k for k in geoms if model.geom_group[k] < COLLISION_GROUP
              and not (model.geom_contype[k] and model.geom_type[k] != mujoco.mjtGeom.mjGEOM_MESH
                       and any(model.geom_type[j] == mujoco.mjtGeom.mjGEOM_MESH for j in geoms))]
    for k in visual or geoms:
        material = model.geom_matid[k]
        colour = model.mat_rgba[material] if material >= 0 else model.geom_rgba[k]
        kind = mujoco.mjtGeom(model.geom_type[k]).name.removeprefix('mjGEOM_').lower()
        if colour[3] > 0.05 and kind in GEOM_TYPES:
            link.parts.append(Part(
                kind, model.geom_size[k].copy(), _mesh(model, k) if kind == 'mesh' else None,
                tuple(colour[:3]), model.geom_pos[k] - origin, matrix_of(model.geom_quat[k])))


def _mesh(model: Any, k: int) -> Mesh:
    mesh = model.geom_dataid[k]
    first, count = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
    start, faces = model.mesh_faceadr[mesh], model.mesh_facenum[mesh]
    return drawable(Mesh(model.mesh_vert[first:first + count].astype(float),
                         model.mesh_face[start:start + faces].astype(int)))


# The shape of a robot from its URDF, a file or the text on ``robot_description``.

#: MAX_DESCRIPTION_BYTES: largest text on ``robot_description``, bytes; MAX_TRIANGLES: most
#: triangles that are drawn; MAX_MESH_BYTES: most bytes of all meshes.
MAX_DESCRIPTION_BYTES, MAX_TRIANGLES, MAX_MESH_BYTES = 4_000_000, 100_000, 500_000_000
#: Triangles of a solid as the page draws it.
SOLID_TRIANGLES = {'box': 12, 'cylinder': 96, 'sphere': 720, 'capsule': 816}
#: MAX_DISTANCE: nothing that is drawn is longer or further away, m; MIN_HALF_WIDTH: half the least
#: width of a box in place of what is missing, m.
MAX_DISTANCE, MIN_HALF_WIDTH = 1e4, 0.01


def from_text(text: str, source: str, report: Callable[[str], None]) -> Shape:
    """Return the shape that a URDF's text on the graph describes.

    The text may come from anyone: only files of installed packages are opened. ``report`` takes a
    line about each part that cannot be drawn.

    Raises:
        DescriptionError: it is no URDF, is too large, or its links are not one tree.

    """
    data = text.encode(errors='replace')
    if len(data) > MAX_DESCRIPTION_BYTES:
        raise DescriptionError(f'URDF {source}: has {len(data) / 1e6:.4g} MB, more than the '
                        f'{MAX_DESCRIPTION_BYTES / 1e6:g} MB that are read')
    return _shape(parse_tree(data, source), source, None, report)


def from_file(path: Path, report: Callable[[str], None]) -> Shape:
    """Return the shape that a user's URDF file describes; arguments as of ``from_text``.

    Raises:
        DescriptionError: it is no URDF, or its links are not one tree.

    """
    return _shape(read_tree(path), path.name, path, report)


def _skeleton(tree: Xml.Element, source: str) -> Shape:
    """Return the links and limits of a URDF, with nothing to draw."""
    description = describe(tree, source)
    joints = description.joints.values()
    shape = Shape(source, [Link(description.root(), -1)])
    shape.limits = {joint.name: (joint.lower, joint.upper) for joint in joints
                    if joint.kind != 'fixed'}
    below: dict[str, list[JointDescription]] = {}
    for joint in joints:
        below.setdefault(joint.parent, []).append(joint)
    for index, link in enumerate(shape.links):  # which grows
        if len(shape.links) > len(joints) + 1:
            raise DescriptionError(f'URDF {source}: the links form a loop')
        for joint in below.get(link.name, ()):
            fixed, axis = joint.kind == 'fixed' or bool(joint.mimic), np.array(joint.axis)
            shape.links.append(Link(
                joint.child, index, '' if fixed else joint.name, joint.kind == 'prismatic',
                axis / max(float(np.linalg.norm(axis)), 1e-9), np.array(joint.xyz),
                rotation(joint.rpy)))
    return shape


def _shape(tree: Xml.Element, source: str, path: Path | None, report: Callable[[str], None]
           ) -> Shape:
    shape, drawing = _skeleton(tree, source), _Drawing(tree, path)
    elements = {link.get('name', ''): link for link in tree.findall('link')}
    ends: dict[int, list[np.ndarray]] = {}
    for link in shape.links:
        ends.setdefault(link.parent, []).append(link.position)
    errors, replaced = [], []
    kind = 'collision' if tree.find('link/visual') is None else 'visual'
    for index, link in enumerate(shape.links):
        element = elements.get(link.name, Xml.Element('link'))
        failed = drawing.add_all(link, element.findall(kind))
        if failed and not link.parts:
            replaced.append(link.name)
            drawing.add_all(link, element.findall('collision'))
            if not link.parts:
                points = np.array([np.zeros(3), *ends.get(index, ())])
                low, high = points.min(axis=0), points.max(axis=0)
                link.parts.append(Part('box', np.maximum(0.5 * (high - low), MIN_HALF_WIDTH),
                                       None, GREY, 0.5 * (low + high)))
        errors += failed
    if kind == 'collision' and any(link.parts for link in shape.links):
        report(f'drawn by its collision shapes: URDF {source} has no visual ones')
    if errors:
        more = f' (and {len(errors) - 1} more like it)' if len(errors) > 1 else ''
        instead = '; drawn by their collision shapes or as boxes: ' + ', '.join(replaced)
        report(f'not drawn: {errors[0]}{more}{instead if replaced else ""}')
    return shape


def _numbers(text: str | None, default: str) -> np.ndarray:
    """Return as many numbers as the default has."""
    count = len(default.split())
    values = np.array(numbers(text or default, count))
    if not len(values) or not (np.abs(values) < MAX_DISTANCE).all():
        raise MeshError(f"'{(text or '')[:40]}' is not {count} numbers below {MAX_DISTANCE:g}")
    return values


class _Drawing:
    """Draws visuals as triangles, as many as a page can show."""

    def __init__(self, tree: Xml.Element, path: Path | None) -> None:
        self._path, self._folder = path, mesh_folder(tree)
        self._colours = {material.get('name', ''): material
                         for material in tree.findall('material')}
        self._meshes: dict[Path, Mesh] = {}
        self._bytes, self._remaining = 0, MAX_TRIANGLES

    def add_all(self, link: Link, visuals: Sequence[Xml.Element]) -> list[str]:
        """Add visuals to their link; return why some cannot be drawn."""
        errors = []
        for visual in visuals:
            try:
                self._add(link, visual)
            except MeshError as error:
                errors.append(str(error))
        return errors

    def _add(self, link: Link, visual: Xml.Element) -> None:
        origin, material = visual.find('origin'), visual.find('material')
        position, angles = (_numbers(None if origin is None else origin.get(key), '0 0 0')
                            for key in ('xyz', 'rpy'))
        colour = GREY if material is None else self._colour(material)
        for solid in visual.iterfind('geometry/*'):
            part = self._part(solid)
            part.colour, part.position, part.pose = colour, position, rotation(tuple(angles))
            count = SOLID_TRIANGLES[part.kind] if part.mesh is None else len(part.mesh.triangles)
            if count > self._remaining:
                raise MeshError(f'what exceeds {MAX_TRIANGLES} triangles of the whole robot')
            self._remaining -= count
            link.parts.append(part)

    def _colour(self, material: Xml.Element) -> tuple[float, ...]:
        for element in (material, self._colours.get(material.get('name', ''))):
            if element is not None and (colour := element.find('color')) is not None:
                return tuple(_numbers(colour.get('rgba'), '0.6 0.6 0.6 1'))
        return GREY

    def _part(self, solid: Xml.Element) -> Part:
        if solid.tag == 'box':
            return Part('box', 0.5 * _numbers(solid.get('size'), '0.1 0.1 0.1'))
        radius, length = (float(_numbers(solid.get(key), '0.1')[0])
                          for key in ('radius', 'length'))
        if solid.tag in ('cylinder', 'sphere', 'capsule'):
            return Part(solid.tag, np.array([radius, 0.5 * length]))
        if solid.tag != 'mesh':
            raise MeshError(f'<{solid.tag}> is not a URDF shape')
        name = solid.get('filename', '')
        points, triangles = self._mesh(name)
        points = points * _numbers(solid.get('scale'), '1 1 1')
        if not (np.abs(points) < MAX_DISTANCE).all():
            raise MeshError(f'{name}: a vertex is further than {MAX_DISTANCE:g} m away')
        return Part('mesh', np.zeros(0), drawable(Mesh(points, triangles)))

    def _mesh(self, name: str) -> Mesh:
        path = find_mesh(name, self._path, self._folder)
        if path not in self._meshes:
            mesh = read_mesh(path)
            if not len(mesh.triangles):
                raise MeshError(f'{path}: it has no triangles')
            self._bytes += 9 * 8 * len(mesh.triangles)
            if self._bytes > MAX_MESH_BYTES:
                raise MeshError(f'{name}: the meshes have more than {MAX_MESH_BYTES / 1e6:g} MB')
            self._meshes[path] = mesh
        return self._meshes[path]


#: Robot files of this package -> the model or the URDF that goes with each.
SHIPPED = {'unitree_go2': 'go2', 'quadruped': 'quadruped.urdf'}


class ShapeError(CpgError):
    """A shape is too large for the page; one line for the user."""


@dataclass
class RobotInfo:
    """Data on a robot from the graph and the user.

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


def find(info: RobotInfo, report: Callable[[str], None]) -> Shape:
    """Return the first of: the user's URDF, the description, the model, a stick figure.

    A simulation's own description has no meshes: its model comes first, if that is shipped.
    ``report`` takes a line about each better shape that is not available.
    """
    robot = shipped_robot(info.robot)
    legs: Mapping[str, Sequence[str]] = info.legs if robot is None else {
        leg: [joint.name for joint in joints] for leg, joints in robot.legs.items()}
    described = [
        lambda: (from_text(info.description, 'robot_description', report)
                 if info.description else None),
        lambda: _from_model(info, robot, report) if robot else None]
    for make in (
            lambda: from_file(Path(info.urdf).expanduser(), report) if info.urdf else None,
            *(described if not info.model or _is_file(info.model) else described[::-1])):
        try:
            shape = make()
            if shape and (size := len(json.dumps(shape.message()))) > MAX_MESSAGE_LENGTH:
                raise ShapeError(f'{shape.source} is not drawn: its shape has {size / 1e6:.3g} '
                                 f'MB, more than the {MAX_MESSAGE_LENGTH / 1e6:g} MB that a '
                                 'page is sent')
        except (CpgError, OSError) as error:
            report(str(error))
            continue
        if shape:
            break
    else:
        if robot is None and info.robot:
            report(one_line(f"drawn as a stick figure: '{info.robot[:200]}' is not one of the "
                            'shipped robots, and the panel opens no file that a node names; '
                            'publish robot_description, or start the panel with -p urdf:=FILE'))
        shape = stick_figure(robot.name if robot else info.robot or 'a robot', legs, robot)
    # The generator respects the robot file's limits.
    for joint in robot.joints if robot else ():
        shape.limits[joint.name] = joint.lower, joint.upper
    _add_feet(shape, legs)
    return shape


def _is_file(model: str) -> bool:
    return '/' in model or model.endswith(('.xml', '.urdf'))


def _from_model(info: RobotInfo, robot: Robot, report: Callable[[str], None]) -> Shape | None:
    model = info.model
    if _is_file(model):
        report(one_line(f"the model '{model[:200]}' is not drawn: the panel opens no file that a "
                        'node names; publish robot_description, or start the panel with '
                        '-p urdf:=FILE'))
        model = ''
    model = model or SHIPPED.get(info.robot, '')
    if model.endswith('.urdf'):
        return from_file(resource_folder('urdf') / model, report)
    return from_model(model, robot) if model else None


def _add_feet(shape: Shape, legs: Mapping[str, Sequence[str]]) -> None:
    index = {link.joint: k for k, link in enumerate(shape.links) if link.joint}
    for leg, joints in legs.items():
        ends = [index[joint] for joint in joints if joint in index]
        if not ends or leg in shape.feet:
            continue
        end = max(ends)
        # A link that is fixed to the last joint's link is the foot; else it is what is farthest
        # from the joint.
        tips = [link for link in shape.links if link.parent == end and not link.joint]
        corners = shape.links[end].corners
        away = np.linalg.norm(corners, axis=1)
        shape.feet[leg] = end, (tips[-1].position if tips else
                                corners[away >= 0.95 * away.max()].mean(axis=0))

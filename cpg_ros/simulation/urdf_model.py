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

"""Conversion of ROS URDF files into ones that MuJoCo accepts, and of its models into URDF.

A URDF may name meshes by package, in formats that MuJoCo does not read, and have links without
mass or with inertias that no body has. Links that joints move need both; frames that hang on
fixed joints become part of the link above. Every change is reported.
"""

from collections.abc import Callable, Collection, Mapping
import math
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from cpg_ros.common import files
from cpg_ros.motion.description import mesh_folder, numbers, read_tree
from cpg_ros.motion.meshes import find_mesh, MeshError, read_mesh
from cpg_ros.motion.rotations import matrix_of, rotation_about, rpy_of
import numpy as np

# Meshes that MuJoCo cannot read: the reasons, and the convex hulls that take their place.

#: MIN_HULL_SIZE: least size of a mesh in each dimension with which it has a hull, m.
MIN_HULL_SIZE = 1e-6


def trouble(path: Path) -> str:
    """Return why MuJoCo cannot read a mesh, '' if it can."""
    if path.suffix.lower() not in ('.stl', '.obj', '.msh'):
        return f'MuJoCo does not read {path.suffix or "files without an ending"}'
    import mujoco
    spec = mujoco.MjSpec()
    spec.add_mesh(name='mesh', file=str(path.resolve()),
                  inertia=mujoco.mjtMeshInertia.mjMESH_INERTIA_CONVEX)
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname='mesh')
    try:
        spec.compile()
    except ValueError as error:
        return str(error).splitlines()[0].removeprefix('Error: ')
    return ''


def hull(path: Path) -> bytes:
    """Return the corners of a mesh's convex hull, m, as MSH, which MuJoCo takes for the hull.

    Raises:
        MeshError: the file cannot be read, or its points are in a plane.

    """
    from scipy.spatial import ConvexHull, QhullError
    points = read_mesh(path).points
    if len(points) < 4 or np.ptp(points, axis=0).min() < MIN_HULL_SIZE:
        raise MeshError(f'{path}: {len(points)} points that enclose no volume')
    try:
        convex = ConvexHull(points)
    except QhullError as error:
        raise MeshError(f'{path}: its points enclose no volume') from error
    corners = points[convex.vertices].astype('<f4')
    # The numbers of points, normals, texture coordinates and faces.
    return np.array([len(corners), 0, 0, 0], '<i4').tobytes() + corners.tobytes()


# Corrections of masses and inertias in URDF files that no body can have.

#: MIN_MOMENT: least second moment in any direction, as a fraction of their sum.
MIN_MOMENT = 1e-3
#: Violation, as a fraction of the sum, up to which it is corrected without a message.
MOMENT_TOLERANCE = 1e-4
#: MIN_GYRATION: radius of gyration below which a body counts as a point, m; MAX_GYRATION: over the
#: length of the robot's longest link, above which an inertia is wrong, as of other units.
MIN_GYRATION, MAX_GYRATION = 1e-4, 2.0
#: DENSITY: assumed for a body with a mass but no extent, and for one without mass, kg/m^3.
DENSITY = 1000.0
#: Mass of a link without mass that a joint moves. MIN_MASS_FRACTION: fraction of the robot's mass;
#: MIN_MASS: least mass, kg.
MIN_MASS_FRACTION, MIN_MASS = 1e-3, 1e-2


def moments(matrix: np.ndarray) -> np.ndarray:
    """Return the second moments of a body with this inertia, kg m^2, shape (3, 3)."""
    return 0.5 * np.trace(matrix) * np.eye(3) - matrix


def possible(matrix: np.ndarray, mass: float, longest: float = math.inf
             ) -> tuple[np.ndarray, str]:
    """Return the nearest inertia that a body can have, and the fault of this one.

    Args:
        matrix: about the centre of mass, kg m^2, shape (3, 3), symmetric.
        mass: kg, above 0.
        longest: link of the robot, m.

    Returns:
        The inertia, that of a ball for a point or a giant, and '' where nothing was wrong but
        rounding.

    """
    sizes, axes = np.linalg.eigh(moments(matrix))
    # The square of the radius of gyration about a point.
    square = sizes.sum() / mass
    if not square > MIN_GYRATION**2:
        return ball(mass) * np.eye(3), 'is that of a point'
    if square > (MAX_GYRATION * longest)**2:
        return ball(mass) * np.eye(3), (
            f'needs parts {math.sqrt(square):.2g} m away, beside links of up to {longest:.2g} m')
    bounds = np.maximum(sizes, MIN_MOMENT * sizes.sum())
    if np.array_equal(bounds, sizes):
        return matrix, ''
    tensor = np.trace(np.diag(bounds)) * np.eye(3) - (axes * bounds) @ axes.T
    broken = sizes[0] < -MOMENT_TOLERANCE * sizes.sum()
    return tensor, 'breaks the triangle inequality (a + b >= c)' if broken else ''


def ball(mass: float) -> float:
    """Return the moment of inertia of a ball of DENSITY, kg m^2."""
    radius = (3.0 * mass / (4.0 * np.pi * DENSITY))**(1.0 / 3.0)
    return 0.4 * mass * radius**2


#: Names of an inertia's numbers in a URDF.
_INERTIA_KEYS = ('ixx', 'ixy', 'ixz', 'iyy', 'iyz', 'izz')
#: FRAME_INERTIA: negligible mass, kg, and moment of inertia, kg m^2, of a frame that has none.
FRAME_INERTIA = 1e-6, 1e-9
#: MASS_TOLERANCE: mass up to which a link has none, kg; CAD programs write rounding errors.
MASS_TOLERANCE = 1e-9
#: HOLLOW_DENSITY: density of the collision shapes of a robot without any mass, kg/m^3.
HOLLOW_DENSITY = 500.0
#: Types of joints. FIXED: the link is fixed to its parent; FLOATING: it moves freely.
FIXED, FLOATING = 'fixed', 'floating'

Say = Callable[[str], None]


def read_urdf(path: Path, driven: Collection[str], visual: bool, say: Say) -> Any:
    """Return a URDF as a ``mujoco.MjSpec`` whose joints are those that are driven.

    Args:
        path: the file.
        driven: names of joints; others that could move are held at 0.
        visual: keep meshes that are there for pictures only.
        say: takes what had to be changed, a line for each thing.

    Raises:
        DescriptionError: it cannot be read, or is no URDF.
        ValueError: MuJoCo's reason why it cannot be used.

    """
    import mujoco
    robot = read_tree(path)
    meshes = _Meshes(path, mesh_folder(robot))
    for link in robot.findall('link'):
        for part in (*link.findall('visual'), *link.findall('collision')):
            part.attrib.pop('name', None)  # MuJoCo would warn of equal ones
        if not visual:
            for part in link.findall('visual'):
                link.remove(part)
        meshes.prepare(link)
    for change in meshes.changes:
        say(change)
    _hold(robot, driven, say)
    weightless = not _weigh(robot, say)
    for tag in robot.findall('mujoco'):
        robot.remove(tag)
    ElementTree.SubElement(ElementTree.SubElement(robot, 'mujoco'), 'compiler', {
        'strippath': 'false', 'discardvisual': 'false', 'fusestatic': 'true'})
    spec = mujoco.MjSpec.from_string(ElementTree.tostring(robot, encoding='unicode'),
                                     assets=meshes.assets)
    if weightless:
        for geom in spec.geoms:
            geom.density = HOLLOW_DENSITY
    return spec


def part_touching(spec: Any, stand: Mapping[str, float]) -> None:
    """Exclude collisions between links that touch with all joints at 0 or in the stand.

    Convex hulls of neighbours overlap, and would be pressed apart. The ``mujoco.MjSpec`` is
    compiled for this; ``stand`` has angles in rad.
    """
    import mujoco
    model = spec.compile()
    data = mujoco.MjData(model)
    pairs = set()
    for angles in ({}, stand):
        for name, angle in angles.items():
            data.qpos[model.jnt_qposadr[model.joint(name).id]] = angle
        mujoco.mj_forward(model, data)
        for geoms in data.contact.geom[:data.ncon]:
            first, second = sorted(int(model.geom_bodyid[geom]) for geom in geoms)
            if first and first != second:
                pairs.add((model.body(first).name, model.body(second).name))
    for pair in sorted(pairs):
        spec.add_exclude(bodyname1=pair[0], bodyname2=pair[1])


class _Meshes:
    """Finds meshes, and replaces or removes those that MuJoCo cannot use.

    Attributes:
        assets: files that exist in memory only, by name.

    """

    def __init__(self, path: Path, folder: str) -> None:
        self._path, self._folder = path, folder
        self.assets: dict[str, bytes] = {}
        self._known: dict[tuple[str, str], tuple[str, str]] = {}
        self._changes: dict[str, dict[str, list[str]]] = {}

    def prepare(self, link: ElementTree.Element) -> None:
        """Put files that MuJoCo reads in place of a link's meshes, or take these away."""
        for kind in ('visual', 'collision'):
            for part in link.findall(kind):
                mesh = part.find('geometry/mesh')
                if mesh is None:
                    continue
                asked = mesh.get('filename', '')
                if (asked, kind) not in self._known:
                    self._known[asked, kind] = self._usable(asked, kind)
                name, said = self._known[asked, kind]
                if said:
                    meshes = self._changes.setdefault(said, {})
                    meshes.setdefault(Path(asked).name, []).append(link.get('name', ''))
                if name:
                    mesh.set('filename', name)
                else:
                    link.remove(part)

    @property
    def changes(self) -> list[str]:
        """Changes, one line for each kind, with meshes and their links."""
        return [f'{said}: ' + ', '.join(f'{mesh} ({" ".join(links)})'
                                        for mesh, links in meshes.items())
                for said, meshes in self._changes.items()]

    def _usable(self, reference: str, kind: str) -> tuple[str, str]:
        """Return a name for MuJoCo, '' where there is none, and the change to report."""
        lost = 'nothing can touch' if kind == 'collision' else 'pictures go without'
        try:
            path = find_mesh(reference, self._path, self._folder)
        except MeshError:
            return '', f'meshes are not found, {lost} them'
        try:
            with files.opened(path, MeshError):
                why = trouble(path)
        except MeshError as error:
            return '', f'{error}: {lost} meshes'
        if not why:
            return str(path.resolve()), ''
        if kind == 'collision':
            try:
                name = f'{len(self.assets)}_{path.stem}.msh'
                self.assets[name] = hull(path)
                return name, f'{why}, convex hulls take the place of meshes'
            except MeshError as error:
                why = str(error).removeprefix(f'{path}: ')
        return '', f'{why}, {lost} meshes'


def _hold(robot: ElementTree.Element, driven: Collection[str], say: Say) -> None:
    """Fix joints that nothing drives."""
    fixed_joints = []
    for joint in robot.findall('joint'):
        if joint.get('name') not in driven and joint.get('type') not in (FIXED, FLOATING):
            joint.set('type', FIXED)
            fixed_joints.append(joint.get('name', ''))
    if fixed_joints:
        say(f'joints that the robot file does not drive are held at 0: {", ".join(fixed_joints)}')


def _weigh(robot: ElementTree.Element, say: Say) -> float:
    """Give each link a mass and an inertia that a body can have; return the total before."""
    moved = {child.get('link') for joint in robot.findall('joint')
             if joint.get('type') != FIXED and (child := joint.find('child')) is not None}
    links = {link.get('name', ''): link for link in robot.findall('link')}
    masses = {name: _mass(link) for name, link in links.items()}
    total = sum(masses.values())
    if not total:
        say('no link has a mass: they get those of their collision shapes at '
            f'{HOLLOW_DENSITY:g} kg/m^3')
    longest = max((float(np.linalg.norm(numbers(origin.get('xyz', ''), 3)))
                   for origin in robot.iterfind('joint/origin')), default=0.0)
    repaired: dict[tuple[str, str], list[str]] = {}
    for name, mass in masses.items():
        link, inertial = links[name], links[name].find('inertial')
        if mass and inertial is not None:
            inertia, wrong = possible(_inertia(inertial), mass, longest or math.inf)
            if wrong:
                made_text = ', '.join(f'{key} {value:.3g}' for key, value in
                                    zip(_INERTIA_KEYS, inertia[np.triu_indices(3)], strict=True))
                repaired.setdefault((wrong, made_text), []).append(name)
            _write(inertial, mass, inertia)
            continue
        # As the format has it, no <inertial> means none; MuJoCo would take the shapes'.
        if inertial is not None:
            link.remove(inertial)
        if not total and link.find('collision') is not None:
            continue
        mass, moment = FRAME_INERTIA
        if name in moved and not _carries(robot, name, masses):
            mass = max(MIN_MASS_FRACTION * total, MIN_MASS)
            moment = ball(mass)
            say(f"link '{name}': has no mass, but a joint moves it; it gets {mass:.3g} kg")
        _write(ElementTree.SubElement(link, 'inertial'), mass, moment * np.eye(3))
    for (wrong, made_text), names in repaired.items():
        say(f"link '{names[0]}': its inertia {wrong}; it gets {made_text} kg m^2"
            + (f', and so do {", ".join(names[1:])}' if names[1:] else ''))
    return total


def _carries(robot: ElementTree.Element, name: str, masses: dict[str, float]) -> bool:
    """Return whether links with mass are fixed to a link."""
    below = [child.get('link', '') for joint in robot.findall('joint')
             if joint.get('type') == FIXED and (parent := joint.find('parent')) is not None
             and parent.get('link') == name and (child := joint.find('child')) is not None]
    return any(masses.get(link, 0.0) > 0.0 or _carries(robot, link, masses) for link in below)


def _mass(link: ElementTree.Element) -> float:
    """Return a link's mass in kg, 0 where it is nothing."""
    element = link.find('inertial/mass')
    mass = 0.0 if element is None else sum(numbers(element.get('value', '0'), 1))
    return mass if mass > MASS_TOLERANCE else 0.0


def _inertia(inertial: ElementTree.Element) -> np.ndarray:
    element = inertial.find('inertia')
    xx, xy, xz, yy, yz, zz = (0.0 if element is None else sum(numbers(element.get(key, '0'), 1))
                              for key in _INERTIA_KEYS)
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def _write(inertial: ElementTree.Element, mass: float, matrix: np.ndarray) -> None:
    for tag in ('mass', 'inertia'):
        for part in inertial.findall(tag):
            inertial.remove(part)
    ElementTree.SubElement(inertial, 'mass', value=repr(float(mass)))
    ElementTree.SubElement(inertial, 'inertia', {
        key: repr(float(value)) for key, value in
        zip(_INERTIA_KEYS, matrix[np.triu_indices(3)], strict=True)})


# A model as URDF, for the topic ``robot_description``.

def to_urdf(model: Any, name: str, frame: str, velocities: Mapping[str, float]) -> str:
    """Return the moving bodies of a model as URDF; a mesh becomes the box around it.

    Args:
        model: ``mujoco.MjModel``, whose first free joint is that of the robot's base.
        name: of the robot.
        frame: of the base, the root of the URDF.
        velocities: largest speed of each joint, rad/s.

    """
    import mujoco
    kinds = mujoco.mjtJoint
    base = int(model.jnt_bodyid[np.flatnonzero(model.jnt_type == kinds.mjJNT_FREE)[0]])
    effort = dict(zip(model.actuator_trnid[:, 0].tolist(), model.actuator_forcerange[:, 1],
                      strict=True))
    robot = ElementTree.Element('robot', name=name)
    # Body -> its link, and the origin of that link in the body's frame.
    links: dict[int, tuple[str, np.ndarray]] = {}
    for body in range(base, model.nbody):
        above = links.get(int(model.body_parentid[body]))
        if above is None and body != base:
            continue
        own = model.body(body).name or f'body_{body}'
        first, count = model.body_jntadr[body], model.body_jntnum[body]
        joints = range(first, first + count) if above else ()
        parent, at = above or ('', np.zeros(3))
        place, turn = model.body_pos[body] - at, matrix_of(model.body_quat[body])
        at = np.zeros(3)
        for k in joints:
            axis, angle = model.jnt_axis[k], float(model.qpos0[model.jnt_qposadr[k]])
            place, at = place + turn @ (model.jnt_pos[k] - at), model.jnt_pos[k]
            slides = model.jnt_type[k] == kinds.mjJNT_SLIDE
            link = own if k == first + count - 1 else f'{own}_{k}'
            joint = _joined(robot, model.joint(k).name, parent, link, (
                place - angle * turn @ axis, turn) if slides else (
                    place, turn @ rotation_about(axis, -angle)))
            bounded = bool(model.jnt_limited[k])
            joint.set('type', 'prismatic' if slides else 'revolute' if bounded else 'continuous')
            ElementTree.SubElement(joint, 'axis', xyz=_text(axis))
            low, high = model.jnt_range[k] if bounded else (0.0, 0.0)
            ElementTree.SubElement(joint, 'limit', lower=f'{low:.6g}', upper=f'{high:.6g}',
                                   effort=f'{effort.get(k, 0.0):.6g}',
                                   velocity=f'{velocities.get(model.joint(k).name, 0.0):.6g}')
            if not bounded and not slides:
                for bound in ('lower', 'upper'):
                    del joint[-1].attrib[bound]
            parent, place, turn = link, np.zeros(3), np.eye(3)
        if above and not count:
            _joined(robot, f'{own}_joint', parent, own, (place, turn))
        links[body] = own, at
        _fill(robot, model, body, links[body])
    return rooted(robot, frame)


def rooted(robot: ElementTree.Element, frame: str) -> str:
    """Return a URDF as text, with a link named ``frame`` above its root unless that is the root.

    The link has no mass, as the KDL library asks of a root.
    """
    moved = {child.get('link') for child in robot.iterfind('joint/child')}
    root = next((link.get('name', '') for link in robot.iterfind('link')
                 if link.get('name') not in moved), frame)
    if root != frame:
        ElementTree.SubElement(robot, 'link', name=frame)
        _joined(robot, f'{root}_root', frame, root, (np.zeros(3), np.eye(3)))
    ElementTree.indent(robot)
    return ElementTree.tostring(robot, encoding='unicode')


def _text(numbers_: np.ndarray) -> str:
    return ' '.join(f'{number:.9g}' for number in numbers_)


def _origin(element: ElementTree.Element, place: np.ndarray, turn: np.ndarray) -> None:
    import mujoco
    quaternion = np.zeros(4)
    mujoco.mju_mat2Quat(quaternion, np.ascontiguousarray(turn).ravel())
    ElementTree.SubElement(element, 'origin', xyz=_text(place), rpy=_text(rpy_of(quaternion)))


def _joined(robot: ElementTree.Element, name: str, parent: str, child: str,
            pose: tuple[np.ndarray, np.ndarray]) -> ElementTree.Element:
    """Add a fixed joint; return it."""
    joint = ElementTree.SubElement(robot, 'joint', name=name, type='fixed')
    _origin(joint, *pose)
    ElementTree.SubElement(joint, 'parent', link=parent)
    ElementTree.SubElement(joint, 'child', link=child)
    return joint


def _fill(robot: ElementTree.Element, model: Any, body: int, link: tuple[str, np.ndarray]) -> None:
    """Add a body's link, with mass and shapes, and the empty links of its further joints."""
    own, at = link
    link_names = {one.get('name') for one in robot.iterfind('link')}
    for child in robot.findall('joint/child'):
        if (name := child.get('link')) not in link_names and name != own:
            ElementTree.SubElement(robot, 'link', name=name or '')
    element = ElementTree.SubElement(robot, 'link', name=own)
    if model.body_mass[body]:
        inertial = ElementTree.SubElement(element, 'inertial')
        _origin(inertial, model.body_ipos[body] - at, matrix_of(model.body_iquat[body]))
        ElementTree.SubElement(inertial, 'mass', value=f'{model.body_mass[body]:.9g}')
        x, y, z = (f'{value:.9g}' for value in model.body_inertia[body])
        ElementTree.SubElement(inertial, 'inertia', ixx=x, iyy=y, izz=z, ixy='0', ixz='0', iyz='0')
    first = model.body_geomadr[body]
    for k in range(first, first + model.body_geomnum[body]):
        for tag in ('visual', 'collision'):
            for place, turn, kind, sizes in _solids(model, k):
                part = ElementTree.SubElement(element, tag)
                _origin(part, place - at, turn)
                ElementTree.SubElement(ElementTree.SubElement(part, 'geometry'), kind, sizes)


def _solids(model: Any, k: int) -> list[tuple[np.ndarray, np.ndarray, str, dict[str, str]]]:
    """Return position, axes, kind and sizes of the URDF solids of a geom, in its body's frame."""
    import mujoco
    kind, turn = mujoco.mjtGeom(model.geom_type[k]).name, matrix_of(model.geom_quat[k])
    place, size = model.geom_pos[k], model.geom_size[k]
    ball = {'radius': f'{size[0]:.6g}'}
    if kind == 'mjGEOM_SPHERE':
        return [(place, turn, 'sphere', ball)]
    if kind in ('mjGEOM_CYLINDER', 'mjGEOM_CAPSULE'):
        solids = [(place, turn, 'cylinder', {**ball, 'length': f'{2.0 * size[1]:.6g}'})]
        if kind == 'mjGEOM_CAPSULE':
            solids += [(place + end * size[1] * turn[:, 2], turn, 'sphere', ball)
                       for end in (-1.0, 1.0)]
        return solids
    # The box around all else.
    middle, half = model.geom_aabb[k].reshape(2, 3)
    return [(place + turn @ middle, turn, 'box', {'size': _text(2.0 * half)})]

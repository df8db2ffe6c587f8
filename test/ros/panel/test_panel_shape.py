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

"""The shapes that the panel draws: where their links are, and what they are made of."""

import base64
import struct

import numpy as np
import pytest

pytest.importorskip('websockets')

from cpg_ros.common.files import resource_folder  # noqa: E402, I100
from cpg_ros.motion.meshes import Mesh, MeshError, read_mesh  # noqa: E402
from cpg_ros.motion.robot_file import load_robot  # noqa: E402
from cpg_ros.ros.panel import shape as shapes  # noqa: E402


def worlds(shape, angles):
    """Frames of all links, (4, 4), with the base at the origin, as a page works them out."""
    found = []
    for link in shape.links:
        own, turn = np.eye(4), np.eye(4)
        own[:3, :3], own[:3, 3] = link.pose, link.position
        x, y, z = link.axis
        cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        angle = angles.get(link.joint, 0.0)
        turn[:3, :3] = (np.eye(3) + np.sin(angle) * cross
                        + (1 - np.cos(angle)) * cross @ cross) if link.joint else np.eye(3)
        above = np.eye(4) if link.parent < 0 else found[link.parent]
        found.append(above @ own @ turn)
    return found


@pytest.mark.parametrize(('robot', 'model'), [('unitree_go2', 'go2'), ('unitree_go2', 'aliengo'),
                                              ('quadruped', '')])
def test_links_are_where_mujoco_has_them(robot, model):
    mujoco = pytest.importorskip('mujoco')
    robot_file = load_robot(robot)
    said = []
    shape = shapes.find(shapes.RobotInfo(robot=robot, model=model), said.append)
    assert not said
    from cpg_ros.simulation.robot_model import load
    physics = load(model or str(resource_folder('urdf') / 'quadruped.urdf'), robot_file)
    data = mujoco.MjData(physics)
    random = np.random.default_rng(1)
    angles = {joint.name: random.uniform(joint.lower, joint.upper) for joint in robot_file.joints}
    data.qpos[:7] = 0, 0, 0, 1, 0, 0, 0
    for name, angle in angles.items():
        data.qpos[physics.joint(name).qposadr[0]] = angle
    mujoco.mj_kinematics(physics, data)
    found = worlds(shape, angles)
    for name in angles:
        body = physics.joint(name).bodyid[0]
        k = next(k for k, link in enumerate(shape.links) if link.joint == name)
        # MuJoCo merges links that are fixed to one another; a joint's own it never moves.
        np.testing.assert_allclose(found[k][:3, 3], data.xpos[body], atol=1e-6)
        np.testing.assert_allclose(found[k][:3, :3].ravel(), data.xmat[body], atol=1e-6)
    assert set(shape.feet) == set(robot_file.legs)


def volume(triangles):
    return abs(np.einsum('ij,ij->i', triangles[:, 0],
                         np.cross(triangles[:, 1], triangles[:, 2])).sum()) / 6.0


def drawn_mesh(part):
    """Triangles of a part's mesh in its link, shape (n, 3, 3)."""
    return part.corners[part.mesh.triangles]


@pytest.mark.parametrize(('kind', 'size', 'half'), [
    ('cylinder', [0.5, 1.0], [0.5, 0.5, 1.0]), ('capsule', [0.5, 1.0], [0.5, 0.5, 1.5]),
    ('sphere', [0.5], [0.5] * 3), ('ellipsoid', [1.0, 2.0, 3.0], [1.0, 2.0, 3.0]),
    ('box', [1.0, 2.0, 3.0], [1.0, 2.0, 3.0])])
def test_corners_enclose_solids(kind, size, half):
    corners = shapes.Part(kind, np.array(size)).corners
    np.testing.assert_allclose(corners.max(axis=0), half)
    np.testing.assert_allclose(corners.min(axis=0), -np.array(half))


def test_a_stick_lies_between_its_ends():
    stick = shapes.along(np.array([1.0, 0.0, 0.0]), np.array([1.0, 2.0, 0.0]), 0.1, (1, 1, 1))
    np.testing.assert_allclose(stick.corners.min(axis=0), [0.9, -0.1, -0.1], atol=1e-9)
    np.testing.assert_allclose(stick.corners.max(axis=0), [1.1, 2.1, 0.1], atol=1e-9)


def test_a_page_gets_a_mesh_with_shared_vertices_to_a_65535th_of_its_size():
    """And a mesh of more triangles than a page draws becomes coarser."""
    mesh = shapes.drawable(Mesh(TETRAHEDRON.reshape(-1, 3), np.arange(12).reshape(-1, 3)))
    assert len(mesh.points) == 4
    message = shapes.Part('mesh', np.zeros(0), mesh).message()
    steps = np.frombuffer(base64.b64decode(message['points']), '<u2').reshape(-1, 3)
    corners = np.frombuffer(base64.b64decode(message['triangles']), '<u4').reshape(-1, 3)
    found = (message['low'] + message['step'] * steps)[corners]
    np.testing.assert_allclose(found, TETRAHEDRON, atol=1.0 / 65535)
    side = np.arange(200) / 1000.0  # a sheet of 0.2 m with 79,202 triangles, 1 mm wide
    x, y = np.meshgrid(side, side, indexing='ij')
    k = (200 * np.arange(199)[:, None] + np.arange(199)).reshape(-1)
    sheet = Mesh(np.stack([x, y, 0.0 * x], -1).reshape(-1, 3), np.concatenate([
        np.stack([k, k + 1, k + 200], -1), np.stack([k + 1, k + 201, k + 200], -1)]))
    drawn = shapes.drawable(sheet)
    assert 10_000 < len(drawn.triangles) <= shapes.MAX_MESH_TRIANGLES
    np.testing.assert_allclose(np.ptp(drawn.points, axis=0), [0.199, 0.199, 0.0], atol=0.004)


TETRAHEDRON = np.array([[[0, 0, 0], [0, 1, 0], [1, 0, 0]], [[0, 0, 0], [1, 0, 0], [0, 0, 1]],
                        [[0, 0, 0], [0, 0, 1], [0, 1, 0]], [[1, 0, 0], [0, 1, 0], [0, 0, 1]]],
                       float)


def binary_stl(triangles):
    rows = b''.join(struct.pack('<12fH', 0, 0, 0, *one.ravel(), 0) for one in triangles)
    return bytes(80) + struct.pack('<I', len(triangles)) + rows


def text_stl(triangles):
    lines = [f'vertex {x} {y} {z}' for one in triangles for x, y, z in one]
    return ('solid s\n' + '\n'.join(lines) + '\nendsolid s').encode()


OBJ = b'v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1/1 2/2 4/3\nf -4//1 -1//1 -2//1\nf 2 3 4\n'


@pytest.mark.parametrize(('name', 'data'), [
    ('a.stl', binary_stl(TETRAHEDRON)), ('a.STL', text_stl(TETRAHEDRON)), ('a.obj', OBJ)])
def test_mesh_files(tmp_path, name, data):
    (tmp_path / name).write_bytes(data)
    mesh = read_mesh(tmp_path / name)
    found = mesh.points[mesh.triangles]
    np.testing.assert_allclose(found, TETRAHEDRON)
    assert volume(found) == pytest.approx(1 / 6)


@pytest.mark.parametrize(('name', 'data', 'said'), [
    ('a.ply', b'', 'none of .stl, .obj and .dae'), ('a.obj', b'f 1 2 3', 'a.obj'),
    ('a.dae', b'', 'no element found'),
    ('a.obj', b'v 1 x 3', 'a.obj'), ('a.stl', text_stl(TETRAHEDRON * np.nan), 'not finite'),
    ('a.obj', None, 'No such file')])
def test_meshes_that_cannot_be_read(tmp_path, name, data, said):
    if data is not None:
        (tmp_path / name).write_bytes(data)
    with pytest.raises(MeshError, match=said):
        read_mesh(tmp_path / name)


URDF = """<robot name="one"><link name="base"><visual><geometry><mesh filename="{mesh}"
  scale="0.5 0.5 0.5"/></geometry></visual><visual><geometry><mesh filename="package://no/x.stl"/>
  </geometry></visual></link><link name="arm"/><joint name="shoulder" type="revolute"><parent
  link="base"/><child link="arm"/><limit lower="-1" upper="2" velocity="3"/></joint></robot>"""


def test_a_urdf_with_meshes_of_which_one_is_missing(tmp_path):
    (tmp_path / 'part.stl').write_bytes(binary_stl(TETRAHEDRON))
    path = tmp_path / 'one.urdf'
    path.write_text(URDF.format(mesh='part.stl'))
    said = []
    shape = shapes.from_file(path, said.append)
    assert len(said) == 1 and 'neither an installed package nor a folder above' in said[0]
    (drawn,) = shape.links[0].parts
    assert volume(drawn_mesh(drawn)) == pytest.approx(1 / 48)
    assert shape.limits == {'shoulder': (-1.0, 2.0)}


def collada(kind, corners, counts=()):
    """A tetrahedron in cm, its scene shifted by 3 cm along z, with normals between the corners."""
    numbers = ' '.join(f'{100 * value:g}' for value in (0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1))
    words = ' '.join(f'{corner} 0' for corner in corners)
    number = f'<vcount>{" ".join(map(str, counts))}</vcount>' if counts else ''
    return f"""<c:COLLADA xmlns:c="x"><c:asset><c:unit meter="0.01"/><c:up_axis>Z_UP</c:up_axis>
      </c:asset><geometry id="g"><mesh><source id="p"><float_array>{numbers}</float_array></source>
      <vertices id="v"><input semantic="POSITION" source="#p"/></vertices><{kind}>
      <input semantic="VERTEX" source="#v" offset="0"/><input semantic="NORMAL" source="#n"
      offset="1"/>{number}<p>{words}</p></{kind}></mesh></geometry><visual_scene><node>
      <translate>0 0 3</translate><instance_geometry url="#g"/></node></visual_scene>
      </c:COLLADA>"""


@pytest.mark.parametrize('text', [
    collada('triangles', [0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3]),
    collada('polylist', [0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3], [3, 3, 3, 3]),
    # Two triangles as one polygon that is bent.
    collada('polylist', [1, 0, 2, 3, 0, 1, 3, 0, 3, 2], [4, 3, 3]),
    collada('polygons', [0, 2, 1])])
def test_collada_is_drawn(tmp_path, text):
    (tmp_path / 'part.dae').write_text(text)
    path = tmp_path / 'one.urdf'
    path.write_text(URDF.format(mesh='part.dae'))
    shape = shapes.from_file(path, str)
    drawn = drawn_mesh(shape.links[0].parts[0])
    np.testing.assert_allclose(drawn.min((0, 1)), [0, 0, 0.015])
    if 'polygons' not in text:
        assert len(drawn) == 4
        np.testing.assert_allclose(drawn.max((0, 1)), [0.5, 0.5, 0.515])


@pytest.mark.parametrize('place', ['arm_pkg/meshes', 'clone/meshes', 'prefix/share/arm_pkg/meshes',
                                   'ros/arm_pkg/meshes', 'urdf/geometry'])
def test_the_panel_and_robot_sim_find_the_same_meshes(tmp_path, monkeypatch, place):
    pytest.importorskip('mujoco')
    from cpg_ros.simulation.robot_model import load
    from four_legs import ROBOT, urdf
    folder = tmp_path / place
    folder.mkdir(parents=True)
    (folder / 'part.stl').write_bytes(binary_stl(TETRAHEDRON))
    if place.startswith('clone'):
        (tmp_path / 'clone' / 'package.xml').write_text('<package><name>arm_pkg</name></package>')
    monkeypatch.setenv('AMENT_PREFIX_PATH', str(tmp_path / 'prefix'))
    monkeypatch.setenv('ROS_PACKAGE_PATH', str(tmp_path / 'ros'))
    at = tmp_path / place.partition('/')[0] / 'urdf'
    if place.startswith('urdf'):
        at = tmp_path / 'urdf'
    at.mkdir(exist_ok=True)
    path = at / 'own.urdf'
    urdf(path)
    mesh = 'part.stl' if place.startswith('urdf') else 'package://arm_pkg/meshes/part.stl'
    compiler = '<mujoco><compiler meshdir="geometry"/></mujoco>' if mesh == 'part.stl' else ''
    path.write_text(path.read_text().replace('</link>', (
        f'<visual><geometry><mesh filename="{mesh}"/></geometry></visual></link>{compiler}'), 1))
    said = []
    model = load(str(path), ROBOT, visual=True, say=said.append)
    assert model.nmesh == 1 and not said
    shape = shapes.from_file(path, said.append)
    assert not said and any(
        part.mesh and len(part.mesh.triangles) == 4 for link in shape.links for part in link.parts)
    # Anybody on the graph may name files of installed packages only.
    shapes.from_text(path.read_text(), 'robot_description', said.append)
    assert len(said) == 1 and 'installed packages only' in said[0]


@pytest.fixture
def installed(tmp_path, monkeypatch):
    """Return the fraction folder of a package that is installed, and the package's sources."""
    prefix, sources = tmp_path / 'prefix', tmp_path / 'src' / 'arm_description'
    index = prefix / 'share' / 'ament_index' / 'resource_index' / 'packages'
    shared = prefix / 'share' / 'arm_description'
    for folder in (index, shared, sources):
        folder.mkdir(parents=True)
    (index / 'arm_description').touch()
    (sources / 'package.xml').write_text('<package><name>arm_description</name></package>')
    (sources / 'linked.stl').write_bytes(binary_stl(TETRAHEDRON))
    (tmp_path / 'secret.stl').write_bytes(binary_stl(TETRAHEDRON))
    (shared / 'own.stl').write_bytes(binary_stl(TETRAHEDRON))
    # As colcon build --symlink-install does, and as it does not.
    (shared / 'linked.stl').symlink_to(sources / 'linked.stl')
    (shared / 'astray.stl').symlink_to(tmp_path / 'secret.stl')
    monkeypatch.setenv('AMENT_PREFIX_PATH', str(prefix))
    return shared


@pytest.mark.parametrize(('name', 'drawn'), [
    ('package://arm_description/own.stl', True), ('package://arm_description/linked.stl', True),
    ('file://{shared}/own.stl', True), ('{shared}/own.stl', True), ('own.stl', False),
    ('package://arm_description/astray.stl', False), ('file://{shared}/astray.stl', False),
    ('package://arm_description/../../../secret.stl', False), ('package://../secret.stl', False),
    ('package://arm_description/%2e%2e/%2e%2e/%2e%2e/secret.stl', False),
    ('file://{shared}/../../../secret.stl', False), ('package://arm_description/%00', False)])
def test_a_description_draws_meshes_of_installed_packages_only(installed, name, drawn):
    said = []
    text = URDF.format(mesh=name.format(shared=installed))
    shape = shapes.from_text(text, 'robot_description', said.append)
    assert len(said) == 1 and ('1 more like it' in said[0]) is not drawn
    assert any(part.mesh for part in shape.links[0].parts) is drawn


def test_links_without_their_meshes_are_drawn_by_collision_shapes_or_as_boxes():
    """And one line says so; links that have no pictures are frames, and stay undrawn."""
    text = URDF.format(mesh='lost.stl').replace('</visual></link>', (
        '</visual><collision><origin xyz="0 0 1"/><geometry><box size="1 2 3"/></geometry>'
        '</collision></link>')).replace('<link name="arm"/>', (
            '<link name="arm"><visual><geometry><mesh filename="package://no/y.stl"/></geometry>'
            '</visual></link><link name="hand"/><joint name="wrist" type="fixed"><parent '
            'link="arm"/><child link="hand"/><origin xyz="0.4 0 0"/></joint>'))
    said = []
    base, arm, hand = shapes.from_text(text, 'robot_description', said.append).links
    corners = base.parts[0].corners
    assert np.ptp(corners, axis=0) == pytest.approx([1.0, 2.0, 3.0])
    assert corners.mean(axis=0) == pytest.approx([0.0, 0.0, 1.0])
    # Over the joints below.
    assert arm.corners[:, 0].max() == pytest.approx(0.4)
    assert not hand.parts and len(said) == 1
    assert said[0].endswith('; drawn by their collision shapes or as boxes: base, arm')


def test_a_robot_without_visual_shapes_is_drawn_by_its_collision_shapes():
    text = URDF.replace('visual>', 'collision>').replace(
        '<mesh filename="{mesh}"\n  scale="0.5 0.5 0.5"/>', '<box size="1 2 3"/>')
    said = []
    base, arm = shapes.from_text(text, 'robot_description', said.append).links
    assert np.ptp(base.corners, axis=0) == pytest.approx([1.0, 2.0, 3.0]) and not arm.parts
    assert said[0] == ('drawn by its collision shapes: URDF robot_description has no visual ones')
    assert 'package://no/x.stl' in said[1]


def test_the_users_urdf_comes_first_and_what_is_wrong_with_it_is_said(tmp_path):
    (tmp_path / 'bad.urdf').write_text('<sdf/>')
    said = []
    shape = shapes.find(shapes.RobotInfo(urdf=str(tmp_path / 'bad.urdf'),
                                                     robot='goat'),
                              said.append)
    assert 'this is not a URDF' in said[0] and shape.source == "stick figure of 'goat'"
    text = (resource_folder('urdf') / 'quadruped.urdf').read_text()
    shape = shapes.find(shapes.RobotInfo(description=text, robot='goat'), said.append)
    assert shape.source == 'robot_description' and shape.feet == {}


def test_a_stick_figure_of_what_topics_alone_tell():
    shape = shapes.find(shapes.RobotInfo(
        robot='/another/machine.yaml', legs={'lh': ['a', 'b', 'c'], 'rf': ['d', 'e']}), str)
    standing = worlds(shape, {})
    heights = []
    for leg, ahead, left in (('lh', -1, 1), ('rf', 1, -1)):
        link, place = shape.feet[leg]
        foot = standing[link] @ [*place, 1.0]
        assert np.sign(foot[:2]).tolist() == [ahead, left]
        heights.append(foot[2])
    np.testing.assert_allclose(heights, -shapes.LEG_LENGTH)
    message = shape.message()
    assert message['type'] == 'shape' and len(message['links']) == 6

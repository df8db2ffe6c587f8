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

"""URDF files as ROS has them: packages, meshes and masses, each defect in a made-up robot."""

from pathlib import Path
import re
import struct

from depth import examples
from four_legs import ROBOT, stood, urdf
from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest

mujoco = pytest.importorskip('mujoco')

from cpg_ros.motion.description import load_urdf  # noqa: E402, I100
from cpg_ros.simulation.body import Body  # noqa: E402
from cpg_ros.simulation.robot_model import load, usual_gains  # noqa: E402
from cpg_ros.simulation.urdf_model import possible  # noqa: E402

#: A box of 0.2 x 0.1 x 0.06 m: its corners, and the triangles of its faces.
BOX = np.array([[x, y, z] for x in (-0.1, 0.1) for y in (-0.05, 0.05) for z in (-0.03, 0.03)])
FACES = [(0, 1, 3), (0, 3, 2), (4, 6, 7), (4, 7, 5), (0, 4, 5), (0, 5, 1),
         (2, 3, 7), (2, 7, 6), (0, 2, 6), (0, 6, 4), (1, 5, 7), (1, 7, 3)]
COLLADA = """<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema"><asset>
<unit name="millimeter" meter="0.001"/><up_axis>{up}</up_axis></asset>
<library_geometries><geometry id="box"><mesh><source id="p"><float_array id="pa" count="24">
{numbers}</float_array></source><vertices id="v"><input semantic="POSITION" source="#p"/>
</vertices></mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="s"><node>
<translate>0 0 5</translate><rotate>0 0 1 90</rotate><instance_geometry url="#box"/></node>
</visual_scene></library_visual_scenes></COLLADA>"""


def binary_stl(path):
    facets = b''.join(struct.pack('<12fH', 0, 0, 0, *BOX[list(face)].ravel(), 0) for face in FACES)
    path.write_bytes(bytes(80) + struct.pack('<I', len(FACES)) + facets)


def ascii_stl(path):
    facets = ''.join('facet normal 0 0 0\nouter loop\n' + ''.join(
        'vertex {} {} {}\n'.format(*BOX[k]) for k in face) + 'endloop\nendfacet\n'
        for face in FACES)
    path.write_text(f'solid box\n{facets}endsolid box\n')


def robot_with(folder, mesh, kind='collision'):
    """Write the made-up robot with a mesh on its base, 0.1 m above its middle."""
    folder.mkdir(parents=True, exist_ok=True)
    path = Path(urdf(folder / 'own.urdf'))
    part = (f'<{kind}><origin xyz="0 0 0.1"/><geometry><mesh filename="{mesh}" scale="1 1 1"/>'
            f'</geometry></{kind}></link>')
    path.write_text(path.read_text().replace('</link>', part, 1))
    return path


def loaded(path, **options):
    said = []
    return load(str(path), ROBOT, say=said.append, **options), said


def extent(model):
    """Corners of the only mesh about its link, smallest and largest, m."""
    (geom,) = np.flatnonzero(model.geom_type == mujoco.mjtGeom.mjGEOM_MESH)
    turn = np.zeros(9)
    mujoco.mju_quat2Mat(turn, model.geom_quat[geom])
    mesh = model.geom_dataid[geom]
    points = model.mesh_vert[model.mesh_vertadr[mesh]:][:model.mesh_vertnum[mesh]]
    points = points @ turn.reshape(3, 3).T + model.geom_pos[geom] - [0.0, 0.0, 0.1]
    return np.stack([points.min(axis=0), points.max(axis=0)])


SIZE = [BOX.min(axis=0), BOX.max(axis=0)]


@pytest.mark.parametrize('place', ['own_pkg/meshes', 'clone/meshes', 'ament/share/own_pkg/meshes'])
def test_packages_are_found_above_the_urdf_by_name_and_by_ament(tmp_path, monkeypatch, place):
    (tmp_path / place).mkdir(parents=True)
    binary_stl(tmp_path / place / 'my box.stl')
    at = tmp_path / place.partition('/')[0] / 'urdf'
    if place.startswith('clone'):
        (tmp_path / 'clone' / 'package.xml').write_text('<package><name>own_pkg</name></package>')
    if place.startswith('ament'):
        monkeypatch.setenv('AMENT_PREFIX_PATH', f'/nowhere:{tmp_path / "ament"}')
        at = tmp_path / 'elsewhere'
    model, said = loaded(robot_with(at, 'package://own_pkg/meshes/my%20box.stl'))
    assert extent(model) == pytest.approx(np.array(SIZE), abs=1e-6) and not said


@pytest.mark.parametrize('reference', ['../meshes/box.stl', 'file://{}/meshes/box.stl'])
def test_meshes_by_path(tmp_path, reference):
    (tmp_path / 'meshes').mkdir()
    binary_stl(tmp_path / 'meshes' / 'box.stl')
    model, said = loaded(robot_with(tmp_path / 'urdf', reference.format(tmp_path)))
    assert extent(model) == pytest.approx(np.array(SIZE), abs=1e-6) and not said


def test_a_hull_takes_the_place_of_a_shape_in_ascii_stl(tmp_path):
    path = robot_with(tmp_path, 'box.stl')
    ascii_stl(tmp_path / 'box.stl')
    model, said = loaded(path)
    assert extent(model) == pytest.approx(np.array(SIZE), abs=1e-6)
    assert len(said) == 1 and 'convex hulls take the place of meshes: box.stl (base)' in said[0]


@pytest.mark.parametrize('up', ['Z_UP', 'Y_UP'])
def test_a_hull_takes_the_place_of_a_shape_in_collada(tmp_path, up):
    """Millimetres, moved up by 5 mm and turned by a quarter about the scene's z."""
    path = robot_with(tmp_path, 'box.dae')
    numbers = ' '.join(f'{1000 * value:g}' for value in BOX.ravel())
    (tmp_path / 'box.dae').write_text(COLLADA.format(up=up, numbers=numbers))
    model, said = loaded(path)
    half, middle = np.array([0.05, 0.1, 0.03]), np.array([0.0, 0.0, 0.005])
    if up == 'Y_UP':
        # The scene's y is up: x stays, z comes out of -y.
        half, middle = half[[0, 2, 1]], np.array([0.0, -0.005, 0.0])
    assert extent(model) == pytest.approx(np.stack([middle - half, middle + half]), abs=1e-6)
    assert 'MuJoCo does not read .dae' in said[0]


@pytest.mark.parametrize(('kind', 'visual', 'words'), [
    ('visual', True, 'pictures go without meshes: box.dae (base)'),
    ('visual', False, ''),
    ('collision', False, 'nothing can touch meshes: box.dae (base)')])
def test_meshes_that_cannot_be_read_are_left_out_with_a_note(tmp_path, kind, visual, words):
    path = robot_with(tmp_path, 'box.dae', kind)
    (tmp_path / 'box.dae').write_text('<COLLADA/>')
    model, said = loaded(path, visual=visual)
    assert not (model.geom_type == mujoco.mjtGeom.mjGEOM_MESH).any()
    assert ' '.join(said) == '' if not words else words in said[0]


def test_meshes_that_are_nowhere(tmp_path):
    _, said = loaded(robot_with(tmp_path, 'package://lost/box.stl'))
    assert said == ['meshes are not found, nothing can touch them: box.stl (base)']


def inertial(mass, inertia=(0.0, 0.0, 0.0)):
    return ('<inertial><mass value="{}"/><inertia ixx="{}" iyy="{}" izz="{}" ixy="0" ixz="0" '
            'iyz="0"/></inertial>').format(mass, *inertia)


def changed(tmp_path, link, instead):
    """Write the made-up robot with another inertial of a link."""
    path = Path(urdf(tmp_path / 'own.urdf'))
    text, count = re.subn(rf'(<link name="{link}">)<inertial>.*?</inertial>', rf'\1{instead}',
                          path.read_text(), flags=re.DOTALL)
    assert count == 1
    path.write_text(text)
    return path


@pytest.mark.parametrize('instead', ['', inertial(0.0), inertial(4e-15, (1e-27, 1e-27, 1e-27))])
def test_a_link_without_mass_gets_some_where_a_joint_moves_it(tmp_path, instead):
    model, said = loaded(changed(tmp_path, 'FL_thigh', instead))
    # A thousandth of 10.5 kg.
    assert model.body_mass[model.body('FL_thigh').id] == pytest.approx(0.0105)
    assert said == ["link 'FL_thigh': has no mass, but a joint moves it; it gets 0.0105 kg"]


def test_a_frame_without_mass_hangs_on_its_link(tmp_path):
    path = Path(urdf(tmp_path / 'own.urdf'))
    path.write_text(path.read_text().replace('</robot>', (
        '<link name="root"/><joint name="r" type="fixed"><parent link="root"/><child link="base"/>'
        '</joint><link name="imu"><collision><geometry><box size="1 1 1"/></geometry>'
        '</collision></link><joint name="i" type="fixed"><parent link="base"/><child link="imu"/>'
        '<origin xyz="0 0 1"/></joint></robot>')))
    model, said = loaded(path)
    # The shape of the frame weighs nothing, though MuJoCo would give it a ton.
    assert model.body_mass.sum() == pytest.approx(11.0, abs=1e-4) and not said
    assert model.nbody == 14


def test_an_inertia_that_breaks_the_triangle_inequality(tmp_path):
    model, said = loaded(changed(tmp_path, 'FL_thigh', inertial(0.5, (0.01, 0.01, 0.05))))
    found = np.sort(model.body_inertia[model.body('FL_thigh').id])
    assert found[0] + found[1] >= found[2] > 0.03
    assert re.match(r"link 'FL_thigh': its inertia breaks the triangle inequality .* it gets ixx "
                    r'0\.0\d+, .* izz 0\.0\d+ kg m\^2$', said[0]) and len(said) == 1


def test_the_inertia_of_a_point(tmp_path):
    model, said = loaded(changed(tmp_path, 'FL_thigh', inertial(0.5)))
    # A ball of water of half a kilogram: 49.24 mm in radius.
    assert model.body_inertia[model.body('FL_thigh').id] == pytest.approx(0.4 * 0.5 * 0.04924**2,
                                                                          rel=1e-3)
    assert 'is that of a point' in said[0]


def test_an_inertia_far_beyond_the_robots_size(tmp_path):
    """Half a kilogram has 0.4 kg m^2 if its parts are a metre away; links are 0.22 m long."""
    model, said = loaded(changed(tmp_path, 'FL_thigh', inertial(0.5, (0.4, 0.4, 0.4))))
    assert model.body_inertia[model.body('FL_thigh').id] == pytest.approx(0.4 * 0.5 * 0.04924**2,
                                                                          rel=1e-3)
    assert said[0].startswith("link 'FL_thigh': its inertia needs parts 1.1 m away, beside links "
                              'of up to 0.22 m; it gets ixx 0.000485')


@examples(100)
@given(st.lists(st.floats(-1.0, 1.0), min_size=6, max_size=6))
def test_any_inertia_becomes_one_that_a_body_can_have(numbers):
    xx, xy, xz, yy, yz, zz = numbers
    given_one = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    made, wrong = possible(given_one, 1.0)
    a, b, c = np.sort(np.linalg.eigvalsh(made))
    assert a > 0.0 and a + b >= c
    if not wrong:
        assert made == pytest.approx(given_one, abs=0.02 * abs(np.trace(given_one)))
    again, wrong = possible(made, 1.0)
    assert not wrong and again == pytest.approx(made, rel=0.01, abs=0.01)


def test_a_robot_without_any_mass_weighs_what_its_shapes_do(tmp_path):
    path = Path(urdf(tmp_path / 'own.urdf'))
    path.write_text(re.sub('<inertial>.*?</inertial>', '', path.read_text(), flags=re.DOTALL))
    model, said = loaded(path)
    assert model.body_mass.sum() == pytest.approx(13 * 500.0 * 4.0 / 3.0 * np.pi * 0.03**3,
                                                  rel=1e-3)
    assert 'no link has a mass' in said[0]


def test_feet_whose_meshes_are_missing_are_balls_that_end_where_feedback_has_them(tmp_path):
    path = Path(urdf(tmp_path / 'own.urdf'))
    frames = ''.join(f'<link name="{leg}_foot"/><joint name="{leg}_end" type="fixed"><parent '
                     f'link="{leg}_calf"/><child link="{leg}_foot"/><origin xyz="0 0 -0.22"/>'
                     '</joint>' for leg in ('FL', 'FR', 'RL', 'RR'))
    path.write_text(re.sub(r'(_calf">.*?)<sphere radius="0.03"/>', r'\1<mesh filename="no.stl"/>',
                           path.read_text(), flags=re.DOTALL).replace('</robot>',
                                                                      f'{frames}</robot>'))
    model, said = loaded(path)
    assert said[-1].endswith('a ball takes the place of the foot of lh, rh, lf, rf')
    data, known = mujoco.MjData(model), load_urdf(path)
    data.qpos[:] = 0.0
    data.qpos[3] = 1.0
    mujoco.mj_kinematics(model, data)
    for joints in ROBOT.legs.values():
        chain = known.leg(joint.name for joint in joints)
        (ball,) = np.flatnonzero(model.geom_bodyid == model.joint(chain.joints[-1]).bodyid[0])
        low = data.geom_xpos[ball] - [0.0, 0.0, model.geom_size[ball, 0]]
        assert low == pytest.approx(chain.foot)
    assert model.body_mass.sum() == pytest.approx(11.0, abs=1e-3)
    assert not stood(Body(str(path), ROBOT)).fallen


def test_joints_that_no_leg_has_are_held(tmp_path):
    path = Path(urdf(tmp_path / 'own.urdf'))
    path.write_text(path.read_text().replace('</robot>', (
        '<link name="head">' + inertial(1.0, (0.01, 0.01, 0.01)) + '</link>'
        '<joint name="neck" type="revolute"><parent link="base"/><child link="head"/>'
        '<axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint>'
        '</robot>')))
    model, said = loaded(path)
    assert model.nv == 18 and model.body_mass.sum() == pytest.approx(12.0)
    assert said == ['joints that the robot file does not drive are held at 0: neck']


def test_neighbours_whose_hulls_overlap_do_not_push_each_other(tmp_path):
    path = Path(urdf(tmp_path / 'own.urdf'))
    bare = stood(Body(str(path), ROBOT), 1.0).position.copy()
    ball = '<collision><geometry><sphere radius="0.12"/></geometry></collision></link>'
    # Hip and thigh are in the same place, and so large that calf and hip overlap, too.
    path.write_text(re.sub(r'(?<=_hip">)(.*?)</link>', lambda found: found[1] + ball,
                           path.read_text(), flags=re.DOTALL))
    assert stood(Body(str(path), ROBOT), 1.0).position == pytest.approx(bare, abs=1e-3)


def test_gains_go_with_the_mass():
    assert usual_gains(15.2, 4) == (60.0, 2.0)
    # Eight times the mass is twice the length: sixteen times the torque for the same angle.
    assert usual_gains(8 * 15.2, 4) == (pytest.approx(960.0), pytest.approx(45.0))
    assert usual_gains(7.6, 2) == (60.0, 2.0)


def test_servos_that_are_slow_for_their_robot_are_taken_for_geared_ones():
    """Half as fast as a Go2's in a trot, 12 rad/s, and twice as stiff."""
    assert usual_gains(15.2, 4, 6.0) == (120.0, 4.0)
    assert usual_gains(15.2, 4, 20.0) == (60.0, 2.0)
    # A 64th of the mass is a quarter of the length, where 24 rad/s are as fast.
    kp, kd = usual_gains(15.2 / 64.0, 4)
    assert usual_gains(15.2 / 64.0, 4, 8.0) == (pytest.approx(3.0 * kp, rel=0.05),
                                                pytest.approx(3.0 * kd, rel=0.05))
    # No servo.
    assert usual_gains(15.2 / 64.0, 4, 12.0) == (kp, kd)


def test_gains_are_guessed_where_they_are_not_given(tmp_path):
    path = urdf(tmp_path / 'own.urdf')
    assert Body(path, ROBOT).gains == usual_gains(11.0, 4)
    assert Body(path, ROBOT, kp=30.0).gains == (30.0, usual_gains(11.0, 4)[1])
    assert Body(path, ROBOT, 30.0, 1.5).gains == (30.0, 1.5)


def test_a_model_that_does_not_limit_torques_says_so(tmp_path):
    path = Path(urdf(tmp_path / 'own.urdf'))
    path.write_text(path.read_text().replace('effort="25"', 'effort="0"', 1))
    _, said = loaded(path)
    assert said == ['the model does not limit the torque of: FL_hip_joint']

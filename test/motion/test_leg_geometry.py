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

"""The part geometry of robot files: from a URDF, in a file, and legs that feedback cannot move."""

from dataclasses import replace
import math
from pathlib import Path

from cpg_ros.feedback.kinematics import forward, geometry_of
from cpg_ros.motion.description import load_urdf
from cpg_ros.motion.robot_file import load_robot, read_robot, RobotError, write_robot
from cpg_ros.simulation.robot_setup.check_robot import main
from depth import examples
from go2 import displace, FILE, GO2, inverse, jacobian
from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

HEXAPOD = load_robot('hexapod')
URDF = Path(__file__).parents[2] / 'resource' / 'urdf' / 'quadruped.urdf'


def made(tmp_path, urdf=URDF):
    path = tmp_path / 'robot.yaml'
    assert main(['--urdf', str(urdf), '--make', str(path)]) in (0, 1)
    return read_robot(path)


def test_check_robot_reads_the_geometry_off_the_urdf(tmp_path, capsys):
    robot = made(tmp_path)
    assert 'feedback can move all feet' in capsys.readouterr().err
    leg = robot.geometry.legs['rf']
    assert leg.joints == ('rf_hip_joint', 'rf_thigh_joint', 'rf_calf_joint')
    assert leg.hip[0] > 0.0 > leg.hip[1] and leg.thigh[1] < 0.0
    assert leg.calf == (0.0, 0.0, -0.2) and leg.foot == (0.0, 0.0, -0.22)
    assert robot.geometry.foot_radius == 0.02


def test_a_displaced_foot_of_the_made_robot_arrives(tmp_path):
    robot = made(tmp_path)
    geometry, stand = geometry_of(robot), robot.column('offset')
    feet = forward(geometry, stand)
    way = np.tile([0.03, -0.02, 0.04], (4, 1))
    assert forward(geometry, displace(geometry, stand, feet, way)) == pytest.approx(feet + way)


def test_a_leg_that_feedback_cannot_move_is_named_and_stays(tmp_path, capsys):
    """Its thigh and calf are askew to the hip."""
    text = URDF.read_text()
    for name, axis in (('thigh', '0.1 0.995 0'), ('calf', '0.1 0.995 0')):
        at = text.index(f'<joint name="lh_{name}_joint"')
        begin = text.index('<axis', at)
        end = text.index('/>', begin)
        text = text[:begin] + f'<axis xyz="{axis}"' + text[end:]
    (tmp_path / 'other.urdf').write_text(text)
    robot = made(tmp_path, tmp_path / 'other.urdf')
    assert 'feedback cannot move the feet of lh' in capsys.readouterr().err
    assert set(robot.geometry.legs) == {'rh', 'lf', 'rf'}
    geometry, stand = geometry_of(robot), robot.column('offset')
    way = np.tile([0.03, -0.02, 0.04], (4, 1))
    moved = displace(geometry, stand, forward(geometry, stand), way) != stand
    assert moved.tolist() == [leg != 'lh' for leg in robot.legs for _ in range(3)]


@pytest.mark.parametrize('robot', [GO2, HEXAPOD], ids=['go2', 'hexapod'])
def test_geometry_and_efference_are_read_as_they_were_written(tmp_path, robot):
    write_robot(tmp_path / 'made.yaml', robot)
    again = read_robot(tmp_path / 'made.yaml')
    assert again.geometry == robot.geometry
    assert ({name: motion.efference for name, motion in again.motions.items()}
            == {name: motion.efference for name, motion in robot.motions.items()})


def test_legs_that_reach_to_the_side_are_read_off_urdf_and_model_alike(tmp_path):
    """And are those of the shipped file."""
    from_urdf = made(tmp_path, URDF.with_name('hexapod.urdf')).geometry
    for leg, known in HEXAPOD.geometry.legs.items():
        found = from_urdf.legs[leg]
        assert found.turns == known.turns and found.joints == known.joints
        assert found.yaw == pytest.approx(known.yaw, abs=1e-5)
        for key in ('hip', 'thigh', 'calf', 'foot'):
            assert getattr(found, key) == pytest.approx(getattr(known, key), abs=1e-5)
        assert known.yaw == pytest.approx(math.copysign(math.pi / 2.0, known.hip[1]), abs=1e-5)


@examples(40)
@given(seed=st.integers(0, 10**6))
def test_feet_to_the_side_are_where_the_descriptions_turns_take_them(seed):
    """By the product of rotations down the URDF; and the derivatives by differences."""
    geometry, rng = geometry_of(HEXAPOD), np.random.default_rng(seed)
    description = load_urdf(URDF.with_name('hexapod.urdf'))
    angles = HEXAPOD.column('offset') + rng.uniform(-0.4, 0.4, len(HEXAPOD.joints))
    feet = forward(geometry, angles)
    for k, leg in enumerate(HEXAPOD.legs):
        names = HEXAPOD.geometry.legs[leg].joints
        turn, place = np.eye(3), np.zeros(3)
        anchors = [description.frame(name)[0] for name in names]
        links = [anchors[0], *np.diff(anchors, axis=0), np.array(HEXAPOD.geometry.legs[leg].foot)]
        for link, name, angle in zip(links, [*names, ''], [*angles[geometry.columns[k]], 0.0],
                                     strict=True):
            place = place + turn @ link
            if name:
                turn = turn @ Rotation.from_rotvec(angle * description.direction(name)).as_matrix()
        assert feet[k] == pytest.approx(place, abs=1e-6)
    slopes, step = jacobian(geometry, angles), 1e-6
    for joint in range(3):
        ahead, behind = angles.copy(), angles.copy()
        ahead[geometry.columns[:, joint]] += step
        behind[geometry.columns[:, joint]] -= step
        assert slopes[:, :, joint] == pytest.approx(
            (forward(geometry, ahead) - forward(geometry, behind)) / (2.0 * step), abs=1e-8)


@examples(40)
@given(turn=st.floats(-3.0, 3.0), seed=st.integers(0, 10**6))
def test_a_body_turned_about_z_has_its_feet_turned(turn, seed):
    """So legs may reach out at any angle to the body."""
    turned = Rotation.from_rotvec([0.0, 0.0, turn])
    legs = {leg: replace(one, yaw=one.yaw + turn, **{
        key: tuple(turned.apply(getattr(one, key))) for key in ('hip', 'thigh', 'calf', 'foot')})
        for leg, one in HEXAPOD.geometry.legs.items()}
    geometry = geometry_of(HEXAPOD, replace(HEXAPOD.geometry, legs=legs))
    angles = HEXAPOD.column('offset') + np.random.default_rng(seed).uniform(-0.4, 0.4, 18)
    feet = turned.apply(forward(geometry_of(HEXAPOD), angles))
    assert forward(geometry, angles) == pytest.approx(feet)
    assert inverse(geometry, feet) == pytest.approx(angles[geometry.columns])


@examples(40)
@given(way=st.tuples(*[st.floats(-0.03, 0.03)] * 3))
def test_a_displaced_foot_to_the_side_arrives(way):
    geometry, stand = geometry_of(HEXAPOD), HEXAPOD.column('offset')
    feet = forward(geometry, stand)
    moved = displace(geometry, stand, feet, np.tile(way, (6, 1)))
    assert forward(geometry, moved) == pytest.approx(feet + np.array(way), abs=1e-9)


@pytest.mark.parametrize(('wrong', 'right', 'says'), [
    ('mass: 15.2', 'mass: -15.2', 'geometry.mass: '),
    ('[RL_hip_joint, RL_thigh_joint, RL_calf_joint]', '[RL_hip_joint, RL_thigh_joint, spine]',
     "geometry.legs.lh.joints[2]: 'spine' is not a joint of this leg"),
    ('turns: [1.0, 1.0, 1.0]', 'turns: [1.0, 0.5, 1.0]', 'turns[1]: 0.5 must be 1 or -1'),
    ('turns: [1.0, 1.0, 1.0]', 'turns: [1.0, 1.0, 1.0]\n      yaw: left',
     'geometry.legs.lh.yaw: ')])
def test_a_mistake_in_the_geometry_is_named(tmp_path, wrong, right, says):
    text = FILE.read_text()
    assert wrong in text
    (tmp_path / 'go2.yaml').write_text(text.replace(wrong, right, 1))
    with pytest.raises(RobotError) as caught:
        read_robot(tmp_path / 'go2.yaml')
    assert says in str(caught.value) and '\n' not in str(caught.value)


def test_a_short_row_of_an_efference_table_is_named(tmp_path):
    efference = GO2.motions['trot'].efference
    short = replace(efference, rows=efference.rows | {
        'roll': tuple(row[:63] for row in efference.rows['roll'])})
    robot = replace(GO2, motions={'trot': replace(GO2.motions['trot'], efference=short)})
    write_robot(tmp_path / 'go2.yaml', robot)
    with pytest.raises(RobotError, match=r'gaits.trot.efference.roll\[0\]: has 63 numbers'):
        read_robot(tmp_path / 'go2.yaml')

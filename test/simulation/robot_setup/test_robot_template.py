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

"""check_robot --make: robot files made of URDFs stand, step and fit."""

import json
import math

from cpg_ros.motion.robot_file import read_robot
from cpg_ros.simulation.robot_setup.check_robot import main
from depth import examples
from hypothesis import given, Phase
from hypothesis import strategies as st
import pytest
from urdf_texts import biped_of, LEGS, quadruped_urdf


def made(tmp_path, urdf, code=0):
    tmp_path.mkdir(exist_ok=True)
    path, out = tmp_path / 'my.urdf', tmp_path / 'my_robot.yaml'
    path.write_text(urdf)
    out.unlink(missing_ok=True)
    assert main(['--urdf', str(path), '--make', str(out)]) == code
    assert main([str(out), '--urdf', str(path)]) == code
    return read_robot(out)


def feet(robot, thigh, calf, axis=1.0):
    """Where a leg of two links of length 1 ends, forward and up from its hip."""
    first, both = axis * thigh, axis * (thigh + calf)
    return -math.sin(first) - math.sin(both), -math.cos(first) - math.cos(both)


@pytest.mark.parametrize('axis', [1, -1])
def test_a_quadruped_is_made_that_stands_and_steps(tmp_path, axis, capsys):
    calf = 'lower="-2.7" upper="-0.8" velocity="20"' if axis > 0 else \
        'lower="0.8" upper="2.7" velocity="20"'
    thigh = 'lower="-1" upper="3"' if axis > 0 else 'lower="-3" upper="1"'
    robot = made(tmp_path, quadruped_urdf(calf, f'0 {axis} 0', thigh=thigh))
    assert 'FL_calf_joint bends in swing' in capsys.readouterr().err
    assert robot.networks == ('delayed', 'quadruped') and list(robot.legs) == list(LEGS)
    assert robot.order[:3] == ('FL_calf_joint', 'FL_thigh_joint', 'FL_hip_joint')
    assert [joint.name[:2] for joint in robot.joints[::3]] == ['RL', 'RR', 'FL', 'FR']
    for leg, cell in zip(LEGS, (1, 2, 3, 4), strict=True):
        joints = {joint.name[3:-6]: joint for joint in robot.legs[leg]}
        assert {joint.cell for joint in joints.values()} == {cell}
        hip, thigh, calf = joints['hip'], joints['thigh'], joints['calf']
        assert (hip.offset, hip.weights) == (0.0, (0.0,))
        assert (hip.lower, hip.upper, hip.velocity) == (-0.8, 0.8, 20.0)
        # The URDF has a velocity of thigh and calf only where it says so, and none of the hip.
        assert hip.invented == ('velocity',) and calf.invented == ()
        standing = feet(robot, thigh.offset, calf.offset, axis)
        assert standing[0] == pytest.approx(0.0, abs=2e-3) and standing[1] < -1.2
        # Furthest forward at x = 1, further up while y > 0.
        forward = feet(robot, thigh.offset + thigh.weights[0], calf.offset, axis)
        lifted = feet(robot, thigh.offset, calf.offset + calf.weights[1], axis)
        assert forward[0] > standing[0] + 0.05 and lifted[1] > standing[1] + 0.02
        assert calf.weights[0] == pytest.approx(0.0, abs=2e-3)


def test_a_frame_that_is_turned_turns_the_axes_with_it(tmp_path):
    # A quarter turn about z at the hip: axes along -x point along -y of the root, -y along x.
    robot = made(tmp_path, quadruped_urdf(axis='-1 0 0', rpy='0 0 1.5707963', roll='0 -1 0'))
    swinging = {joint.name[3:-6]: joint.weights for joint in robot.legs['lf']}
    assert swinging['thigh'][0] > 0.0 and swinging['hip'] == (0.0,)


def test_a_hip_that_yaws_before_pitching_joints_holds_still(tmp_path):
    """Upright, then two level axes across the body: no leg that reaches to the side."""
    robot = made(tmp_path, quadruped_urdf(roll='0 0 1'))
    swinging = {joint.name[3:-6]: joint.weights for joint in robot.legs['lf']}
    assert swinging['thigh'][0] != 0.0 and swinging['hip'] == (0.0,)


def test_a_biped_is_made(tmp_path):
    robot = made(tmp_path, biped_of('left', 'right'))
    assert robot.networks == ('biped',) and list(robot.legs) == ['left', 'right']
    yaw, pitch, knee, ankle, roll = robot.legs['right']
    assert {joint.cell for joint in robot.legs['right']} == {2}
    # The knee is before the line from hip to ankle, and the sole is level.
    assert knee.offset > 0.2 and pitch.offset == pytest.approx(-knee.offset / 2, abs=2e-3)
    assert pitch.offset + knee.offset + ankle.offset == pytest.approx(0.0, abs=2e-3)
    assert yaw.weights == roll.weights == (0.0,)
    assert pitch.weights[0] < 0.0 < knee.weights[1]


@pytest.mark.parametrize(('chain', 'limit'), [
    # As an H1-2: the hip pitches above its roll, whose range is far from symmetric.
    ((('HIP_Y', '0 0 1', '0 0 0'), ('HIP_P', '0 1 0', '0 0 0'), ('HIP_R', '1 0 0', '0 0 0'),
      ('KNEE', '0 1 0', '0 0 -.4'), ('ANKLE_P', '0 1 0', '0 0 -.4'),
      ('ANKLE_R', '1 0 0', '0 0 -.02')), 'lower="-0.43" upper="2.6" velocity="20"'),
    # As a Sigmaban: joints without limits, and an ankle that rolls beside where it pitches.
    ((('HIP_Y', '0 0 1', '0 0 0'), ('HIP_R', '1 0 0', '.02 0 -.06'),
      ('HIP_P', '0 1 0', '-.02 0 0'), ('KNEE', '0 1 0', '0 0 -.14'),
      ('ANKLE_P', '0 1 0', '0 0 -.14'), ('ANKLE_R', '1 0 0', '.02 .016 0')),
     'lower="-3.14" upper="3.14" velocity="20"')])
def test_bipeds_stand_with_bent_knees_and_level_soles(tmp_path, chain, limit):
    urdf = biped_of('left', 'right', chain=chain, limit=limit)
    if chain[2][0] == 'HIP_R':
        # Of those joints only the roll has that range.
        for name in ('HIP_Y', 'HIP_P', 'KNEE', 'ANKLE_P', 'ANKLE_R'):
            for side in ('left', 'right'):
                head, tail = urdf.split(f'name="{side}_{name}"', 1)
                urdf = f'{head}name="{side}_{name}"' + tail.replace(
                    limit, 'lower="-1.5" upper="2" velocity="20"', 1)
    angles = {joint.name[6:]: joint.offset for joint in made(tmp_path, urdf).legs['right']}
    assert angles['KNEE'] == pytest.approx(0.49, abs=0.02)
    assert angles['HIP_P'] + angles['KNEE'] + angles['ANKLE_P'] == pytest.approx(0.0, abs=5e-3)
    assert [angles[name] for name in ('HIP_Y', 'HIP_R', 'ANKLE_R')] == pytest.approx(
        [0.0] * 3, abs=5e-3)


def test_soles_that_are_not_level_at_zero_have_no_balance(tmp_path, capsys):
    robot = made(tmp_path, biped_of('left', 'right', turned='0 0.5 0'))
    assert robot.biped is None
    assert 'feedback: none, as the soles are not level with all joints' in capsys.readouterr().err
    _, pitch, knee, ankle, _ = robot.legs['left']
    assert pitch.offset + knee.offset + ankle.offset == pytest.approx(-0.5, abs=5e-3)


def test_a_biped_that_cannot_step_aside_is_refused_by_its_joints(tmp_path, capsys):
    path, out = tmp_path / 'my.urdf', tmp_path / 'made.yaml'
    path.write_text(biped_of('left', 'right').replace('left_ANKLE_R" type="revolute"',
                                                      'left_ANKLE_R" type="fixed"').replace(
        'right_ANKLE_R" type="revolute"', 'right_ANKLE_R" type="fixed"'))
    assert main(['--urdf', str(path), '--make', str(out)]) == 2 and not out.exists()
    said = capsys.readouterr().err
    assert 'legs of 4 joints (left_HIP_Y, left_HIP_P, left_KNEE, left_ANKLE_P)' in said
    assert said.count('\n') == 1


limits = st.tuples(st.floats(-3.0, 3.0), st.floats(0.02, 6.0), st.floats(0.3, 40.0))


# Each example takes its time: a failing one is not made smaller.
@examples(15, phases=(Phase.generate,))
@given(hip=limits, thigh=limits, calf=limits)
def test_whatever_the_limits_what_is_made_fits(tmp_path_factory, hip, thigh, calf):
    """It fits, or it is refused, as where a leg cannot be bent below its hip."""
    texts = [f'lower="{low:.5f}" upper="{low + width:.5f}" velocity="{speed:.4f}"'
             for low, width, speed in (hip, thigh, calf)]
    folder = tmp_path_factory.mktemp('made')
    urdf, out = folder / 'my.urdf', folder / 'made.yaml'
    urdf.write_text(quadruped_urdf(hip=texts[0], thigh=texts[1], calf=texts[2]))
    code = main(['--urdf', str(urdf), '--make', str(out)])
    assert code == (0 if out.exists() else 2)
    assert not out.exists() or main([str(out), '--urdf', str(urdf)]) == 0


@pytest.mark.parametrize(('left', 'right'), [('LLEG', 'RLEG'), ('FL', 'FR')])
def test_bipeds_with_unusual_names_are_made(tmp_path, left, right):
    robot = made(tmp_path, biped_of(left, right))
    assert {leg: {joint.name[len(side) + 1:] for joint in robot.legs[leg]}
            for leg, side in (('left', left), ('right', right))} == {
                leg: {'HIP_Y', 'HIP_P', 'KNEE', 'ANKLE_P', 'ANKLE_R'} for leg in robot.legs}


def test_slow_joints_are_told_at_once_and_can_be_corrected(tmp_path, capsys):
    urdf, out = tmp_path / 'my.urdf', tmp_path / 'robot.yaml'
    urdf.write_text(quadruped_urdf(calf='lower="-2.7" upper="-0.8" velocity="0.7"',
                                   thigh='lower="-1" upper="3" velocity="1.5"'))
    assert main(['--urdf', str(urdf), '--make', str(out)]) == 0
    assert ('note: velocity limits of 0.7 and 1.5 rad/s are slow for a walking robot (hobby '
            'servos reach about 5 to 10 rad/s), and gaits keep to them: if your motors are '
            'faster, correct the URDF, or make the file with --velocity'
            ) in capsys.readouterr().out
    out.unlink()
    assert main(['--urdf', str(urdf), '--make', str(out), '--velocity', '8']) == 0
    said = capsys.readouterr()
    assert 'are slow' not in said.out and '8 rad/s, as given with --velocity' in said.err
    robot = read_robot(out)
    assert {joint.velocity for joint in robot.joints} == {8.0}
    assert not any('velocity' in joint.invented for joint in robot.joints)


def test_lopsided_legs_are_a_finding(tmp_path, capsys):
    path, out = tmp_path / 'my.urdf', tmp_path / 'made.yaml'
    path.write_text(biped_of('L', 'R', ('L_TOE_X', 'L_ANKLE_R_l')))
    assert main(['--urdf', str(path), '--make', str(out), '--json']) == 1
    said = json.loads(capsys.readouterr().out)
    assert not said['matches']
    assert 'right: has 5 joints and left 6' in said['shape']
    assert main([str(out), '--urdf', str(path)]) == 1
    assert '- right: has 5 joints and left 6' in capsys.readouterr().out

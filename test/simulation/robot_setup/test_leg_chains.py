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

"""Legs are found in the body: by chains, positions and axes; names only break ties."""

import math
from pathlib import Path
import re

from cpg_ros.feedback.kinematics import forward, geometry_of
from cpg_ros.fitting.gaits.leg_names import LegsError
from cpg_ros.motion.description import describe, DescriptionError, load_urdf, parse_tree
from cpg_ros.motion.robot_file import load_robot
from cpg_ros.networks.leg_numbers import leg_names
from cpg_ros.simulation.robot_setup.check_robot import main
from cpg_ros.simulation.robot_setup.leg_chains import legs_in
from cpg_ros.simulation.robot_setup.model_reading import geometry_from
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

INERTIAL = ('<inertial><mass value="1"/><inertia ixx=".01" iyy=".01" izz=".01" ixy="0" ixz="0" '
            'iyz="0"/></inertial>')
BOX = '<geometry><box size=".1 .05 .04"/></geometry>'
QUADRUPED = {'lh': (-0.2, 0.1), 'rh': (-0.2, -0.1), 'lf': (0.2, 0.1), 'rf': (0.2, -0.1)}
WORDS = {'lh': 'rear_left', 'rh': 'rear_right', 'lf': 'front_left', 'rf': 'front_right'}


def joint(name, parent, place, axis, limits=(-1.5, 1.5), kind='revolute', more='', shape=BOX,
          effort=20):
    xyz, axis = (' '.join(map(str, values)) for values in (place, axis))
    low, high = limits
    return (f'<joint name="{name}" type="{kind}">{more}<parent link="{parent}"/>'
            f'<child link="{name}_l"/><origin xyz="{xyz}"/><axis xyz="{axis}"/><limit '
            f'lower="{low}" upper="{high}" effort="{effort}" velocity="10"/></joint>'
            f'<link name="{name}_l">{INERTIAL}'
            f'<collision><origin xyz="0 0 -.02"/>{shape}</collision></link>')


def robot(*parts):
    return f'<robot name="r"><link name="base">{INERTIAL}</link>{"".join(parts)}</robot>'


def quadruped(names=WORDS, places=QUADRUPED, foot='', crosswise=False):
    """Return a robot of four legs of three joints; the foot is a joint's kind, or none."""
    parts = []
    roll, pitch = ((0, 1, 0), (1, 0, 0)) if crosswise else ((1, 0, 0), (0, 1, 0))
    for leg, (x, y) in places.items():
        name = names[leg]
        parts += [joint(f'{name}_hip', 'base', (x, y, 0), roll, (-0.8, 0.8)),
                  joint(f'{name}_thigh', f'{name}_hip_l', (0, 0, 0), pitch),
                  joint(f'{name}_calf', f'{name}_thigh_l', (0, 0, -0.2), pitch, (-2.6, -0.5)),
                  joint(f'{name}_foot', f'{name}_calf_l', (0, 0, -0.2), pitch,
                        kind=foot or 'fixed')]
    return robot(*parts)


LEG = (('hip_yaw', (0, 0, 1), (-1, 1), 0), ('hip_roll', (1, 0, 0), (-1, 1), 0),
       ('hip_pitch', (0, 1, 0), (-1.5, 1.5), 0), ('knee', (0, 1, 0), (0, 2.3), -0.3),
       ('ankle_pitch', (0, 1, 0), (-1, 1), -0.3), ('ankle_roll', (1, 0, 0), (-1, 1), 0))


def humanoid(shoulder='shoulder_pitch', fingers=(), mimic=False, shape=BOX):
    parts = []
    for side, y in (('left', 1), ('right', -1)):
        above, place = 'base', (0, 0.1 * y, -0.1)
        for name, axis, limits, down in LEG:
            follows = '<mimic joint="left_hip_yaw"/>' if mimic and (side, name) == (
                'right', 'hip_yaw') else ''
            parts.append(joint(f'{side}_{name}', above, place if above == 'base' else (0, 0, down),
                               axis, limits, more=follows, shape=shape))
            above = f'{side}_{name}_l'
        parts += [joint(f'{side}_{shoulder}', 'base', (0, 0.2 * y, 0.3), (0, 1, 0)),
                  joint(f'{side}_elbow', f'{side}_{shoulder}_l', (0, 0, -0.2), (0, 1, 0), (0, 2)),
                  *(joint(f'{side}_{finger}', f'{side}_elbow_l', (0.02 * k, 0, -0.2), (0, 1, 0),
                          (0, 1)) for k, finger in enumerate(fingers))]
    return robot(*parts)


def legs_of(urdf, *arguments):
    return legs_in(describe(parse_tree(urdf.encode(), 'r'), 'r'), *arguments)


def made(tmp_path, urdf, *arguments):
    """Make a robot file and check it against its URDF; return the robot."""
    path, out = tmp_path / 'my.urdf', tmp_path / 'my_robot.yaml'
    path.write_text(urdf)
    assert main(['--urdf', str(path), '--make', str(out), *arguments]) == 0
    return load_robot(str(out))


@pytest.mark.parametrize('urdf', [
    humanoid(fingers=('middle_MCP', 'index_MCP')), humanoid(fingers=('uthumb',)),
    humanoid(shoulder='sho_pitch')], ids=['fingers', 'thumb', 'shoulder'])
def test_arms_and_fingers_are_not_legs(urdf):
    legs = legs_of(urdf)
    assert legs.joints == {side: tuple(f'{side}_{name}' for name, *_ in LEG)
                           for side in ('left', 'right')}
    assert 'left_elbow' in legs.unassigned


@pytest.mark.parametrize('urdf', [
    robot(*(joint(f'{side}_wheel_{end}', 'base', (x, y, 0), (0, 1, 0), kind='continuous')
            for side, y in (('left', 0.2), ('right', -0.2)) for end, x in (('a', 0.2),
                                                                          ('b', -0.2)))),
    robot(*(part for side, y in (('left', 0.2), ('right', -0.2)) for part in (
        joint(f'{side}_shoulder', 'base', (0, y, 0.3), (0, 1, 0)),
        joint(f'{side}_elbow', f'{side}_shoulder_l', (0, 0, -0.2), (0, 1, 0)))))],
    ids=['wheels', 'arms alone'])
def test_what_has_no_legs_is_refused(urdf):
    with pytest.raises(LegsError, match='--legs '):
        legs_of(urdf)


def test_fore_legs_whose_links_are_called_arm_and_hand_are_legs():
    """And hips are, whatever they are called: words of arms count beside other limbs only."""
    names = {leg: f'{word}_arm' for leg, word in WORDS.items()}
    assert legs_of(quadruped(names))['lf'][0] == 'front_left_arm_hip'
    legs = legs_of(humanoid(fingers=('middle_MCP',)).replace('hip_yaw', 'pelvis'))
    assert legs['left'][:2] == ('left_pelvis', 'left_hip_roll')


def test_legs_whose_feet_have_no_mesh_on_one_side_are_a_pair():
    urdf = humanoid().replace('right_ankle_roll', 'right_ankle_r')
    at = urdf.index('<link name="left_ankle_roll_l">')
    urdf = urdf[:at] + urdf[at:].replace('0 0 -.02', '0 0 -.4', 1)
    assert list(legs_of(urdf)) == ['left', 'right']


def test_fingers_that_follow_one_motor_are_no_legs():
    parts = [part for side, y in (('a', 0.02), ('b', -0.02)) for part in (
        joint(f'{side}_base', 'base', (0, y, 0), (0, 1, 0)),
        joint(f'{side}_tip', f'{side}_base_l', (0, 0, -0.1), (0, 1, 0),
              more=f'<mimic joint="{side}_base"/>'))]
    with pytest.raises(LegsError, match='no two limbs of two to six joints'):
        legs_of(robot(*parts))


def test_a_robot_whose_y_is_up_is_refused_with_the_axis():
    urdf = quadruped({leg: f'q{k}' for k, leg in enumerate(QUADRUPED)})
    joints = re.findall(r'<origin xyz="([^"]*)"/><axis xyz="([^"]*)"', urdf)
    for xyz, axis in set(joints):
        moved, about = (' '.join(text.split()[k] for k in (1, 2, 0)) for text in (xyz, axis))
        urdf = urdf.replace(f'<origin xyz="{xyz}"/><axis xyz="{axis}"',
                            f'<origin xyz="{moved}" /><axis xyz="{about}"')
    with pytest.raises(LegsError, match=r'y is up, but z must be \(REP 103\)'):
        legs_of(urdf)


def test_limits_of_ros2_control_count():
    urdf = robot(joint('knee', 'base', (0, 0, 0), (0, 1, 0))).replace('</robot>', (
        '<ros2_control><joint name="knee"><command_interface name="position"><param name="min">'
        '-0.5</param><param name="max">2</param></command_interface><command_interface '
        'name="velocity"><param name="max">3</param></command_interface></joint></ros2_control>'
        '</robot>'))
    knee = describe(parse_tree(urdf.encode(), 'r'), 'r').joints['knee']
    assert (knee.lower, knee.upper, knee.velocity) == (-0.5, 1.5, 3.0)


@pytest.mark.parametrize('names', [
    {'lf': 'leg1', 'rf': 'leg2', 'lh': 'leg3', 'rh': 'leg4'},
    {'lf': 'L1', 'rf': 'R1', 'lh': 'L2', 'rh': 'R2'},
    {'lf': 'qq', 'rf': 'ww', 'lh': 'ee', 'rh': 'tt'}])
def test_legs_of_any_names_are_told_by_their_places(names):
    assert legs_of(quadruped(names)).joints == {
        leg: tuple(f'{names[leg]}_{part}' for part in ('hip', 'thigh', 'calf'))
        for leg in QUADRUPED}


def test_a_robot_that_faces_backward_is_refused_with_the_remedy():
    urdf = quadruped(places={leg: (-x, -y) for leg, (x, y) in QUADRUPED.items()})
    with pytest.raises(LegsError, match=r'faces -x .* names .* --forward=-x writes.*--forward x'):
        legs_of(urdf)
    assert legs_of(urdf, True)['lf'][0] == 'rear_right_hip'


def test_names_on_the_wrong_side_are_refused_and_can_be_overruled():
    urdf = quadruped(places={leg: (x, -y) for leg, (x, y) in QUADRUPED.items()})
    with pytest.raises(LegsError, match=r'--forward x .*--legs'):
        legs_of(urdf)
    assert legs_of(urdf, True)['lf'][0] == 'front_right_hip'
    assert legs_of(urdf, False, WORDS)['lf'][0] == 'front_left_hip'


def test_a_robot_that_faces_y_is_refused_with_the_remedy():
    places = {leg: (-y, x) for leg, (x, y) in QUADRUPED.items()}
    with pytest.raises(LegsError, match=r'faces y .* axes .*--forward=y writes'):
        legs_of(quadruped(places=places, crosswise=True))


@pytest.mark.parametrize('zero', [1.5, -1.2])
@pytest.mark.parametrize('crosswise', [False, True])
def test_where_a_robot_faces_does_not_depend_on_the_zeros_of_its_hips(zero, crosswise):
    """With its hips at 0 a leg is stretched out to the side, and its knee turns about z."""
    turned = f'0 {zero} 0' if crosswise else f'{zero} 0 0'
    urdf = re.sub(r'(xyz="-?0\.[12] -?0\.[12] 0")/>', rf'\1 rpy="{turned}"/>', quadruped(
        {leg: str(k) for k, leg in enumerate(QUADRUPED)}, crosswise=crosswise))
    assert urdf.count('rpy') == 4
    if crosswise:
        with pytest.raises(LegsError, match='faces y or -y in the URDF'):
            legs_of(urdf)
    else:
        assert list(legs_of(urdf)) == list(QUADRUPED)


@pytest.mark.parametrize('kind', ['continuous', 'revolute'])
def test_wheels_are_held(tmp_path, capsys, kind):
    urdf = quadruped(foot='continuous')
    if kind == 'revolute':
        # Some exporters write a wheel so; a knee with limits of 3 pi is none.
        urdf = re.sub('(_foot" type=")continuous(.*?lower=").*?(" upper=").*?"',
                      r'\1revolute\g<2>-1000\g<3>1000"', urdf)
        urdf = re.sub('(_hip" type="revolute.*?lower=").*?(" upper=").*?"',
                      r'\g<1>-9.42\g<2>9.42"', urdf)
    driven = {joint.name for joint in made(tmp_path, urdf).joints}
    assert len(driven) == 12 and not any(name.endswith('_foot') for name in driven)
    assert 'front_left_foot is a wheel, and is held' in capsys.readouterr().err


def test_a_joint_that_follows_another_is_held_on_both_sides():
    legs = legs_of(humanoid(mimic=True))
    assert all(len(legs[leg]) == 5 and 'hip_yaw' not in legs[leg][0] for leg in legs)
    assert 'left_hip_yaw is the pair of right_hip_yaw' in legs.explanation


def test_legs_with_springs_are_refused_by_name():
    urdf = quadruped()
    head, name, tail = urdf.partition('name="front_left_thigh"')
    with pytest.raises(DescriptionError, match=r"'front_left_thigh' has no motor.*not supported"):
        legs_of(head + name + tail.replace('effort="20"', 'effort="0"', 1))


def test_missing_meshes_are_said_and_leave_out_the_soles(tmp_path, capsys):
    shape = '<geometry><mesh filename="package://my_robot/meshes/foot.stl"/></geometry>'
    assert made(tmp_path, humanoid(shape=shape)).biped is None
    assert 'meshes are missing' in capsys.readouterr().err


def test_a_foot_that_is_a_mesh_is_where_the_mesh_ends(tmp_path):
    (tmp_path / 'shank.obj').write_text(''.join(
        f'v {x} {y} {z}\n' for z in (0.02, -0.37) for x in (-0.01, 0.01) for y in (-0.01, 0.01))
        + 'f 1 2 3\n')
    (tmp_path / 'my.urdf').write_text(robot(
        joint('knee', 'base', (0, 0, 0), (0, 1, 0),
              shape='<geometry><mesh filename="shank.obj"/></geometry>')))
    foot, radius = load_urdf(tmp_path / 'my.urdf').foot_below('knee')
    assert foot == pytest.approx([0.0, 0.0, -0.39]) and radius == 0.0


@pytest.mark.parametrize(('facing', 'turn'), [('y', 1j), ('-x', -1), ('-y', -1j)])
def test_a_robot_that_faces_elsewhere_is_made_with_a_urdf_that_is_turned(
        tmp_path, capsys, facing, turn):
    """By the option that the refusal names: the left foreleg is the one with that name."""
    at = {leg: complex(x, y) * turn for leg, (x, y) in QUADRUPED.items()}
    (tmp_path / 'my.urdf').write_text(quadruped(
        places={leg: (place.real, place.imag) for leg, place in at.items()},
        crosswise=facing != '-x'))
    out, command = tmp_path / 'my.yaml', ['--urdf', str(tmp_path / 'my.urdf'), '--make']
    assert main([*command, str(out)]) == 2
    (option,) = re.findall(r'--forward=\S+', capsys.readouterr().err)
    assert option == f'--forward={facing}' and main([*command, str(out), option]) == 0
    turned = tmp_path / 'my_facing_x.urdf'
    robot = load_robot(str(out))
    assert {leg: joints[0].name for leg, joints in robot.legs.items()} == {
        leg: f'{name}_hip' for leg, name in WORDS.items()}
    assert load_urdf(turned).frame('front_left_hip')[0] == pytest.approx([0.2, 0.1, 0.0])
    assert main([str(out), '--urdf', str(turned)]) == 0


def test_what_turning_cannot_do_leaves_no_file(tmp_path, capsys):
    (tmp_path / 'my.urdf').write_text(quadruped())
    assert main(['--urdf', str(tmp_path / 'my.urdf'), '--make', str(tmp_path / 'my.yaml'),
                 '--forward', 'y']) == 2
    assert [file.name for file in tmp_path.iterdir()] == ['my.urdf']
    assert capsys.readouterr().err.count('\n') == 1


def test_the_question_which_limbs_are_legs_has_the_option_that_answers_it(tmp_path):
    """Limbs of unlike lengths are no mirror images, but may be legs."""
    urdf = quadruped({'lf': 'qa', 'rf': 'wb', 'lh': 'ec', 'rh': 'td'}).replace(
        '<origin xyz="0 0 -0.2"/>', '<origin xyz="0 0 -0.5"/>', 2).replace(
        'xyz="-0.2 0.1 0"', 'xyz="-0.9 0.1 0"')
    with pytest.raises(LegsError) as caught:
        legs_of(urdf.replace('xyz="0.2 0.1 0"', 'xyz="0.9 0.1 0"'))
    text = str(caught.value)
    assert text.endswith('--legs lh=ec_ rh=td_ lf=qa_ rf=wb_') and '\n' not in text


@pytest.mark.parametrize(('limits', 'word'), [
    ((2.4, 3.4), 'above its lowest joint'), ((0.6999, 0.7101), ' mm upward only')])
def test_what_would_not_stand_or_step_is_not_written(tmp_path, capsys, limits, word):
    urdf, out = tmp_path / 'my.urdf', tmp_path / 'my.yaml'
    urdf.write_text(quadruped().replace('lower="-1.5" upper="1.5"', 'lower="{}" upper="{}"'.format(
        *limits)).replace('lower="-2.6" upper="-0.5"', 'lower="-1.41" upper="-1.39"'))
    assert main(['--urdf', str(urdf), '--make', str(out)]) == 2 and not out.exists()
    said = capsys.readouterr().err
    assert 'no file is written' in said and word in said and said.count('\n') == 1


def test_legs_at_another_place_than_the_file_says_are_found(tmp_path, capsys):
    text = (tmp_path / 'my.urdf', tmp_path / 'my_robot.yaml')
    made(tmp_path, quadruped())
    for one, other, word in (('left', 'right', 'lh is at the right of rh'),
                             ('front', 'rear', 'lh is ahead of lf')):
        urdf = quadruped().replace(one, '?').replace(other, one).replace('?', other)
        text[0].write_text(urdf)
        assert main([str(text[1]), '--urdf', str(text[0])]) == 1
        assert word in capsys.readouterr().out


@pytest.mark.parametrize('limit', ['velocity="1000"', 'velocity="0"'])
def test_speeds_that_no_motor_has_are_no_limits(tmp_path, limit):
    joints = made(tmp_path, quadruped().replace('velocity="10"', limit)).joints
    assert {joint.velocity for joint in joints} == {20.0}
    assert all('velocity' in joint.invented for joint in joints)


def test_limits_of_0_and_0_are_none(tmp_path):
    robot = made(tmp_path, quadruped().replace('lower="-0.8" upper="0.8"', 'lower="0" upper="0"'))
    assert robot.legs['lf'][0].invented == ('lower', 'upper')


# -- scrambled robots -----------------------------------------------------------------------------

SPHERE = '<geometry><sphere radius=".02"/></geometry>'
AXES = {'x': (1.0, 0.0, 0.0), 'y': (0.0, 1.0, 0.0), 'z': (0.0, 0.0, 1.0),
        'oblique': (0.0, math.cos(0.5), -math.sin(0.5))}
#: Of each kind: joint, axis, limits and place of a left leg, outwards; the last is fixed.
KINDS = {
    4: (('hip', 'x', (-0.8, 0.8), None), ('thigh', 'y', (-1.0, 2.5), (0, 0.05, 0)),
        ('calf', 'y', (-2.6, -0.5), (0, 0, -0.2)), ('foot', '', None, (0, 0, -0.25))),
    6: (('coxa', 'z', (-0.8, 0.8), None), ('femur', 'x', (-1.5, 1.5), (0, 0.05, 0)),
        ('tibia', 'x', (-2.0, 2.0), (0, 0.1, 0)), ('foot', '', None, (0, 0.15, 0))),
    2: tuple((name, 'xyz'[axis.index(1)], limits, (0, 0, down) if k else None)
             for k, (name, axis, limits, down) in enumerate(LEG)),
    # As a Fourier GR2: the hip pitches first, about an axis that is not level.
    'tilted': tuple((name, axis, limits, (0, 0, down) if k else None)
                    for k, (name, axis, limits, down) in enumerate((
                        ('hip_pitch', 'oblique', (-1.5, 1.5), 0), ('hip_roll', 'x', (-1, 1), 0),
                        ('hip_yaw', 'z', (-1, 1), 0), ('knee', 'y', (0, 2.3), -0.3),
                        ('ankle_pitch', 'y', (-1, 1), -0.3), ('ankle_roll', 'x', (-1, 1), 0))))}
#: Where hexapods' legs point: the corner legs ahead and behind.
YAW = {'h': 0.7, 'f': -0.7}


def origin(place, turn):
    """Return the origin of a frame as a URDF has it: xyz and rpy."""
    rpy = Rotation.from_matrix(turn).as_euler('xyz')
    return f'<origin xyz="{" ".join(map(str, place))}" rpy="{" ".join(map(str, rpy))}"/>'


def scrambled(kind, rng=None, quarters=0):
    """Return a robot and its legs; with draws, frames, zeros, senses and names of joints are any.

    The robot faces x turned by some quarters of a turn to the left.
    """
    parts, names = [], {}
    legs = 2 if kind == 'tilted' else kind
    base = Rotation.from_euler('z', -0.5 * math.pi * quarters).as_matrix()
    for leg in leg_names(legs):
        side = 1.0 if leg[0] == 'l' else -1.0
        mirror = np.diag([1.0, side, 1.0])
        row = {'h': -0.25, 'f': 0.25}.get(leg[1:], 0.0)
        mount = Rotation.from_euler('z', side * YAW.get(leg[1:], 0.0) * (legs == 6)).as_matrix()
        above, frame = 'base', base
        for name, axis, limits, place in KINDS[kind]:
            own = f'{leg}_{name}' if rng is None else f'j{rng.integers(10**9)}'
            zero, sense = (0.0, 1.0) if rng is None else (rng.uniform(-1.2, 1.2),
                                                         rng.choice([-1.0, 1.0]))
            at = np.array([row, 0.1 * side, 0.0]) if place is None else mount @ mirror @ place
            inner = np.eye(3) if rng is None else Rotation.random(rng=rng).as_matrix()
            # A turn is an axial vector: its mirror image turns the other way.
            along = side * mount @ mirror @ AXES[axis or 'x']
            bent = Rotation.from_rotvec(zero * along * bool(axis)).as_matrix()
            low, high = sorted(sense * (bound - zero) for bound in limits or (0, 0))
            part = joint(own, above, (0, 0, 0), sense * inner.T @ along, (low, high),
                         kind='revolute' if axis else 'fixed', shape=BOX if axis else SPHERE)
            down = (0.0, 0.0, -0.02 if axis else 0.0)
            parts.append(part.replace('<origin xyz="0 0 0"/>', origin(
                frame.T @ at, frame.T @ bent @ inner)).replace(
                    '<origin xyz="0 0 -.02"/>', origin(inner.T @ down, inner.T)))
            if axis:
                names.setdefault(leg, []).append(own)
            above, frame = f'{own}_l', inner
    return robot(*parts), names


def postures(folder, urdf, facing='x'):
    """Return, of the robot that is made, where its joints and feet are in the stand and steps."""
    folder.mkdir()
    path = folder / 'my.urdf'
    made_one = made(folder, urdf, f'--forward={facing}')
    known = load_urdf(path if facing == 'x' else folder / 'my_facing_x.urdf')
    found = {}
    for leg, joints in made_one.legs.items():
        chain = known.leg(one.name for one in joints)
        by_name = {one.name: one for one in joints}
        ordered = [by_name[name] for name in chain.joints]
        found[leg] = np.array([chain.posed([
            one.offset + x * one.weights[0] + y * (*one.weights, 0.0)[1] for one in ordered])[1][
                :None if len(made_one.legs) > 2 else -1]
            for x, y in ((0, 0), (1, 0), (0, 1), (-1, 0), (0, -1))])
    return made_one, known, found


@pytest.mark.parametrize('kind', [4, 6, 2, 'tilted'])
@pytest.mark.parametrize('seed', range(3))
def test_frames_names_zeros_and_senses_do_not_change_what_feet_do(tmp_path, kind, seed):
    """And feedback has the feet of a scrambled robot where they are."""
    _, _, plain = postures(tmp_path / 'plain', scrambled(kind)[0])
    rng = np.random.default_rng([list(KINDS).index(kind), seed])
    quarters = int(rng.integers(4))
    urdf, names = scrambled(kind, rng, quarters)
    robot_made, known, found = postures(tmp_path / 'any', urdf, ('x', 'y', '-x', '-y')[quarters])
    assert {leg: [one.name for one in joints]
            for leg, joints in robot_made.legs.items()} == names
    for leg, points in found.items():
        assert points == pytest.approx(plain[leg], abs=4e-3), leg
    if len(names) > 2:
        geometry = geometry_from(robot_made, known)
        assert set(geometry.legs) == set(robot_made.legs)
        feet = forward(geometry_of(robot_made, geometry), robot_made.column('offset'))
        # Lengths in the file are rounded to 1e-6 m, angles to 1e-6 rad.
        assert feet == pytest.approx(np.array([points[0, -1] for points in found.values()]),
                                     abs=5e-5)


def test_a_fourth_joint_of_a_hexapods_legs_is_held(tmp_path):
    """Feedback moves the feet by the three joints above, with it where it stands."""
    urdf = (Path(__file__).parents[3] / 'resource' / 'urdf' / 'hexapod.urdf').read_text()
    tarsi = ''
    known = describe(parse_tree(urdf.encode(), 'r'), 'r')
    last = {leg: next(one for one in known.joints.values()
                      if one.name.startswith(leg) and 'tibia' in one.name)
            for leg in leg_names(6)}
    for leg, tibia in last.items():
        axis = ' '.join(map(str, tibia.axis))
        foot = known.foot_below(tibia.name)[0] - known.frame(tibia.name)[0]
        x, y, z = 0.5 * foot
        tarsi += (f'<joint name="{leg}_tarsus" type="revolute"><parent link="{tibia.child}"/>'
                  f'<child link="{leg}_tarsus_l"/><origin xyz="{x} {y} {z}"/><axis xyz="{axis}"/>'
                  '<limit lower="-1" upper="1" effort="9" velocity="9"/></joint>'
                  f'<link name="{leg}_tarsus_l">{INERTIAL}<collision><origin xyz="{x} {y} {z}"/>'
                  f'{SPHERE}</collision></link>')
    robot = made(tmp_path, urdf.replace('</robot>', tarsi + '</robot>'))
    assert all(len(joints) == 4 for joints in robot.legs.values())
    assert set(robot.geometry.legs) == set(leg_names(6))
    known = load_urdf(tmp_path / 'my.urdf')
    stand = {one.name: one.offset for one in robot.joints}
    feet = forward(geometry_of(robot), robot.column('offset'))
    for foot, leg in zip(feet, robot.legs, strict=True):
        chain = known.leg(one.name for one in robot.legs[leg])
        assert 'tarsus' not in ' '.join(robot.geometry.legs[leg].joints)
        assert foot == pytest.approx(chain.posed([stand[name] for name in chain.joints])[1][-1],
                                     abs=1e-5)

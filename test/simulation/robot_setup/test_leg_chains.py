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

from cpg_ros.fitting.gaits.leg_names import LegsError
from cpg_ros.motion.description import describe, DescriptionError, load_urdf, parse_tree
from cpg_ros.motion.robot_file import load_robot
from cpg_ros.simulation.robot_setup.check_robot import main
from cpg_ros.simulation.robot_setup.geometry_match import LegKinematics
from cpg_ros.simulation.robot_setup.leg_chains import legs_in
import numpy as np
import pytest

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
    with pytest.raises(LegsError, match='--legs LEG=TEXT'):
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
    with pytest.raises(LegsError, match=r'faces -x .* names .* rpy="0 0 -3.14159".*--forward x'):
        legs_of(urdf)
    assert legs_of(urdf, 'x')['lf'][0] == 'rear_right_hip'


def test_names_on_the_wrong_side_are_refused_and_can_be_overruled():
    urdf = quadruped(places={leg: (x, -y) for leg, (x, y) in QUADRUPED.items()})
    with pytest.raises(LegsError, match=r'--forward x .*--legs'):
        legs_of(urdf)
    assert legs_of(urdf, 'x')['lf'][0] == 'front_right_hip'
    assert legs_of(urdf, '', WORDS)['lf'][0] == 'front_left_hip'


def test_a_robot_that_faces_y_is_refused_with_the_remedy():
    places = {leg: (-y, x) for leg, (x, y) in QUADRUPED.items()}
    with pytest.raises(LegsError, match=r'faces y .* axes .* rpy="0 0 -1.5708"'):
        legs_of(quadruped(places=places, crosswise=True))


def test_wheels_are_held(tmp_path, capsys):
    driven = {joint.name for joint in made(tmp_path, quadruped(foot='continuous')).joints}
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


@pytest.mark.parametrize('seed', range(6))
def test_zeros_and_senses_of_joints_do_not_change_the_stand(tmp_path, seed):
    """Random zeros and senses of thigh and calf, and limits to match: the same feet."""
    draw = np.random.default_rng(seed)
    zeros = draw.uniform(-1.2, 1.2, 2)
    ways = draw.choice([-1.0, 1.0], 2)
    feet = []
    for zero, way, folder in ((zeros, ways, 'any'), (np.zeros(2), np.ones(2), 'plain')):
        parts = []
        for leg, (x, y) in QUADRUPED.items():
            # Limits turn with the zero; a joint's frame is turned by it, and no link is straight.
            thigh, calf = (sorted((w * (low - z), w * (high - z))) for z, w, (low, high) in zip(
                zero, way, ((-1.0, 2.5), (-2.6, -0.5)), strict=True))
            names = [f'{leg}_{part}' for part in ('hip', 'thigh', 'calf')]
            parts += [joint(names[0], 'base', (x, y, 0), (1, 0, 0), (-0.8, 0.8)),
                      joint(names[1], f'{names[0]}_l', (0, 0, 0), (0, way[0], 0), thigh).replace(
                          '<origin xyz="0 0 0"/>', f'<origin rpy="0 {zero[0]} 0"/>', 1),
                      joint(names[2], f'{names[1]}_l', (0, 0, -0.2), (0, way[1], 0), calf).replace(
                          '<origin xyz="0 0 -0.2"/>',
                          f'<origin xyz="0 0 -0.2" rpy="0 {zero[1]} 0"/>', 1),
                      joint(f'{leg}_foot', f'{names[2]}_l', (0, 0, -0.25), (1, 0, 0),
                            kind='fixed', shape='<geometry><sphere radius=".02"/></geometry>')]
        (tmp_path / folder).mkdir()
        found = made(tmp_path / folder, robot(*parts))
        known = load_urdf(tmp_path / folder / 'my.urdf')
        legs = []
        for leg, joints in found.legs.items():
            chain = LegKinematics([one.name for one in joints], known)
            stand = {one.name: one.offset for one in joints}
            swung = {one.name: one.offset + one.weights[0] for one in joints}
            lifted = {one.name: one.offset + (one.weights[1] if len(one.weights) > 1 else 0.0)
                      for one in joints}
            hip = chain.places[1]
            arms = [chain.foot_at(angles) - hip for angles in (stand, swung, lifted)]
            assert math.dist(arms[2], (0, 0, 0)) < math.dist(arms[0], (0, 0, 0)), leg
            assert arms[0][0] == pytest.approx(0.0, abs=2e-3), leg
            legs.append(arms)
        feet.append(legs)
    assert np.array(feet[0]) == pytest.approx(np.array(feet[1]), abs=3e-3)

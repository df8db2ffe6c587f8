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

"""What shows the robot: its URDF, RViz, PlotJuggler and Foxglove, true to what is published."""

import json
import math
from pathlib import Path
import re
import xml.etree.ElementTree as ElementTree

from cpg_ros.motion.robot_file import load_robot
from cpg_ros.ros.generator_io import COMMAND_TOPICS
from cpg_ros.simulation.robot_setup.check_robot import main
import numpy as np
import pytest
import yaml

SOURCE = Path(__file__).resolve().parents[2]
URDF = SOURCE / 'resource' / 'urdf' / 'quadruped.urdf'
STAND = {'hip': 0.0, 'thigh': 0.8, 'calf': -1.5}
LEGS = {'lh': (-1, 1), 'rh': (-1, -1), 'lf': (1, 1), 'rf': (1, -1)}


@pytest.fixture(scope='module')
def tree():
    return ElementTree.parse(URDF).getroot()


def numbers(element, part, key, default):
    found = element.find(part)
    text = default if found is None else found.get(key, default)
    return np.array([float(word) for word in text.split()])


def turn(axis, angle):
    """Rotation about a unit axis, by Rodrigues' formula."""
    x, y, z = axis
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + math.sin(angle) * cross + (1 - math.cos(angle)) * cross @ cross


def place(tree, link, angles):
    """Where a link's frame is in that of the base: written out here from the XML itself."""
    above = {joint.find('child').get('link'): joint for joint in tree.findall('joint')}
    point = np.zeros(3)
    while link in above:
        joint = above[link]
        assert not numbers(joint, 'origin', 'rpy', '0 0 0').any()
        if joint.get('type') == 'revolute':
            point = turn(numbers(joint, 'axis', 'xyz', '1 0 0'),
                         angles[joint.get('name')]) @ point
        point = point + numbers(joint, 'origin', 'xyz', '0 0 0')
        link = joint.find('parent').get('link')
    assert link == 'base'
    return point


def standing(leg, **moved):
    return {f'{leg}_{joint}_joint': angle + moved.get(joint, 0.0)
            for joint, angle in STAND.items()}


def test_the_urdf_has_the_joints_and_limits_of_the_robot_file(tree, capsys):
    assert main(['quadruped', '--urdf', str(URDF), '--json', '--gait', 'trot']) == 0
    said = json.loads(capsys.readouterr().out)
    assert said['matches'] and not said['notes']
    moving = {joint.get('name'): joint for joint in tree.findall('joint')
              if joint.get('type') != 'fixed'}
    robot = load_robot('quadruped')
    assert set(moving) == set(robot.order)
    for joint in robot.joints:
        limit = moving[joint.name].find('limit')
        assert [float(limit.get(key)) for key in ('lower', 'upper', 'velocity')] == [
            joint.lower, joint.upper, joint.velocity]
        assert joint.offset == STAND[joint.name.split('_')[1]]


@pytest.mark.parametrize('leg', LEGS)
def test_signs_and_stand(tree, leg):
    ahead, left = LEGS[leg]
    thigh, foot = (place(tree, f'{leg}_{link}', standing(leg)) for link in ('thigh', 'foot'))
    assert np.sign(thigh[:2]).tolist() == [ahead, left]
    # The foot is below the hip, the knee behind both: bent backward.
    assert np.abs(foot - thigh)[:2].max() < 0.005 and foot[2] < thigh[2] - 0.28
    knee = place(tree, f'{leg}_calf', standing(leg))
    assert knee[0] < min(thigh[0], foot[0]) - 0.1
    back = place(tree, f'{leg}_foot', standing(leg, thigh=0.2))
    bent = place(tree, f'{leg}_foot', standing(leg, calf=-0.2))
    rolled = place(tree, f'{leg}_foot', standing(leg, hip=0.2))
    assert back[0] < foot[0] - 0.05 and bent[2] > foot[2] + 0.02
    # About x: positive angles take the feet to the left.
    assert rolled[1] > foot[1] + 0.05


def test_inertias_are_those_of_real_bodies(tree):
    total = 0.0
    for inertial in tree.iter('inertial'):
        mass = float(inertial.find('mass').get('value'))
        got = inertial.find('inertia')
        moments = [float(got.get(key)) for key in ('ixx', 'iyy', 'izz')]
        assert mass > 0.0 and min(moments) > 0.0 and 2 * max(moments) <= sum(moments) + 1e-9
        total += mass
    assert 8.0 < total < 20.0


def test_mujoco_takes_the_urdf_and_the_robot_stands(tree):
    mujoco = pytest.importorskip('mujoco')
    text = URDF.read_text().replace('<link name="base"/>', """<link name="world"/>
        <joint name="free" type="floating"><parent link="world"/><child link="base"/></joint>
        <link name="base"/>""")
    spec = mujoco.MjSpec.from_string(text)
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[5, 5, 0.1])
    robot = load_robot('quadruped')
    for joint in robot.joints:
        motor = spec.add_actuator(name=joint.name, target=joint.name,
                                  trntype=mujoco.mjtTrn.mjTRN_JOINT)
        motor.set_to_position(kp=60.0, kv=2.0)
    model = spec.compile()
    data = mujoco.MjData(model)
    assert model.nu == 12 and model.nv == 18
    feet = [place(tree, f'{leg}_foot', standing(leg)) for leg in LEGS]
    height = 0.02 - np.mean(feet, axis=0)[2]
    data.qpos[2] = height
    for joint in robot.joints:
        data.joint(joint.name).qpos = joint.offset
        data.actuator(joint.name).ctrl = joint.offset
        assert tuple(model.joint(joint.name).range) == (joint.lower, joint.upper)
    while data.time < 2.0:
        mujoco.mj_step(model, data)
    assert data.qpos[2] == pytest.approx(height, abs=0.03)
    upright = 1.0 - 2.0 * (data.qpos[4] ** 2 + data.qpos[5] ** 2)
    assert upright > 0.995 and np.abs(data.qvel).max() < 0.05


# -- what the layouts show is published ------------------------------------------------------

def fields(robot):
    """Topic -> how many numbers each of its fields has; names as the generator publishes them."""
    legs = {f'/{leg}/joint_states': len(joints) for leg, joints in robot.legs.items()}
    return {**{topic: {'position': n, 'velocity': n} for topic, n in legs.items()},
            '/joint_states': dict.fromkeys(('position', 'velocity'), len(robot.joints)),
            '/cpg_generator/phase': {'data': len(robot.legs)}, '/cpg_generator/gait': {'data': 1}}


def test_rviz_shows_the_robot_on_the_ground(tree):
    config = yaml.safe_load((SOURCE / 'resource' / 'rviz' / 'cpg.rviz').read_text())
    manager = config['Visualization Manager']
    shown = {display['Class'].rpartition('/')[2]: display for display in manager['Displays']}
    assert set(shown) >= {'RobotModel', 'TF', 'Grid'}
    assert all(display['Enabled'] for display in shown.values())
    assert manager['Global Options']['Fixed Frame'] == 'base'
    assert 'base' in {link.get('name') for link in tree.findall('link')}
    topic = shown['RobotModel']['Description Topic']
    assert (shown['RobotModel']['Description Source'], topic['Value']) == (
        'Topic', '/robot_description')
    # robot_state_publisher latches it.
    assert topic['Durability Policy'] == 'Transient Local'
    ground = place(tree, 'lf_foot', standing('lf'))[2] - 0.02
    assert shown['Grid']['Offset']['Z'] == pytest.approx(ground, abs=1e-3)


def test_plotjuggler_draws_what_is_published():
    root = ElementTree.parse(SOURCE / 'resource' / 'plotjuggler' / 'cpg.xml').getroot()
    robot = load_robot('quadruped')
    known = fields(robot)
    names = {f'/{leg}/joint_states': {joint.name for joint in joints}
             for leg, joints in robot.legs.items()}
    (topics,) = (element.get('value').split(';') for element in root.iter('selected_topics'))
    assert root.tag == 'root' and set(topics) <= set(known)
    curves = [curve.get('name') for curve in root.iter('curve')]
    assert len(set(curves)) == len(curves) == 10
    for curve in curves:
        indexed = re.fullmatch(r'(.+)/(\w+)\[(\d)\]', curve)
        if indexed:
            topic, field, index = indexed.groups()
            assert int(index) < known[topic][field] and topic in topics
        else:
            topic, joint, field = curve.rsplit('/', 2)
            assert joint in names[topic] and field in known[topic] and topic in topics
    assert sum('phase' in curve for curve in curves) == len(robot.legs)
    for splitter in root.iter('DockSplitter'):
        sizes = splitter.get('sizes').split(';')
        assert len(sizes) == len(list(splitter)) == int(splitter.get('count'))
    (streamer,) = root.iter('previouslyLoaded_Streamer')
    assert streamer.get('name') in {plugin.get('ID') for plugin in root.iter('plugin')}


def panels(layout):
    if isinstance(layout, str):
        return [layout]
    assert layout['direction'] in ('row', 'column') and 0 < layout['splitPercentage'] < 100
    return panels(layout['first']) + panels(layout['second'])


def test_foxglove_draws_what_is_published():
    layout = json.loads((SOURCE / 'resource' / 'foxglove' / 'cpg.json').read_text())
    known = fields(load_robot('quadruped'))
    assert sorted(panels(layout['layout'])) == sorted(layout['configById'])
    paths = [path['value'] for panel in layout['configById'].values()
             for path in panel.get('paths', ())]
    for path in paths:
        topic, field, index = re.fullmatch(r'(/[/\w]+)\.(\w+)(?:\[(\d)\])?', path).groups()
        assert int(index or 0) < known[topic][field]
    assert '/cpg_generator/gait.data' in paths
    assert sum('phase' in path for path in paths) == 4
    assert sum('position' in path for path in paths) == 3
    kinds = {name.partition('!')[0] for name in layout['configById']}
    assert kinds == {'Plot', 'StateTransitions', 'DiagnosticSummary'}


def test_all_of_it_is_installed():
    from ament_index_python.packages import get_package_share_directory
    fraction = Path(get_package_share_directory('cpg_ros'))
    for name in ('urdf/quadruped.urdf', 'rviz/cpg.rviz', 'plotjuggler/cpg.xml',
                 'foxglove/cpg.json'):
        assert (fraction / name).read_text() == (SOURCE / 'resource' / name).read_text()


def test_the_page_on_your_own_robot_names_what_there_is():
    page = (SOURCE / 'docs' / 'your_robot.md').read_text()
    assert re.findall(r'^### (\d+)\.', page, re.MULTILINE) == [str(k) for k in range(1, 11)]
    entry_points = (SOURCE / 'setup.py').read_text()
    for name in set(re.findall(r'ros2 run cpg_ros (\w+)', page)):
        assert f"'{name} = cpg_ros." in entry_points
    for name in re.findall(r'(\w+\.launch\.py)', page):
        assert (SOURCE / 'launch' / name).is_file()
    for name in re.findall(r'(?:plotjuggler|foxglove|config)/\w+\.\w+', page):
        assert any((SOURCE / folder / name).is_file() for folder in ('.', 'resource'))
    (snippet,) = re.findall(r'```yaml\n(.*?)```', page, re.DOTALL)
    controllers = yaml.safe_load(snippet)
    managed = controllers['controller_manager']['ros__parameters']
    # Each command of the generator goes to a controller of the name it publishes under.
    for topic in COMMAND_TOPICS.values():
        name = topic.partition('/')[0]
        assert managed[name]['type'].partition('/')[0] in page
        assert len(set(controllers[name]['ros__parameters']['joints'])) == 12

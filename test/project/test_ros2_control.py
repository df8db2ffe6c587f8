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

"""The files for ros2_control in the documentation: schemas, joints, topics, launch files.

ROS2_CONTROLLERS names a folder with the sources of ros2_controllers, which have the schemas.
"""

import os
from pathlib import Path
import sys
from types import ModuleType

from cpg_ros.motion.robot_file import load_robot
from cpg_ros.ros.bridges.unitree.messages import MODELS
from cpg_ros.ros.generator_io import COMMAND_TOPICS
from launch_files import of_generator, Stub
import pytest
from snippets import blocks, ROOT
import yaml

PAGE = ROOT / 'docs' / 'how_to' / 'ros2_control.md'
PAGES = PAGE, ROOT / 'docs' / 'your_robot.md'
GO2 = load_robot('unitree_go2')
#: Controller -> the package that has its schema.
CONTROLLERS = {'joint_trajectory_controller': 'joint_trajectory_controller',
               'forward_position_controller': 'forward_command_controller'}
TYPES = {'string_array': list, 'string': str, 'bool': bool, 'int': int, 'double': float}
#: Rule -> whether a value breaks it.
BROKEN = {'size_gt': lambda value, limit: len(value) <= limit[0],
          'not_empty': lambda value, limit: not value,
          'unique': lambda value, limit: len(set(value)) < len(value),
          'subset_of': lambda value, limit: not set(value) <= set(limit[0]),
          'one_of': lambda value, limit: value not in limit[0]}


def controllers(page, first='controller_manager'):
    (text,) = [one.text for one in blocks(str(page.relative_to(ROOT)))
               if one.text.startswith(f'{first}:')]
    return {name: flat(part['ros__parameters']) for name, part in yaml.safe_load(text).items()}


def flat(parameters, before=''):
    """Return name -> value, as ROS reads nested parameters."""
    found = {}
    for name, value in parameters.items():
        found |= (flat(value, f'{before}{name}.') if isinstance(value, dict)
                  else {f'{before}{name}': value})
    return found


def leaves(schema, joints, before=''):
    """Return name -> description of each parameter."""
    found = {}
    for name, part in schema.items():
        if name == '__map_joints':
            for joint in joints:
                found |= leaves(part, joints, f'{before}{joint}.')
        elif 'type' in part and isinstance(part['type'], str):
            found[f'{before}{name}'] = part
        else:
            found |= leaves(part, joints, f'{before}{name}.')
    return found


def faults(schema, given):
    """Return what is wrong with parameters by generate_parameter_library's schema."""
    known, found = leaves(schema, given.get('joints', ())), []
    for name, value in given.items():
        if name not in known:
            found.append(f'{name}: unknown')
        # A whole number is no double to ROS.
        elif type(value) is not TYPES[known[name]['type']]:
            found.append(f'{name}: {value!r} is not a {known[name]["type"]}')
    for name, part in known.items():
        value = given.get(name, part.get('default_value'))
        for rule, limit in (part.get('validation') or {}).items():
            rule = rule.removesuffix('<>')
            if rule in BROKEN and BROKEN[rule](value, limit):
                found.append(f'{name}: {value!r} is against {rule}')
    return found


SCHEMA = yaml.safe_load("""
joints: {type: string_array, default_value: [], validation: {unique<>: null, size_gt<>: [0]}}
interfaces: {type: string_array, default_value: [], validation: {subset_of<>: [[position]]}}
method: {type: string, default_value: none, validation: {one_of<>: [[splines, none]]}}
constraints: {goal_time: {type: double, default_value: 0.0},
              __map_joints: {goal: {type: double, default_value: 0.0}}}
""")


@pytest.mark.parametrize(('given', 'wrong'), [
    ({'joints': ['a']}, []), ({'joints': ['a'], 'interfaces': ['position']}, []),
    ({}, ['joints: [] is against size_gt']),
    ({'joints': ['a', 'a']}, ["joints: ['a', 'a'] is against unique"]),
    ({'joints': ['a'], 'constraints.goal_time': 1}, ['constraints.goal_time: 1 is not a double']),
    ({'joints': ['a'], 'interfaces': ['effort']}, ["interfaces: ['effort'] is against subset_of"]),
    ({'joints': ['a'], 'method': 'x'}, ["method: 'x' is against one_of"]),
    ({'joints': ['a'], 'constraints.a.goal': 0.1}, []),
    ({'joints': ['a'], 'constraints.b.goal': 0.1}, ['constraints.b.goal: unknown']),
    ({'joints': ['a'], 'joint': 'b'}, ['joint: unknown'])])
def test_the_check_itself(given, wrong):
    assert faults(SCHEMA, given) == wrong


@pytest.mark.parametrize(('page', 'name', 'first'), [
    *((page, name, 'controller_manager') for page in PAGES for name in CONTROLLERS),
    (PAGE, 'joint_trajectory_controller', 'joint_trajectory_controller')])
def test_controllers_have_the_parameters_of_their_schemas(page, name, first):
    folder = os.environ.get('ROS2_CONTROLLERS')
    if not folder:
        pytest.skip('ROS2_CONTROLLERS names no folder with the sources of ros2_controllers')
    package = CONTROLLERS[name]
    path = Path(folder) / package / 'src' / f'{package}_parameters.yaml'
    given = controllers(page, first)[name]
    assert faults(yaml.safe_load(path.read_text())[package], given) == []


@pytest.mark.parametrize('page', PAGES, ids=lambda page: page.name)
def test_joints_are_those_of_the_robot_file_in_its_order(page):
    found = controllers(page)
    for name in CONTROLLERS:
        assert tuple(found[name]['joints']) == GO2.order
        package = CONTROLLERS[name]
        assert found['controller_manager'][f'{name}.type'].startswith(f'{package}/')
    assert type(found['controller_manager']['update_rate']) is int


def test_torques_of_motors_are_held_to_those_of_the_bridge():
    given = controllers(PAGE, 'joint_trajectory_controller')['joint_trajectory_controller']
    assert tuple(given['joints']) == GO2.order
    limits = dict(zip(MODELS['go2'].joints, [*MODELS['go2'].torque] * 4, strict=True))
    for name in GO2.order:
        assert given[f'gains.{name}.p'] == 60.0 and given[f'gains.{name}.d'] == 2.0
        assert given[f'gains.{name}.u_clamp_max'] == -given[f'gains.{name}.u_clamp_min'] == (
            limits[name])


def test_the_controllers_listen_where_the_generator_publishes():
    for name, command in (('joint_trajectory_controller', 'joint_trajectory'),
                          ('forward_position_controller', 'forward_position')):
        assert COMMAND_TOPICS[command].startswith(f'{name}/')
        assert f'| `{name}` | `{command}` | `{COMMAND_TOPICS[command]}` |' in PAGE.read_text()


@pytest.mark.parametrize(('file', 'simulator'), [
    ('gazebo.launch.py', 'ros_gz_sim'), ('mujoco.launch.py', 'mujoco_ros2_control')])
def test_a_launch_file_spawns_the_controller_that_the_generator_commands(
        file, simulator, monkeypatch, tmp_path):
    (tmp_path / 'go2.urdf').write_text('<robot name="go2"/>')
    for name in ('launch', 'launch.actions', 'launch.launch_description_sources',
                 'launch.substitutions', 'launch_ros', 'launch_ros.actions',
                 'launch_ros.parameter_descriptions', 'launch_ros.substitutions'):
        module = ModuleType(name)
        vars(module).update(dict.fromkeys((
            'LaunchDescription', 'IncludeLaunchDescription', 'PythonLaunchDescriptionSource',
            'PathJoinSubstitution', 'Node', 'ParameterValue', 'FindPackageShare'), Stub))
        monkeypatch.setitem(sys.modules, name, module)
    space = {'__file__': str(tmp_path / 'x.launch.py')}
    (text,) = [one.text for one in blocks(str(PAGE.relative_to(ROOT))) if one.file == file]
    exec(text, space)
    nodes = {one.options['executable']: one.options for one in
             space['generate_launch_description']().arguments[0] if 'package' in one.options}
    assert simulator in {one['package'] for one in nodes.values()}
    assert nodes['generator']['package'] == 'cpg_ros'
    (given,) = nodes['generator']['parameters']
    known = of_generator('delayed')
    assert given.pop('use_sim_time') is True
    for name, value in given.items():
        assert type(value) is type(known[name].default), name
    broadcaster, controller = nodes['spawner']['arguments']
    assert broadcaster == 'joint_state_broadcaster'
    assert COMMAND_TOPICS[given['command']].startswith(f'{controller}/')
    update_rate = controllers(PAGE)['controller_manager']['update_rate']
    assert update_rate % given['rate'] == 0.0

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

"""Launch files: installed, startable, and true to the nodes they start."""

import contextlib
from pathlib import Path
from types import SimpleNamespace
from xml.etree import ElementTree

from cpg_ros.motion.description import describe, parse_tree
from cpg_ros.networks.registry import NETWORKS
from cpg_ros.ros.bridges.servos.bridge import SPECS as SERVO_BRIDGE
from cpg_ros.ros.bridges.servos.bus import SPECS as SERVO_BUS
from cpg_ros.ros.bridges.unitree.bridge import SPECS as BRIDGE
from cpg_ros.ros.inversion_node import Inversion
from graph import free_domain
from launch_files import (
    describing,
    executables,
    FILES,
    node_of,
    of_generator,
    parameters,
    SHARE,
    SOURCE,
    Stub,
)
import pytest
import rclpy
from setuptools import find_packages


def tree_of(text):
    """Return an XML text in a canonical form."""
    return ElementTree.canonicalize(text)


@pytest.fixture
def described(monkeypatch):
    yield from describing(monkeypatch)


@pytest.mark.parametrize('name', FILES)
def test_every_launch_file_is_installed_and_compiles(name):
    path = SHARE / 'launch' / f'{name}.launch.py'
    compile(path.read_text(), str(path), 'exec')
    assert {file.name.partition('.')[0] for file in (SOURCE / 'launch').iterdir()
            if file.suffix == '.py'} == set(FILES)


@pytest.mark.parametrize('name', FILES)
def test_every_node_exists(described, name):
    if name == 'go2' and 'robot_sim' not in executables():
        pytest.skip('robot_sim is not part of this tree')
    for node in described(name).nodes:
        if node.options['package'] == 'cpg_ros':
            assert node.options['executable'] in executables()
        else:
            assert node.options['package'] in ('robot_state_publisher', 'rviz2')
    assert 'cpg_ros' in find_packages(str(SOURCE))


@pytest.mark.parametrize('network', NETWORKS)
def test_the_generator_gets_parameters_that_it_declares(described, network):
    known = of_generator(network)
    found = described('generator', network=network, gait='walk', presets='a.yaml', robot='goat',
                      frequency='2.5')
    (node,) = found.nodes
    given = parameters(found, node)
    assert node.options['name'] == 'cpg_generator'
    assert given.pop('network') == network and given.pop('use_sim_time') is False
    assert set(given) <= set(known) and given['frequency'] == 2.5 and given['gait'] == 'walk'
    for name, value in given.items():
        assert type(value) is type(known[name].default), name


def test_what_is_empty_is_left_to_the_generator(described):
    found = described('generator')
    given = parameters(found, found.nodes[0])
    assert not {'gait', 'presets', 'robot', 'frequency'} & set(given)
    # What is given by default is the node's own default.
    for name in set(given) - {'network', 'use_sim_time'}:
        assert given[name] == of_generator('delayed')[name].default, name


@pytest.mark.parametrize(('name', 'given', 'words'), [
    ('generator', {'frequency': 'fast'}, 'frequency:=fast is not a number'),
    ('inversion', {'order': '2.5'}, 'order:=2.5 is not a whole number'),
    ('go2', {'real_time_factor': 'half'}, 'real_time_factor:=half is not a number'),
    ('go2', {'duration': 'long'}, 'duration:=long is not a number'),
    ('go2_robot', {'simulator': 'no robot'}, 'simulator:=no robot is not true or false'),
    ('go2_robot', {'domain': 'zero'}, 'domain:=zero is not a whole number'),
    ('go2', {'cmd_vel': 'perhaps'}, 'cmd_vel:=perhaps is not true or false'),
    ('inversion', {'topics': 'a'}, 'topics:=a is not a list as'),
    ('rviz', {'rviz': 'maybe'}, 'rviz:=maybe is not true or false'),
    ('rviz', {'rviz_config': '/nix'}, 'rviz_config:=/nix: there is no such file')])
def test_an_argument_of_another_kind_is_named(described, name, given, words):
    with pytest.raises(RuntimeError, match=words):
        described(name, **given)


@pytest.mark.parametrize(('name', 'usual'), [
    ('generator', ('amplitude', '1.0')), ('inversion', ('kp', '0.0')),
    ('go2', ('cmd_vel', 'false'))])
def test_a_parameter_file_comes_between_defaults_and_what_is_asked(described, name, usual,
                                                                   tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    file = tmp_path / 'fitted.yaml'
    file.write_text('/**: {ros__parameters: {robot: a.yaml, frequency: 2.1}}')
    same, value = usual
    found = described(name, params_file=str(file), robot='goat', **{same: value})
    assert found.arguments[same] == value
    assert any(same in node.options['parameters'][2] for node in found.nodes)
    for node in found.nodes:
        defaults, given, asked = node.options['parameters']
        assert given == str(file) and 'params_file' not in {**defaults, **asked}
        # Neither a default of the launch file nor anything but what was asked hides the file.
        assert 'robot' in asked and not {'rate', 'gait', 'model', 'order', 'window'} & {
            key for key, value in asked.items() if isinstance(value, Stub)}
        assert set(defaults) - set(asked) or name == 'inversion'
    with pytest.raises(RuntimeError, match='params_file:=/nix: there is no such file'):
        described(name, params_file='/nix')


def test_the_inversion_gets_parameters_that_it_declares(described):
    asked = {'topics': '[a, b]', 'robot': 'goat', 'free': '[c]', 'gait': 'trot', 'out': 'a.yaml',
             'network': 'delayed', 'preset': 'trot', 'report': 'a.html', 'apply_to': '/a'}
    found = described('inversion', **asked)
    (node,) = found.nodes
    given = parameters(found, node)
    assert node.options['name'] == 'cpg_inversion'
    rclpy.init(domain_id=free_domain())
    try:
        inversion = Inversion()
        for name in given:
            assert inversion.has_parameter(name), name
        for name in ('window', 'every', 'order'):
            value = inversion.get_parameter(name).value
            assert given[name] == value and type(given[name]) is type(value)
        names = inversion.list_parameters([], 0).names
        assert {name for name in names if '.' not in name} - set(given) <= {
            'start_type_description_service'}
        inversion.destroy_node()
    finally:
        rclpy.shutdown()
    # Lists are typed as such by launch; nothing else may be.
    (raw,) = node.options['parameters']
    assert {name for name, value in raw.items() if value.options['value_type'] == list[str]} == {
        'topics', 'free'}
    assert not set(asked) - {'topics'} & set(parameters(described('inversion'),
                                                        described('inversion').nodes[0]))


@pytest.mark.parametrize(('given', 'command'), [
    ({}, 'none'), ({'command': 'joint_trajectory'}, 'joint_trajectory'),
    ({'command': 'forward_position', 'real_time_factor': '0.0'}, 'forward_position'),
    ({'real_time_factor': '0.5'}, 'none')])
def test_go2_speaks_one_command_and_takes_turns(described, given, command, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv('HOME', str(tmp_path / 'home'))
    found = described('go2', film='~/films/a.gif', gait='walk', cmd_vel='true', **given)
    generator, simulation = (node_of(found, name) for name in ('generator', 'robot_sim'))
    to_generator = parameters(found, generator)
    known = of_generator('delayed')
    assert set(to_generator) - {'network', 'use_sim_time'} <= set(known)
    assert to_generator == {'network': 'delayed', 'gait': 'walk', 'robot': 'unitree_go2',
                            'rate': 500.0, 'combined_topic': '', 'cmd_vel': True,
                            'stamped_cmd_vel': False, 'assume_stand': True,
                            'command': command, 'use_sim_time': True}
    to_simulation = parameters(found, simulation)
    assert to_simulation == {
        'lockstep': True, 'robot': 'unitree_go2', 'model': 'go2', 'film': '~/films/a.gif',
        'footfalls': 'out/footfalls.png', 'duration': 0.0,
        'command': given.get('command', 'joint_states'),
        'real_time_factor': float(given.get('real_time_factor', 1.0))}
    assert (tmp_path / 'out').is_dir() and (tmp_path / 'home' / 'films').is_dir()
    with contextlib.suppress(ModuleNotFoundError):
        from cpg_ros.ros.robot_sim import SPECS
        for name, value in to_simulation.items():
            assert type(value) is type(SPECS[name].default), name
    # Neither is of use without the other.
    assert 'on_exit' in simulation.options and 'on_exit' in generator.options


@pytest.mark.parametrize('name', ['go2', 'go2_robot'])
def test_a_former_argument_is_refused_with_the_new_one(described, name, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(RuntimeError, match='no argument feedback: it is feedback'):
        described(name, feedback='false')


@pytest.mark.parametrize('name', ['generator', 'inversion', 'go2'])
def test_a_page_comes_with_them_if_asked_for(described, name, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    page = node_of(described(name, panel='true'), 'panel')
    assert page.options['name'] == 'cpg_panel'
    assert page.options['parameters'] == [{'port': 8080}]
    with pytest.raises(RuntimeError, match='panel:=maybe is not true or false'):
        described(name, panel='maybe')


def test_go2_without_pictures(described, monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    found = described('go2', film='none', footfalls='none')
    to_simulation = parameters(found, node_of(found, 'robot_sim'))
    assert to_simulation['film'] == to_simulation['footfalls'] == ''
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(('given', 'domain', 'switch', 'command'), [
    ({}, '0', True, 'forward_position'), ({'simulator': 'true'}, '1', False, 'forward_position'),
    ({'domain': '7', 'command': 'joint_states'}, '7', True, 'none')])
def test_go2_robot_is_on_the_robots_network(described, given, domain, switch, command,
                                            monkeypatch):
    monkeypatch.setenv('ROS_DOMAIN_ID', '5')
    monkeypatch.setenv('ROS_AUTOMATIC_DISCOVERY_RANGE', 'SUBNET')
    found = described('go2_robot', gait='walk', record='bag', namespace='dog', **given)
    assert found.environment == {'ROS_DOMAIN_ID': domain,
                                 'ROS_AUTOMATIC_DISCOVERY_RANGE': 'SUBNET'}
    # The setting of the shell is not replaced silently.
    (line,) = found.lines
    assert line.startswith(f'ROS_DOMAIN_ID is {domain} for these nodes, not 5 as in this shell')
    monkeypatch.setenv('ROS_DOMAIN_ID', domain)
    assert described('go2_robot', **given).lines == []
    generator, bridge = (node_of(found, name) for name in ('generator', 'unitree_bridge'))
    assert parameters(found, generator) == {
        'network': 'delayed', 'gait': 'walk', 'robot': 'unitree_go2', 'rate': 500.0,
        'combined_topic': '', 'cmd_vel': False, 'stamped_cmd_vel': False,
        'feedback.enabled': False, 'command': command, 'assume_stand': True}
    to_bridge = parameters(found, bridge)
    assert to_bridge['motion_switcher'] is switch
    assert to_bridge['command'] == given.get('command', 'forward_position')
    for name, value in to_bridge.items():
        assert type(value) is type(BRIDGE[name].default), name
        if name not in ('motion_switcher', 'command'):
            assert value == BRIDGE[name].default, name
    # The robot sits down before anything ends it; so it does where the generator ends.
    assert 'on_exit' in bridge.options and 'on_exit' not in generator.options
    (bag,) = found.processes
    assert bag[:5] == ['ros2', 'bag', 'record', '-o', 'bag'] and '/dog/joint_states' in bag


def test_a_robot_of_servos_lies_still_and_its_bus_outlives_the_bridge(described):
    found = described('servo_robot', robot='mine.yaml', calibration='servos.yaml', rate='100.0')
    bus, bridge, generator = (parameters(found, node_of(found, name)) for name in (
        'servo_bus', 'servo_bridge', 'generator'))
    assert set(bus) <= set(SERVO_BUS) and set(bridge) <= set(SERVO_BRIDGE)
    assert bus['rate'] == bridge['rate'] == generator['rate'] == 100.0
    assert bus['calibration'] == bridge['calibration'] == 'servos.yaml'
    assert bridge['robot'] == generator['robot'] == 'mine.yaml'
    assert bridge['command'] == generator['command'] == 'forward_position'
    # The bridge moves the robot to the stand.
    assert generator['assume_stand'] is True
    assert bridge['autostart'] is False and 5.0 < bus['end_timeout'] <= 10.0
    assert not set(generator) - set(of_generator('delayed')) - {'network'}
    assert all('on_exit' in node_of(found, name).options for name in ('servo_bus', 'servo_bridge'))


def test_rviz_shows_the_urdf_of_the_robot(described, tmp_path):
    urdf = tmp_path / 'my.urdf'
    text = ('<robot name="mine"><joint name="a" type="continuous"><parent link="trunk"/>'
            '<child link="b"/></joint><joint name="c" type="fixed"><parent link="b"/>'
            '<child link="d"/></joint></robot>')
    urdf.write_text(text)
    found = described('rviz', urdf=str(urdf), use_sim_time='true', namespace='dog')
    assert found.includes == [str(SOURCE / 'launch' / 'generator.launch.py')]
    # The end of one of them, but of nothing else in a larger launch, is the end of all.
    publisher, viewer = found.nodes
    assert 'on_exit' in publisher.options and 'on_exit' in viewer.options
    (handler,) = found.handlers
    ends = handler.arguments[0].options['target_action']
    assert ends(SimpleNamespace(node_name='/dog/cpg_generator'))
    assert not ends(SimpleNamespace(node_name='/cpg_generator')) and not ends(SimpleNamespace())
    given = parameters(found, publisher)
    assert (tree_of(given.pop('robot_description')) == tree_of(text)
            and given == {'publish_frequency': 50.0, 'frame_prefix': '', 'use_sim_time': True})
    assert viewer.options['package'] == 'rviz2'
    assert viewer.options['remappings'] == [('/robot_description', 'robot_description')]
    display, config, fixed, frame = viewer.options['arguments']
    assert display == '-d' and Path(config).is_file()
    assert (fixed, frame) == ('-f', 'trunk')
    assert Path(found.arguments['urdf']).is_file()
    assert [node.options['package'] for node in described('rviz', rviz='false').nodes] == [
        'robot_state_publisher']


@pytest.mark.parametrize(('text', 'words'), [
    ('<robot', 'line 1'), ('<robot name="a"/>', 'no joint'),
    ('<robot><joint name="a" type="fixed"><parent link="a"/><child link="a"/></joint></robot>',
     '0 root links')], ids=['malformed', 'empty', 'circle'])
def test_rviz_refuses_what_is_no_urdf(described, tmp_path, text, words):
    urdf = tmp_path / 'my.urdf'
    urdf.write_text(text)
    with pytest.raises(ValueError, match=words):
        described('rviz', urdf=str(urdf))


def test_rviz_says_which_package_is_missing(described, monkeypatch, tmp_path):
    monkeypatch.setenv('AMENT_PREFIX_PATH', str(tmp_path))
    with pytest.raises(RuntimeError, match='needs the package robot_state_publisher: sudo apt '
                                           r'install ros-\$ROS_DISTRO-robot-state-publisher'):
        described('rviz', installed=False)


def test_go2_shows_the_simulated_robot(described, monkeypatch, tmp_path):
    pytest.importorskip('mujoco')
    monkeypatch.chdir(tmp_path)
    found = described('go2', rviz='true', namespace='dog', frame_prefix='dog/', own_clock='true')
    publisher, viewer = (node_of(found, name) for name in ('robot_state_publisher', 'rviz2'))
    given = parameters(found, publisher)
    assert given['frame_prefix'] == 'dog/' and given['use_sim_time'] is True
    urdf = describe(parse_tree(given['robot_description'].encode(), 'text'), 'text')
    assert urdf.root() == 'base_link' and 'FL_calf_joint' in urdf.joints
    assert viewer.options['arguments'][-2:] == ['-f', 'dog/odom']
    simulation = parameters(found, node_of(found, 'robot_sim'))
    assert (simulation['base_frame'], simulation['odom_frame']) == ('dog/base_link', 'dog/odom')
    # All of them follow the clock of the namespace.
    for name in ('generator', 'robot_sim', 'robot_state_publisher', 'rviz2'):
        assert ('/clock', 'clock') in node_of(found, name).options['remappings']


def test_two_go2_share_neither_page_nor_clock_nor_frames(described):
    left, right = (dict(include.options['launch_arguments'])
                   for include in described('two_go2').includes)
    assert (left['namespace'], right['namespace']) == ('left', 'right')
    assert left['panel_port'] != right['panel_port']
    assert left['own_clock'] == right['own_clock'] == 'true'
    assert left['frame_prefix'] == 'left/' and right['frame_prefix'] == 'right/'
    names = described('go2', film='none', footfalls='none').arguments
    assert set(left) <= set(names)


@pytest.mark.parametrize('name', FILES)
def test_with_launch_itself(name):
    pytest.importorskip('launch_ros')
    from launch.actions import OpaqueFunction
    from launch.launch_context import LaunchContext
    from launch.launch_description_sources import PythonLaunchDescriptionSource
    from launch_ros.actions import Node
    context = LaunchContext()
    source = PythonLaunchDescriptionSource(str(SHARE / 'launch' / f'{name}.launch.py'))
    description = source.get_launch_description(context)
    names = {argument.name for argument in description.get_launch_arguments()}
    assert ('namespace' in names and len(names) >= 10) or name == 'two_go2'
    if name in ('rviz', 'go2', 'two_go2'):
        return  # these start what may not be installed
    for argument in description.get_launch_arguments():
        argument.execute(context)
    found = [node for entity in description.entities if isinstance(entity, OpaqueFunction)
             for node in entity.execute(context) or () if isinstance(node, Node)]
    for node in found:
        node._perform_substitutions(context)
    assert {node.node_name for node in found} == {
        'go2_robot': {'/unitree_bridge', '/cpg_generator'},
        'servo_robot': {'/servo_bus', '/servo_bridge', '/cpg_generator'},
    }.get(name, {f'/cpg_{name}'})

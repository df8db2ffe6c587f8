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

"""The parameter files of the page on Nav2 and joysticks: names and types that the nodes have."""

import os
from pathlib import Path
import re

from cpg_ros.motion.robot_file import load_robot
from cpg_ros.ros.feedback import switch
from launch_files import of_generator
import pytest
from snippets import blocks
import yaml

PAGE = 'docs/how_to/navigation.md'
#: Node -> parameter -> type, as the documentation of Jazzy's packages has them.
KNOWN = {
    'lifecycle_manager_navigation': {'autostart': bool, 'bond_timeout': float, 'node_names': list},
    'controller_server': {'enable_stamped_cmd_vel': bool, 'odom_topic': str},
    'velocity_smoother': {'enable_stamped_cmd_vel': bool, 'odom_topic': str,
                          'max_velocity': list, 'min_velocity': list, 'max_accel': list,
                          'max_decel': list},
    'teleop_twist_joy_node': {'axis_linear.x': int, 'axis_angular.yaw': int,
                              'scale_linear.x': float, 'scale_angular.yaw': float,
                              'enable_button': int, 'require_enable_button': bool,
                              'publish_stamped_twist': bool},
    'twist_mux': {'use_stamped': bool, 'topics': dict}}


def files():
    """Return node -> parameters of all files."""
    return {node: part['ros__parameters'] for block in blocks(PAGE) if block.language == 'yaml'
            for node, part in yaml.safe_load(block.text).items()}


def test_the_generator_has_the_parameters_of_its_file():
    known = {**of_generator('delayed'), **switch.specs(load_robot('unitree_go2'))}
    for name, value in files()['cpg_generator'].items():
        assert type(value) is type(known[name].default), name


#: Node of Nav2 -> the files of its sources that declare its parameters.
SOURCES = {
    'lifecycle_manager_navigation': ['nav2_lifecycle_manager/src/lifecycle_manager.cpp'],
    'controller_server': [
        'nav2_util/include/nav2_util/twist_publisher.hpp',
        'nav2_dwb_controller/nav_2d_utils/include/nav_2d_utils/odom_subscriber.hpp'],
    'velocity_smoother': ['nav2_velocity_smoother/src/velocity_smoother.cpp',
                          'nav2_util/include/nav2_util/twist_publisher.hpp']}


@pytest.mark.parametrize('node', SOURCES)
def test_nav2_declares_the_parameters_of_its_files(node):
    folder = os.environ.get('NAVIGATION2')
    if not folder:
        pytest.skip('NAVIGATION2 names no folder with the sources of navigation2')
    text = ''.join((Path(folder) / file).read_text() for file in SOURCES[node])
    for name in files()[node]:
        assert re.search(rf'declare_parameter\w*\(\s*(\w+,\s*)?"{name}"', text), name


@pytest.mark.parametrize('node', KNOWN)
def test_the_other_nodes_have_the_parameters_of_their_files(node):
    for name, value in files()[node].items():
        assert type(value) is KNOWN[node][name], name


def test_both_sides_agree():
    found = files()
    generator = found['cpg_generator']
    assert generator['stamped_cmd_vel'] is found['controller_server']['enable_stamped_cmd_vel']
    assert generator['stamped_cmd_vel'] is found['teleop_twist_joy_node']['publish_stamped_twist']
    assert found['lifecycle_manager_navigation']['bond_timeout'] == 0.0
    assert found['controller_server']['odom_topic'] == generator['feedback.odometry_topic']
    smoother = found['velocity_smoother']
    assert all(len(smoother[name]) == 3 for name in smoother if name.startswith(('max', 'min')))

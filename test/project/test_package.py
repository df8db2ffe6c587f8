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

"""The package as colcon builds it, and as ROS finds it."""

import os
from pathlib import Path
import shutil
import subprocess
import sys

from ament_index_python.packages import get_package_share_directory
from catkin_pkg.package import parse_package
from graph import Process
import pytest
import yaml

SOURCE = Path(__file__).resolve().parents[2]
SHARE = Path(get_package_share_directory('cpg_ros'))


def test_package_xml_is_valid_format_3():
    package = parse_package(SOURCE / 'package.xml')
    assert package.package_format == 3
    assert package.name == 'cpg_ros'
    assert package.get_build_type() == 'ament_python'
    assert package.licenses == ['Apache-2.0']


def test_every_imported_message_package_is_declared():
    package = parse_package(SOURCE / 'package.xml')
    declared = {dependency.name for dependency in package.exec_depends}
    text = ''.join(file.read_text() for file in (SOURCE / 'cpg_ros').rglob('*.py'))
    for name in ('sensor_msgs', 'std_msgs', 'std_srvs', 'trajectory_msgs', 'diagnostic_msgs',
                 'rcl_interfaces', 'rclpy', 'ament_index_python',
                 'geometry_msgs', 'nav_msgs', 'rosgraph_msgs'):
        assert (f'from {name}' in text or f'import {name}' in text) == (name in declared), name


def test_every_key_resolves_to_apt_on_ubuntu_24_04():
    listed = yaml.safe_load((SOURCE / 'test' / 'data' / 'rosdep_noble.yaml').read_text())
    package = parse_package(SOURCE / 'package.xml')
    for one in (*package.exec_depends, *package.test_depends, *package.build_depends):
        if one.name in listed['jazzy']:
            continue
        rule = listed['rosdep'][one.name]['ubuntu']
        rule = rule.get('noble', rule.get('*')) if isinstance(rule, dict) else rule
        assert isinstance(rule, list) and rule, f'{one.name}: {rule} is no apt package'


@pytest.mark.parametrize('distro', ['', 'jazzy'])
def test_the_build_takes_a_sourced_ros_as_it_is(distro, tmp_path):
    """And the folder of the clone may have a space in its path."""
    clone = tmp_path / 'a clone'
    (clone / '.ci').mkdir(parents=True)
    for name in ('Makefile', 'package.xml', 'setup.py', 'setup.cfg', 'pyproject.toml',
                 '.ci/constraints.txt'):
        shutil.copy2(SOURCE / name, clone / name)
    variables = dict(os.environ, ROS_DISTRO=distro, AMENT_PREFIX_PATH='/opt/ros/jazzy')
    told = subprocess.run(['make', '-n', 'build', 'shell'], cwd=clone, env=variables,
                          text=True, capture_output=True, check=False).stdout
    assert ('--system-site-packages' in told) == bool(distro)
    assert (' docs ros)' in told) != bool(distro)
    assert ('/install/cpg_ros:/opt/ros/jazzy' in told) == bool(distro)
    assert f"export AMENT_PREFIX_PATH='{clone}/install/cpg_ros:" in told


def test_config_launch_and_index_are_installed():
    assert (SHARE / 'package.xml').is_file()
    assert (SHARE / 'launch' / 'generator.launch.py').is_file()
    for name in ('quadruped', 'goat'):
        assert yaml.safe_load((SHARE / 'config' / f'{name}.yaml').read_text())['network']


@pytest.mark.deep
def test_a_clean_copy_builds_with_colcon_and_runs(tmp_path):
    files = subprocess.run(['git', 'ls-files', '-co', '--exclude-standard'], cwd=SOURCE, text=True,
                           capture_output=True, check=True).stdout.split()
    source = tmp_path / 'workspace' / 'src' / 'cpg_ros'
    for name in files:
        if (SOURCE / name).is_file():
            (source / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(SOURCE / name, source / name)
    colcon = Path(sys.executable).parent / 'colcon'
    subprocess.run([colcon, 'build'], cwd=tmp_path / 'workspace', check=True, capture_output=True)
    built = tmp_path / 'workspace' / 'install' / 'cpg_ros'
    executable = built / 'lib' / 'cpg_ros' / 'generator'
    assert os.access(executable, os.X_OK)
    # As `ros2 run` starts it: the executable itself, found through the workspace's prefix.
    python = next(built.glob('lib/python*/site-packages'))
    process = Process('-p', 'robot:=goat', executable=executable, environment={
        'AMENT_PREFIX_PATH': f'{built}{os.pathsep}{sys.prefix}', 'PYTHONPATH': str(python)})
    try:
        process.wait_for("publishing 8 joints of 'goat'")
    finally:
        process.end()
    assert process.wait() == 0


def test_launch_file_starts_the_node():
    pytest.importorskip('launch_ros')  # first: this repository's own folder passes for launch
    launch = pytest.importorskip('launch')
    from launch.launch_description_sources import PythonLaunchDescriptionSource
    path = str(SHARE / 'launch' / 'generator.launch.py')
    description = PythonLaunchDescriptionSource(path).get_launch_description(
        launch.LaunchContext())
    names = {entity.name for entity in description.entities
             if isinstance(entity, launch.actions.DeclareLaunchArgument)}
    assert {'gait', 'robot', 'namespace', 'use_sim_time'} <= names

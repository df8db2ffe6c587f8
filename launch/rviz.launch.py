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

"""See what the generator publishes: ros2 launch cpg_ros rviz.launch.py gait:=walk.

All arguments of generator.launch.py, too. Another robot than the generic quadruped needs both
its robot file and its URDF: robot:=$PWD/my_robot.yaml urdf:=$PWD/my.urdf.
"""

from pathlib import Path

from ament_index_python.packages import get_package_prefix, PackageNotFoundError
from cpg_ros.common.files import resource_folder
from cpg_ros.motion.description import load_urdf
from cpg_ros.ros.launch_arguments import value
from launch import LaunchDescription
from launch.actions import (
    DeclareLaunchArgument,
    IncludeLaunchDescription,
    OpaqueFunction,
    RegisterEventHandler,
    Shutdown,
)
from launch.event_handlers import OnProcessExit
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

SHARE = Path(__file__).resolve().parent.parent
ARGUMENTS = {
    'urdf': (str(resource_folder('urdf') / 'quadruped.urdf'), 'URDF of the robot'),
    'rviz': ('true', 'start rviz2; false for robot_state_publisher only'),
    'rviz_config': (str(resource_folder('rviz') / 'cpg.rviz'), 'configuration of rviz2'),
}


def needed(package):
    """Raise an error that says how to install a package that is not there."""
    try:
        get_package_prefix(package)
    except PackageNotFoundError as error:
        raise RuntimeError(f'rviz.launch.py needs the package {package}: sudo apt install '
                           f'ros-$ROS_DISTRO-{package.replace("_", "-")}') from error


def check(context):
    """Raise an error before anything starts, if not all of it can."""
    needed('robot_state_publisher')
    if value(context, 'rviz', bool):
        needed('rviz2')
        config = Path(LaunchConfiguration('rviz_config').perform(context)).expanduser()
        if not config.is_file():
            raise RuntimeError(f'rviz_config:={config}: there is no such file')
    viewers(context)


def viewers(context):
    """Return robot_state_publisher with the URDF's text, and rviz2."""
    namespace, sim_time = LaunchConfiguration('namespace'), LaunchConfiguration('use_sim_time')
    clock = {'use_sim_time': ParameterValue(sim_time, value_type=bool)}
    urdf = Path(LaunchConfiguration('urdf').perform(context)).expanduser()
    frame = load_urdf(urdf).root()
    nodes = [Node(package='robot_state_publisher', executable='robot_state_publisher',
                  namespace=namespace, output='screen', parameters=[{
                      'robot_description': ParameterValue(urdf.read_text(), value_type=str),
                      'publish_frequency': 50.0, **clock}])]
    if value(context, 'rviz', bool):
        # The configuration has the frame of the generic quadruped, and no namespace.
        nodes.append(Node(package='rviz2', executable='rviz2', namespace=namespace,
                          output='screen', parameters=[clock],
                          arguments=['-d', LaunchConfiguration('rviz_config'), '-f', frame],
                          remappings=[('/robot_description', 'robot_description')]))
    return nodes


def generate_launch_description():
    """Return generator, robot_state_publisher and rviz2, optionally in a namespace."""
    generator = PythonLaunchDescriptionSource(str(SHARE / 'launch' / 'generator.launch.py'))
    # None of them is of use without the others.
    whole = RegisterEventHandler(OnProcessExit(on_exit=[Shutdown()]))
    return LaunchDescription([
        *(DeclareLaunchArgument(name, default_value=default, description=text)
          for name, (default, text) in ARGUMENTS.items()),
        OpaqueFunction(function=check), whole,
        IncludeLaunchDescription(generator), OpaqueFunction(function=viewers)])

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

from cpg_ros.common.files import resource_folder
from cpg_ros.motion.description import load_urdf, read_urdf_text
from cpg_ros.ros.launch_arguments import value
from cpg_ros.ros.launch_arguments import viewers as displays
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
from launch_ros.parameter_descriptions import ParameterValue

SHARE = Path(__file__).resolve().parent.parent
ARGUMENTS = {
    'urdf': (str(resource_folder('urdf') / 'quadruped.urdf'), 'URDF or xacro file of the robot'),
    'rviz': ('true', 'start rviz2; false for robot_state_publisher only'),
    'rviz_config': (str(resource_folder('rviz') / 'cpg.rviz'), 'configuration of rviz2'),
}


def check(context):
    """Raise an error before anything starts, if not all of it can."""
    config = Path(LaunchConfiguration('rviz_config').perform(context)).expanduser()
    if value(context, 'rviz', bool) and not config.is_file():
        raise RuntimeError(f'rviz_config:={config}: there is no such file')
    viewers(context)


def viewers(context):
    """Return robot_state_publisher with the URDF's text, and rviz2."""
    urdf = Path(LaunchConfiguration('urdf').perform(context)).expanduser()
    config = Path(LaunchConfiguration('rviz_config').perform(context)).expanduser()
    return displays(context, read_urdf_text(urdf), load_urdf(urdf).root(), str(config),
                    with_rviz=value(context, 'rviz', bool),
                    sim_time=ParameterValue(LaunchConfiguration('use_sim_time'), value_type=bool))


def is_generator(context):
    """Return a function that recognises the process of the generator that is included here."""
    space = LaunchConfiguration('namespace').perform(context).strip('/')
    name = f'/{space}/cpg_generator' if space else '/cpg_generator'
    return lambda action: getattr(action, 'node_name', '') == name


def together(context):
    """End the launch with the generator: none of them is of use without the others."""
    return [RegisterEventHandler(OnProcessExit(target_action=is_generator(context),
                                               on_exit=[Shutdown()]))]


def generate_launch_description():
    """Return generator, robot_state_publisher and rviz2, optionally in a namespace."""
    generator = PythonLaunchDescriptionSource(str(SHARE / 'launch' / 'generator.launch.py'))
    return LaunchDescription([
        *(DeclareLaunchArgument(name, default_value=default, description=text)
          for name, (default, text) in ARGUMENTS.items()),
        OpaqueFunction(function=check), IncludeLaunchDescription(generator),
        OpaqueFunction(function=viewers), OpaqueFunction(function=together)])

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

"""Two simulated Unitree Go2 walk in one domain: ros2 launch cpg_ros two_go2.launch.py.

Namespaces left and right, a page each at http://127.0.0.1:8080/ and :8081/, and a clock each.
"""

from pathlib import Path

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, GroupAction, IncludeLaunchDescription
from launch.launch_description_sources import PythonLaunchDescriptionSource
from launch.substitutions import LaunchConfiguration

FILE = Path(__file__).resolve().parent / 'go2.launch.py'
ARGUMENTS = {
    'gait': ('trot', 'gait to start with'),
    'cmd_vel': ('true', 'follow the commands on cmd_vel (geometry_msgs/Twist)'),
    'panel': ('true', 'serve a browser page for each robot'),
    'real_time_factor': ('1.0', 'speed of simulated time; 0 for as fast as possible'),
    'duration': ('0.0', 'exit after this much simulated time [s]; 0 for never'),
}
#: Namespace of a robot, and the port of its page.
ROBOTS = {'left': '8080', 'right': '8081'}


def generate_launch_description():
    """Return go2.launch.py for each robot."""
    same = {'film': 'none', 'footfalls': 'none', 'own_clock': 'true',
            **{name: LaunchConfiguration(name) for name in ARGUMENTS}}
    return LaunchDescription([
        *(DeclareLaunchArgument(name, default_value=default, description=text)
          for name, (default, text) in ARGUMENTS.items()),
        # What one is given is not for the other.
        *(GroupAction([IncludeLaunchDescription(
            PythonLaunchDescriptionSource(str(FILE)), launch_arguments={
                **same, 'namespace': space, 'frame_prefix': f'{space}/',
                'panel_port': port}.items())]) for space, port in ROBOTS.items())])

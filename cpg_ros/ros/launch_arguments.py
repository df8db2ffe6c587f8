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

"""Launch arguments that become a node's parameters, shared by the launch files."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, get_origin

from ament_index_python.packages import get_package_prefix, PackageNotFoundError
from launch.actions import DeclareLaunchArgument, OpaqueFunction, Shutdown
from launch.launch_context import LaunchContext
from launch.launch_description_entity import LaunchDescriptionEntity
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue
import yaml

#: Type -> name of such a value in messages.
TYPE_NAMES = {int: 'a whole number', float: 'a number', bool: 'true or false',
              list: 'a list as [a, b]'}
#: Argument -> (default, type, what it is); each sets the parameter of the same name, but an
#: empty one is left to the node.
Arguments = Mapping[str, tuple[str, type, str]]
#: Parameters of the generator that are arguments of every launch file that starts it on a robot.
GENERATOR_ARGUMENTS: Arguments = {
    'network': ('delayed', str, 'network, which must be one of the robot file'),
    'gait': ('', str, "gait to start with; empty for the network's usual one"),
    'frequency': ('', float, "strides per second [Hz]; empty for the gait's usual one"),
    'cmd_vel': ('false', bool, 'follow the commands on cmd_vel (geometry_msgs/Twist)'),
    'stamped_cmd_vel': ('false', bool, 'cmd_vel is a geometry_msgs/TwistStamped'),
    'faster_gait': ('', str, 'gait for speeds beyond those of the others; empty for none'),
}
#: Arguments that have been renamed; launch itself says nothing of one that it does not know.
RENAMED = {'feedback': 'feedback.enabled'}
#: Configuration with the names of the arguments that the user set.
USER_ARGUMENTS = 'cpg_ros.given'


def declared(arguments: Arguments) -> list[LaunchDescriptionEntity]:
    """Return the actions that declare the arguments, and those of every launch file."""
    declarations = {**arguments, 'namespace': ('', str, 'namespace of all topics'),
             'panel': ('false', bool, 'serve a browser page at http://127.0.0.1:8080/'),
             'panel_port': ('8080', int, 'port of that page'),
             'params_file': ('', str, 'parameter file, such as one written by inversion; '
                             'arguments that are given override it; empty for none')}

    def note(context: LaunchContext) -> None:
        # Once declared, an argument that equals its default looks the same, given or not.
        values = context.launch_configurations
        values[USER_ARGUMENTS] = ' '.join(name for name in declarations if name in values)

    return [OpaqueFunction(function=note),
            *(DeclareLaunchArgument(name, default_value=default, description=text)
              for name, (default, _, text) in declarations.items())]


def value(context: LaunchContext, name: str, kind: type) -> Any:
    """Return the value of an argument.

    Raises:
        RuntimeError: the value has the wrong type; one line for the user.

    """
    text = LaunchConfiguration(name).perform(context)
    try:
        # As launch itself will read it.
        parsed = kind(text) if kind in (int, float, str) else yaml.safe_load(text)
    except (ValueError, yaml.YAMLError):
        parsed = None
    origin = get_origin(kind) or kind
    if not isinstance(parsed, origin):
        raise RuntimeError(f'{name}:={text} is not {TYPE_NAMES[origin]}')
    return parsed


def page(context: LaunchContext) -> list[Node]:
    """Return the node of the browser page, if the argument ``panel`` is true.

    Raises:
        RuntimeError: the argument is neither true nor false.

    """
    if not value(context, 'panel', bool):
        return []
    return [Node(package='cpg_ros', executable='panel', name='cpg_panel', output='screen',
                 namespace=LaunchConfiguration('namespace'),
                 parameters=[{'port': value(context, 'panel_port', int)}])]


def viewers(context: LaunchContext, urdf: str, fixed_frame: str, config: str, *,
            frame_prefix: str = '', with_rviz: bool = True, sim_time: Any = True,
            remappings: Sequence[tuple[str, str]] = ()) -> list[Node]:
    """Return robot_state_publisher and rviz2; the end of one ends the launch.

    Args:
        context: with the values of the arguments.
        urdf: text.
        fixed_frame: of RViz.
        config: file of RViz.
        frame_prefix: before the names of all links on /tf.
        with_rviz: whether to start rviz2.
        sim_time: value of use_sim_time.
        remappings: of both.

    Raises:
        RuntimeError: one of them is not installed; says how to get it.

    """
    common: dict[str, Any] = {'namespace': LaunchConfiguration('namespace'), 'output': 'screen',
                              'on_exit': Shutdown()}
    packages = ('robot_state_publisher', 'rviz2')[:1 + with_rviz]
    for package in packages:
        try:
            get_package_prefix(package)
        except PackageNotFoundError as error:
            raise RuntimeError(f'the display needs the package {package}: sudo apt install '
                               f'ros-$ROS_DISTRO-{package.replace("_", "-")}') from error
    options: dict[str, dict[str, Any]] = {
        'robot_state_publisher': {'parameters': [{
            'robot_description': ParameterValue(urdf, value_type=str),
            'publish_frequency': 50.0, 'frame_prefix': frame_prefix, 'use_sim_time': sim_time}],
            'remappings': list(remappings)},
        'rviz2': {'parameters': [{'use_sim_time': sim_time}],
                  'arguments': ['-d', config, '-f', fixed_frame],
                  # The configuration has no namespace.
                  'remappings': [('/robot_description', 'robot_description'), *remappings]}}
    return [Node(package=package, executable=package, **options[package], **common)
            for package in packages]


def started(context: LaunchContext, executable: str, name: str, arguments: Arguments,
            fixed: Mapping[str, Any] | None = None, **options: Any) -> Node:
    """Return a node of this package, with the nonempty arguments as parameters.

    Args:
        context: with the values of the arguments.
        executable: of the node.
        name: of the node.
        arguments: those that are parameters of the node.
        fixed: parameters that no argument sets.
        options: further ones of the action Node.

    Raises:
        RuntimeError: an argument has the wrong type or has been renamed, or params_file does not
            exist.

    """
    for former, now in RENAMED.items():
        if now in arguments and LaunchConfiguration(former, default='').perform(context):
            raise RuntimeError(f'there is no argument {former}: it is {now}')
    types = {key: kind for key, (_, kind, _) in arguments.items()
             if LaunchConfiguration(key).perform(context)}
    for key, kind in types.items():
        value(context, key, kind)
    parameters = {key: ParameterValue(LaunchConfiguration(key), value_type=kind)
                  for key, kind in types.items()}
    layers: list[Any] = [{**parameters, **(fixed or {})}]
    if name_of_file := LaunchConfiguration('params_file').perform(context):
        file = Path(name_of_file).expanduser()
        if not file.is_file():
            raise RuntimeError(f'params_file:={name_of_file}: there is no such file')
        # Later values take precedence: defaults give way to the file.
        names = LaunchConfiguration(USER_ARGUMENTS).perform(context).split()
        overrides = {key: parameter for key, parameter in parameters.items() if key in names}
        layers = [parameters, str(file), {**overrides, **(fixed or {})}]
    return Node(package='cpg_ros', executable=executable, name=name, output='screen',
                namespace=LaunchConfiguration('namespace'),
                parameters=layers, **options)

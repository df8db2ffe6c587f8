"""What the launch files share: launch arguments that become the parameters of a node."""

from collections.abc import Mapping
from typing import Any, get_origin

import yaml
from launch.actions import DeclareLaunchArgument
from launch.launch_context import LaunchContext
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

#: What a value of a type is called.
WHAT = {int: 'a whole number', float: 'a number', bool: 'true or false', list: 'a list as [a, b]'}
#: Argument -> (default, type, what it is); each sets the parameter of the same name, but an
#: empty one is left to the node.
Arguments = Mapping[str, tuple[str, type, str]]


def declared(arguments: Arguments) -> list[DeclareLaunchArgument]:
    """Return the arguments, and that of the namespace."""
    known = {**arguments, 'namespace': ('', str, 'namespace of all its topics')}
    return [DeclareLaunchArgument(name, default_value=default, description=text)
            for name, (default, _, text) in known.items()]


def value(context: LaunchContext, name: str, kind: type) -> Any:
    """Return what an argument was given.

    Raises:
        RuntimeError: it is not of this kind; one line for the user.

    """
    text = LaunchConfiguration(name).perform(context)
    try:
        # As launch itself will read it.
        found = kind(text) if kind in (int, float, str) else yaml.safe_load(text)
    except (ValueError, yaml.YAMLError):
        found = None
    origin = get_origin(kind) or kind
    if not isinstance(found, origin):
        raise RuntimeError(f'{name}:={text} is not {WHAT[origin]}')
    return found


def started(context: LaunchContext, executable: str, name: str, arguments: Arguments,
            fixed: Mapping[str, Any] | None = None, **options: Any) -> Node:
    """Return a node of this package with those arguments that are not empty.

    Args:
        context: where the arguments have their values.
        executable: of the node.
        name: of the node.
        arguments: which of them are its parameters.
        fixed: parameters that no argument gives.
        options: further ones of the action Node.

    Raises:
        RuntimeError: an argument is not of the kind that it should be.

    """
    given = {key: kind for key, (_, kind, _) in arguments.items()
             if LaunchConfiguration(key).perform(context)}
    for key, kind in given.items():
        value(context, key, kind)
    parameters = {key: ParameterValue(LaunchConfiguration(key), value_type=kind)
                  for key, kind in given.items()}
    return Node(package='cpg_ros', executable=executable, name=name, output='screen',
                namespace=LaunchConfiguration('namespace'),
                parameters=[{**parameters, **(fixed or {})}], **options)

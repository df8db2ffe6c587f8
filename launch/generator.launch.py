"""Start the generator: ros2 launch cpg_ros generator.launch.py network:=biped gait:=skip."""

from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

from launch import LaunchDescription

# Argument -> (default, type, what it is); each sets the parameter of the same name, but an empty
# one is left to the node, whose choice depends on the network.
ARGUMENTS = {
    'network': ('delayed', str, 'delayed, quadruped or biped'),
    'gait': ('', str, "gait, or the name of a preset; empty for the network's usual one"),
    'presets': ('', str, 'file with further presets; empty for none'),
    'robot': ('', str, "robot file, or a shipped name; empty for the network's usual one"),
    'rate': ('100.0', float, 'messages per second [Hz]'),
    'frequency': ('1.0', float, 'strides per second [Hz]'),
    'amplitude': ('1.0', float, "factor on the robot file's amplitudes"),
    'command': ('none', str, 'none, joint_trajectory or forward_position'),
    'autostart': ('true', bool, 'ramp into the gait at start'),
    'use_sim_time': ('false', bool, 'follow /clock'),
}


def generator(context):
    """Return the node with those arguments that are not empty."""
    given = {name: LaunchConfiguration(name) for name in ARGUMENTS
             if LaunchConfiguration(name).perform(context)}
    parameters = {name: ParameterValue(value, value_type=ARGUMENTS[name][1])
                  for name, value in given.items()}
    return [Node(package='cpg_ros', executable='generator', name='cpg_generator', output='screen',
                 namespace=LaunchConfiguration('namespace'), parameters=[parameters])]


def generate_launch_description():
    """One generator, optionally in a namespace."""
    arguments = [DeclareLaunchArgument(name, default_value=default, description=text)
                 for name, (default, _, text) in ARGUMENTS.items()]
    arguments.append(DeclareLaunchArgument('namespace', default_value='',
                                           description='namespace of all its topics'))
    return LaunchDescription([*arguments, OpaqueFunction(function=generator)])

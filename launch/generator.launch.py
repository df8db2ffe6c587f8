"""Start the generator: ros2 launch cpg_ros generator.launch.py gait:=walk robot:=goat."""

from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

from launch import LaunchDescription

# Argument -> (default, type, what it is); each sets the parameter of the same name.
ARGUMENTS = {
    'gait': ('trot', str, 'gait, or the name of a preset'),
    'robot': ('quadruped', str, 'robot file, or the name of a shipped one'),
    'rate': ('100.0', float, 'messages per second [Hz]'),
    'frequency': ('1.0', float, 'strides per second [Hz]'),
    'amplitude': ('1.0', float, "factor on the robot file's amplitudes"),
    'command': ('none', str, 'none, joint_trajectory or forward_position'),
    'autostart': ('true', bool, 'ramp into the gait at start'),
    'use_sim_time': ('false', bool, 'follow /clock'),
}


def generate_launch_description():
    """One generator, optionally in a namespace and with a parameter file."""
    arguments = [DeclareLaunchArgument(name, default_value=default, description=text)
                 for name, (default, _, text) in ARGUMENTS.items()]
    arguments.append(DeclareLaunchArgument('namespace', default_value='',
                                           description='namespace of all its topics'))
    parameters = {name: ParameterValue(LaunchConfiguration(name), value_type=kind)
                  for name, (_, kind, _) in ARGUMENTS.items()}
    return LaunchDescription([*arguments, Node(
        package='cpg_ros', executable='generator', name='cpg_generator', output='screen',
        namespace=LaunchConfiguration('namespace'), parameters=[parameters])])

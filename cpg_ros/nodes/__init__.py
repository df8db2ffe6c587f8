"""ROS 2 nodes: parameters, topics, services and clocks; the mathematics is below.

Imports every room but ``tools``.
"""

__all__ = ['array_view', 'cells_publisher', 'cmd_vel', 'command_topics', 'deadline_thread',
           'diagnostics', 'feedback_loop', 'feedback_parameters', 'feedback_switch', 'generator',
           'generator_parameters', 'inversion_node', 'joint_publishers', 'launch_arguments',
           'lockstep', 'measured_pose', 'message_block', 'node_base', 'parameter_services',
           'parameter_spec', 'raw_messages', 'real_time', 'rivals', 'robot_sim', 'senses_input',
           'sensor_publishers', 'shutdown', 'unitree', 'unserved']

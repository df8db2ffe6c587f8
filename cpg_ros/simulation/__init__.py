"""Physics: a robot's body in MuJoCo, tuned gaits, pictures of it and of its footfalls.

Imports ``feedback``, ``motion``, ``robots`` and what is below; knows nothing of ROS.
"""

__all__ = ['batch', 'body', 'camera', 'closed_loop', 'efference_measurement', 'foot_path',
           'footfall_diagram', 'gait_design', 'inertia', 'inertial_unit', 'leg_geometry',
           'mesh_files', 'model_indices', 'pattern_batch', 'pattern_follower', 'proprioception',
           'robot_model', 'run_metrics', 'run_recorder', 'scenario', 'servo_gains', 'soft_start',
           'sprawled_leg', 'steering_table', 'terrain', 'tuning', 'urdf_model']

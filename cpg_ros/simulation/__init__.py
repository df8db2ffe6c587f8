"""Physics: a robot's body in MuJoCo, tuned gaits, pictures of it and of its footfalls.

Imports ``motion``, ``robots`` and what is below; knows nothing of ROS.
"""

__all__ = ['batch', 'body', 'camera', 'foot_path', 'footfall_diagram', 'gait_design',
           'model_indices', 'pattern_follower', 'robot_model', 'run_metrics', 'run_recorder',
           'soft_start', 'steering_table', 'tuning']

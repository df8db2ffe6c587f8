"""A robot file held against the robot's URDF, and a first one made from it.

Imports ``motion``, ``gaits``, ``robots`` and what is below; knows nothing of ROS.
"""

__all__ = ['leg_shapes', 'robot_template', 'urdf_match']

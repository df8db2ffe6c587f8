"""Robots: legs, joints and limits, their files, and URDF.

Imports ``networks`` and ``files``; knows nothing of ROS.
"""

__all__ = ['body_keys', 'robot', 'robot_file', 'urdf', 'urdf_links']

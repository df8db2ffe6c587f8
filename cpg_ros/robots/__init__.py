"""Robots: legs, joints and limits, their files, and URDF.

Imports ``networks`` and ``files``; knows nothing of ROS.
"""

__all__ = ['robot', 'robot_file', 'urdf']

"""What a recording does: its steady stretch, stride, mean cycle, leg phases and gait.

Imports ``networks`` and ``files``; knows nothing of ROS.
"""

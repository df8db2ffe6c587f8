"""A network fitted to a recorded gait: parameters, readouts, and how sure they are.

Imports ``gaits``, ``motion`` and what is below; knows nothing of ROS.
"""

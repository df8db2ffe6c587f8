"""Central pattern generators of legged locomotion, true to the theory and running on ROS 2."""

__version__ = '0.1.0'

"""ROS 2 nodes: parameters, topics, services and clocks; the mathematics is below.

Imports every room but ``tools``.
"""

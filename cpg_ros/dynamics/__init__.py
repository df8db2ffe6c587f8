"""Orbits, their stability, Hopf points and branches.

Imports ``integration`` and what is below; knows nothing of ROS.
"""

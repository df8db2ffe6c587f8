"""Recorded and live joint states: bags, CSV files, messages as bytes.

Imports ``files``; knows nothing of ROS.
"""

"""The networks: equations, symmetry, gaits, and which cell drives which leg.

Imports ``files``; knows nothing of ROS.
"""

"""From a network to moving joints: plan, readout, switching and steering.

Imports ``dynamics``, ``robots`` and what is below; knows nothing of ROS.
"""

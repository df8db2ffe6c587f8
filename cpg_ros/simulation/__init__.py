"""Physics: a robot's body in MuJoCo, tuned gaits, pictures of it and of its footfalls.

Imports ``motion``, ``robots`` and what is below; knows nothing of ROS.
"""

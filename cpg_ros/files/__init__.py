"""Files and terminals: YAML that people write, atomic writes, shipped resources, progress.

Imports nothing of the package; knows nothing of ROS.
"""

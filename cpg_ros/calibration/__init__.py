"""What feedback has to know of a robot, from a recording of it walking.

Imports ``feedback``, ``gaits`` and what is below; knows nothing of ROS.
"""

__all__ = ['recorded_efference', 'walk_recording']

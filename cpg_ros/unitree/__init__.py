"""Unitree's robots: their messages as bytes, and what keeps robot and people safe.

Imports ``motion`` and ``robots`` and what is below; knows nothing of ROS.
"""

__all__ = ['crc', 'dangers', 'low_cmd', 'low_state', 'models', 'participants', 'settings',
           'supervisor', 'targets', 'vigil']

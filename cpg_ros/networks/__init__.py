"""The networks: equations, symmetry, gaits, and which cell drives which leg.

Imports ``files``; knows nothing of ROS.
"""

__all__ = ['biped', 'delayed', 'hk_theorem', 'morris_lecar', 'network', 'parameter_line',
           'preset_files', 'quadruped', 'registry', 'symmetry']

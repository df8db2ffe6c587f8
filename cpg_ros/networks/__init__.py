"""The networks: equations, symmetry, gaits, and which cell drives which leg.

Imports ``files``; knows nothing of ROS.
"""

__all__ = ['biped', 'delayed', 'derivation', 'equations', 'field', 'generated', 'hk_theorem',
           'leg_numbers', 'leg_pairs', 'morris_lecar', 'network', 'network_check', 'oscillators',
           'parameter_line', 'preset_files', 'quadruped', 'registry', 'rings', 'symmetry',
           'terms']

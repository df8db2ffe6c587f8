"""From a network to moving joints: plan, readout, switching and steering.

Imports ``dynamics``, ``robots`` and what is below; knows nothing of ROS.
"""

from cpg_ros.errors import needed

# Before any of its modules: one line where numba is missing, not a traceback.
needed('numba')

__all__ = ['duty', 'joint_readout', 'pattern', 'phase_readout', 'plan', 'precompile', 'ramp',
           'readout', 'resumption', 'runnable', 'smoothstep', 'steering', 'told_waveform', 'track']

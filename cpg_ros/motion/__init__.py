"""From a network to moving joints: plan, readout, switching and steering.

Imports ``dynamics``, ``robots`` and what is below; knows nothing of ROS.
"""

__all__ = ['joint_readout', 'pattern', 'phase_readout', 'plan', 'precompile', 'ramp', 'readout',
           'resumption', 'runnable', 'smoothstep', 'steering', 'track']

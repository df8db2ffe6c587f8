"""The compiled integrator: its kernels, in real time and offline.

Imports ``networks`` and what is below; knows nothing of ROS.
"""

__all__ = ['field_code', 'jit', 'kernel', 'loops', 'simulate', 'stepper']

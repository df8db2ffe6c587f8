"""The compiled integrator: its kernels, in real time and offline.

Imports ``networks`` and what is below; knows nothing of ROS.
"""

from cpg_ros.errors import needed

# Before any of its modules: one line where numba is missing, not a traceback.
needed('numba')

__all__ = ['field_code', 'jit', 'kernel', 'loops', 'simulate', 'stepper']

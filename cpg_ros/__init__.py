"""Central pattern generators of legged locomotion, true to the theory and running on ROS 2."""

import os

# Matrices here are small: threads of BLAS cost more than they give, and its idle ones spin on the
# cores that the publishing thread needs. It is read when numpy loads, so before anything else.
os.environ.setdefault('OPENBLAS_NUM_THREADS', '1')

__version__ = '0.1.0'

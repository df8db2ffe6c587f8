"""ROS 2 nodes: parameters, topics, services and clocks; the mathematics is below."""

import os

# Before numpy is loaded: its linear algebra on several threads gains nothing at our sizes, and
# its idle threads spin on the cores that the publishing thread needs.
os.environ.setdefault('OPENBLAS_NUM_THREADS', '1')

"""Command-line tools: arguments, tables, figures."""

import os

# Matrices here are small: BLAS threads cost more than they give, ten times as much on two cores
# that are busy. It is read when numpy loads, so before anything else.
os.environ.setdefault('OPENBLAS_NUM_THREADS', '1')

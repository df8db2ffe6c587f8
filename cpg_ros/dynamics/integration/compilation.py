# Copyright 2026 cpg_ros maintainers
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Compilation of the numerical kernels, and the elementary functions that they share.

numba is loaded when the first kernel runs; without feedback, the generator needs none. Without
numba, kernels are plain Python, too slow for feedback and simulation.
"""

from contextlib import AbstractContextManager, nullcontext
from functools import cached_property, update_wrapper
from importlib.util import find_spec
import math

import numpy as np

#: Whether kernels are machine code.
COMPILED = find_spec('numba') is not None


def _numba():
    # It takes half a second and 60 MB.
    from cpg_ros.dynamics.integration import machine_code
    return machine_code


class Kernel:
    """A function that numba compiles when Python or another kernel first calls it."""

    def __init__(self, function, decorator: str) -> None:
        """Set the function, and the name of its decorator in machine_code."""
        update_wrapper(self, function)
        self.py_func, self._decorator = function, decorator

    @cached_property
    def code(self):
        """The compiled function, or without numba the function itself."""
        return getattr(_numba(), self._decorator)(self.py_func) if COMPILED else self.py_func

    @cached_property
    def entry(self):
        """The same for calls from Python."""
        whole = COMPILED and self._decorator == 'jit'
        return _numba().jit_for_python(self.py_func) if whole else self.code

    @property
    def _numba_type_(self):
        """Type that numba infers where another kernel calls it."""
        return self.code._numba_type_

    def __call__(self, *arguments):
        """Return the function's result; nan where plain Python raises an arithmetic error."""
        if COMPILED:
            return self.entry(*arguments)
        try:
            return self.py_func(*arguments)
        except (ArithmeticError, ValueError):
            return math.nan


def jit(function):
    """Compile a function that other kernels call."""
    return Kernel(function, 'jit')


def jit_entry(function):
    """Compile an entry point of the package, and cache its machine code on disk."""
    return Kernel(function, 'jit_entry')


def specialised(kernel: Kernel, *arguments):
    """Return a kernel's machine code for arguments like these.

    It skips the type dispatch, which takes longer than a small kernel. Later arguments must have
    the same types, dimensions and memory orders.
    """
    return _numba().specialised(kernel.entry, *arguments) if COMPILED else kernel


def on_compile(compiling) -> AbstractContextManager:
    """Call a function before each compilation of a function that is not in the cache."""
    return _numba().on_compile(compiling) if COMPILED else nullcontext()


_LOG2E = 1.0 / math.log(2.0)
# ln 2 split so that n * _LN2_HIGH is exact (fdlibm).
_LN2_HIGH = 6.93147180369123816490e-01
_LN2_LOW = 1.90821492927058770002e-10
# Adding 1.5 * 2**52 rounds to an integer and leaves it in the low bits of the mantissa.
_ROUND = 6755399441055744.0


@jit
def _reduced(z):
    """Return 2^n and expm1(r) with z = n ln 2 + r, |r| <= ln(2)/2, for |z| <= 708."""
    rounded = z * _LOG2E + _ROUND
    n = rounded - _ROUND
    r = (z - n * _LN2_HIGH) - n * _LN2_LOW
    # sum_{k=2}^{13} r^(k-2) / k!, in Estrin's order: short chains of dependent operations.
    r2 = r * r
    r4 = r2 * r2
    low = (0.5 + r * (1 / 6)) + r2 * ((1 / 24) + r * (1 / 120))
    middle = (1 / 720 + r * (1 / 5040)) + r2 * (1 / 40320 + r * (1 / 362880))
    high = (1 / 3628800 + r * (1 / 39916800)) + r2 * (1 / 479001600 + r * (1 / 6227020800))
    q = low + r4 * (middle + r4 * high)
    power = np.int64((np.float64(rounded).view(np.int64) + 1023) << 52).view(np.float64)
    return power, r + r2 * q


@jit
def tanh(x):
    """Hyperbolic tangent, within 4 units in the last place, without a branch.

    Unlike libm's it can be vectorised: expm1 by reduction and a Taylor polynomial of degree 13,
    then tanh x = expm1(2x) / (expm1(2x) + 2). NaN stays NaN.
    """
    z = abs(x)
    power, rest = _reduced(2.0 * (20.0 if z > 20.0 else z))
    expm1 = power * rest + (power - 1.0)
    return math.copysign(expm1 / (expm1 + 2.0), x)


@jit
def exp(x):
    """Exponential, within 4 units in the last place for |x| <= 700, limited beyond; see tanh."""
    z = 700.0 if x > 700.0 else x
    z = -700.0 if z < -700.0 else z
    power, rest = _reduced(z)
    return power + power * rest


@jit
def fetch(lanes, source, given, out):
    """Copy the inputs of each cell, all lanes of cell ``source[cell]``."""
    if lanes == 1:
        for cell in range(len(source)):
            out[cell] = given[source[cell]]
    else:
        for cell in range(len(source)):
            begin = source[cell] * lanes
            there, here = given[begin:begin + lanes], out[cell * lanes:(cell + 1) * lanes]
            for lane in range(lanes):
                here[lane] = there[lane]

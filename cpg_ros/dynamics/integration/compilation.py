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

"""Compilation of the numerical kernels of feedback and simulation by numba.

It is loaded when the first kernel runs; without feedback, the generator needs none. Without it,
kernels are plain Python, too slow for feedback.
"""

from contextlib import AbstractContextManager, nullcontext
from functools import cached_property, update_wrapper
from importlib.util import find_spec
import math

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

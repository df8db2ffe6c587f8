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

"""The numerical kernels as plain Python, where numba is missing: what machine_code has, as is."""

from contextlib import contextmanager
from functools import wraps
import math

prange = range


def jit(function):
    """Return the function."""
    return function


inline = jit


def jit_entry(function):
    """Return the function; where its arguments have no result that is not a number, as in C."""
    @wraps(function)
    def call(*arguments):
        try:
            return function(*arguments)
        except (ArithmeticError, ValueError):
            return math.nan
    return call


def cached_on_disk(function, folder, **options):
    """Return the function; nothing is compiled that could be kept."""
    return function


def specialised(kernel, *arguments):
    """Return the function, which takes arguments of any types."""
    return kernel


@contextmanager
def on_compile(compiling):
    """Compile nothing, and so give no notice of it."""
    yield

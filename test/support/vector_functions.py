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

"""The elementary functions of ``c/vector.c``, one by one and in a loop."""

import ctypes
from functools import cache

from cpg_ros.common.c_library import load
from cpg_ros.dynamics.integration.c_kernel import NATIVE
from cpg_ros.dynamics.integration.c_text import part
import numpy as np

LOOP = """
void all_{0}(int n, const double *x, double *out)
{{
    for (int i = 0; i < n; i++) {{
        out[i] = vector_{0}(x[i]);
    }}
}}
"""


@cache
def _library():
    text = part('vector.c') + ''.join(LOOP.format(name) for name in ('tanh', 'exp'))
    return load(None, 'vector', lambda: {'vector.c': text}, 'the functions', NATIVE)


def over(name, values):
    """Return a function of values in a loop, where the compiler takes several at a time."""
    values = np.ascontiguousarray(values, dtype=float)
    out = np.empty_like(values)
    getattr(_library(), f'all_{name}')(values.size, *(ctypes.c_void_p(array.ctypes.data)
                                                      for array in (values, out)))
    return out


def tanh(x):
    return float(over('tanh', [x])[0])


def exp(x):
    return float(over('exp', [x])[0])

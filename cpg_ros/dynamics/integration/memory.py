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

"""Memory and functions of C by their addresses; compiled kernels have them as machine code."""

import ctypes


def number_at(address: int) -> float:
    """Return the double at an address."""
    return ctypes.c_double.from_address(int(address)).value


def whole_at(address: int) -> int:
    """Return the 64-bit integer, such as a pointer, at an address."""
    return ctypes.c_int64.from_address(int(address)).value


def call_at(function: int, struct: int, number: float) -> int:
    """Call a C function of a pointer and a double; return its int, arbitrary if it is void."""
    kind = ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_void_p, ctypes.c_double)
    return int(kind(int(function))(int(struct), number))

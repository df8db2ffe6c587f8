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

"""Machine code of the numerical kernels, compiled by numba and cached on disk."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from cpg_ros.common.cache_folder import writing
from cpg_ros.dynamics.integration import memory
from cpg_ros.networks import equations
from llvmlite import ir
from numba import config, njit, typeof
from numba.core import event, types
from numba.core.caching import FunctionCache
from numba.core.ccallback import CFunc
from numba.extending import intrinsic, overload

__all__ = ['jit', 'jit_entry', 'jit_for_python', 'machine_function', 'on_compile', 'specialised']

#: No division checks (they keep loops from being vectorised), fused multiply-add allowed,
#: and the interpreter lock released: the publishing thread must not wait for parameters.
OPTIONS: dict[str, Any] = {'error_model': 'numpy', 'fastmath': {'contract'}, 'nogil': True}

#: For functions that kernels call, without the wrapper for Python: with many arguments it takes
#: longer to compile than the function.
jit = njit(**{**OPTIONS, 'no_cpython_wrapper': True, 'no_cfunc_wrapper': True})
jit_for_python = njit(**OPTIONS)


class _Disk(FunctionCache):
    """Cache of machine code on disk, skipped if the disk is full, at which numba would fail."""

    def save_overload(self, sig, data):
        with writing():
            super().save_overload(sig, data)


def _disk(function, folder: Path) -> _Disk:
    """Return a function's cache in a folder."""
    # Read here and now: what others compile with numba is kept where it was.
    numba: Any = config
    others, numba.CACHE_DIR = numba.CACHE_DIR, str(folder)
    try:
        return _Disk(function)
    finally:
        numba.CACHE_DIR = others


def jit_entry(function):
    """Compile an entry point of the package on its first call, and cache its machine code."""
    compiled, folder = njit(**OPTIONS)(function), equations.folder()
    if folder is not None:
        compiled._cache = _disk(function, folder)
        # Where the folder cannot be written numba tries others, whose code may be out of date.
        if not Path(compiled.stats.cache_path).is_relative_to(folder):
            return jit_for_python(function)
    return compiled


def specialised(kernel, *arguments):
    """Return a kernel's machine code for arguments like these."""
    return kernel.compile(tuple(typeof(argument) for argument in arguments))


def machine_function(function, arguments: tuple) -> Any:
    """Compile a function of a pointer to arguments like these for C; it has an ``address``."""
    folder = equations.folder()
    kind = (types.CPointer(typeof(arguments)),), types.int64
    compiled: Any = CFunc(function, kind, {}, OPTIONS)
    if folder is not None:
        compiled._cache = _disk(function, folder)
    compiled.compile()
    return compiled


def _reads(function: Callable, kind: Any) -> None:
    """Compile a function of an address that reads a number of a kind there."""
    def read(_, address):
        def code(target, builder, signature, arguments):
            pointer = target.get_value_type(kind).as_pointer()
            return builder.load(builder.inttoptr(arguments[0], pointer))
        return kind(types.int64), code
    reading: Any = intrinsic(read)
    overload(function)(lambda address: lambda address: reading(address))


def _call(_, function, struct, number):
    def code(target, builder, signature, arguments):
        whole = ir.IntType(32)
        kind = ir.FunctionType(whole, [ir.IntType(64), ir.DoubleType()])
        return builder.call(builder.inttoptr(arguments[0], kind.as_pointer()), arguments[1:])
    return types.int32(types.int64, types.int64, types.float64), code


_called: Any = intrinsic(_call)
_reads(memory.number_at, types.float64)
_reads(memory.whole_at, types.int64)
overload(memory.call_at)(lambda function, struct, number: (
    lambda function, struct, number: _called(function, struct, number)))


class _Notice(event.Listener):
    """Calls a function at each compilation."""

    def __init__(self, compiling: Callable[[], None]) -> None:
        self._compiling = compiling

    def on_start(self, event: event.Event) -> None:
        self._compiling()

    def on_end(self, event: event.Event) -> None:
        """Announce nothing: the compilation was announced at its start."""


@contextmanager
def on_compile(compiling: Callable[[], None]) -> Iterator[None]:
    """Call a function before each compilation of a function that is not in the cache."""
    with event.install_listener('numba:compile', _Notice(compiling)):
        yield

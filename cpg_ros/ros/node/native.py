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

"""The part of a tick outside the interpreter: ``tick.c``, compiled, and middleware functions.

Calls into the library release the interpreter's lock.
"""

import ctypes
from functools import cache
import hashlib
from pathlib import Path
import platform
from typing import Any

from cpg_ros.common.c_library import load
from cpg_ros.common.cache_folder import cache_folder
from cpg_ros.common.errors import CpgError
from rclpy.impl.implementation_singleton import rclpy_implementation

_SOURCE = Path(__file__).with_name('tick.c')


def _fields(*fields: tuple[Any, str]) -> list[tuple[str, Any]]:
    """Return the fields of a struct, from pairs of a type and names."""
    return [(name, kind) for kind, names in fields for name in names.split()]


_POINTER, _LONG, _INT = ctypes.c_void_p, ctypes.c_int64, ctypes.c_int32


class Serialized(ctypes.Structure):
    """``rcutils_uint8_array_t``."""

    _fields_ = _fields((_POINTER, 'buffer'), (ctypes.c_size_t, 'length capacity'),
                       (5 * _POINTER, 'allocator'))


class SerializedMessages(ctypes.Structure):
    """The struct ``block`` of ``tick.c``."""

    _fields_ = _fields((_POINTER, 'send publisher message memory words place source'),
                       (_LONG, 'messages changes'))


class Counters(ctypes.Structure):
    """The struct ``counters`` of ``tick.c``."""

    _fields_ = _fields((_LONG, 'ticks late dropped worst'), (_INT, 'resuming attend stopping'))


class Output(ctypes.Structure):
    """The struct ``output`` of ``tick.c``: a block, and addresses of its parts' numbers."""

    _fields_ = _fields((_POINTER, 'to from sizes'), (_LONG, 'parts every since quiet'),
                       (_POINTER, 'while_not_0'), (ctypes.c_double, 'first'))


class Input(ctypes.Structure):
    """The struct ``input`` of ``tick.c``."""

    _fields_ = _fields((_POINTER, 'subscription'), (Serialized, 'message'),
                       (_POINTER, 'sample same place values stamp news'),
                       (_LONG, 'ranges count depth length'), (_INT, 'stamped unread'))


class Copy(ctypes.Structure):
    """The struct ``copy`` of ``tick.c``."""

    _fields_ = _fields((_POINTER, 'to from'), (_LONG, 'size'))


class Correction(ctypes.Structure):
    """The struct ``correction`` of ``tick.c``."""

    _fields_ = _fields((_POINTER, 'close finish arguments report plan move take forget numbers '
                        'gaits inputs resets'), (_LONG, 'count parts'))


class Simulated(ctypes.Structure):
    """The struct ``simulated`` of ``tick.c``."""

    _fields_ = _fields((_POINTER, 'subscription set clear add wait take forget'),
                       (Serialized, 'message'), (_LONG, 'time step moved deadline'))


class Loop(ctypes.Structure):
    """The struct ``loop`` of ``tick.c``."""

    _fields_ = _fields((_POINTER, 'count attend advance resume what'),
                       (_LONG, 'deadline period stall stamp behind'),
                       (_POINTER, 'offset clock correct'), (4 * _POINTER, 'outputs'),
                       (_INT, 'due'))


class _ErrorText(ctypes.Structure):
    """``rcutils_error_string_t``."""

    _fields_ = (('text', 1024 * ctypes.c_char),)


#: What ``run`` of ``tick.c`` leaves to Python.
ATTEND, RESUME, TICK, RESTART, REFUSED = range(1, 6)


@cache
def library() -> ctypes.CDLL:
    """Return the library.

    Raises:
        NoCompiler: it is not in the cache, and cannot be compiled.

    """
    text = _SOURCE.read_text()
    key = hashlib.sha256(f'{platform.machine()}{text}'.encode()).hexdigest()[:14]
    loaded = load(cache_folder(f'tick-{key}'), 'tick', lambda: {_SOURCE.name: text}, _SOURCE.name)
    whole = ctypes.c_int64
    loaded.publish.argtypes, loaded.publish.restype = (ctypes.c_void_p, whole, whole), whole
    for name in ('run', 'sense', 'tick'):
        getattr(loaded, name).argtypes = ctypes.c_void_p,
    loaded.read_input.argtypes = ctypes.c_void_p, ctypes.c_char_p, whole
    return loaded


@cache
def _allocator() -> Any:
    """Return the middleware's memory allocator, as in Serialized."""
    default = ctypes.CDLL(rclpy_implementation.__file__).rcutils_get_default_allocator
    default.restype = type('Allocator', (ctypes.Structure,), {
        '_fields_': [('functions', 5 * ctypes.c_void_p)]})
    return default().functions


def empty_message() -> Serialized:
    """Return a serialised message that the middleware enlarges as needed."""
    return Serialized(allocator=_allocator())


def address(function: str) -> int | None:
    """Return the address of a function of rcl, to which rclpy's own library is linked."""
    linked = ctypes.CDLL(rclpy_implementation.__file__)
    return ctypes.cast(getattr(linked, function), ctypes.c_void_p).value


class MiddlewareError(CpgError):
    """The middleware refuses a message."""


def middleware_error() -> MiddlewareError:
    """Return the error that the middleware has set in this thread, which is cleared."""
    linked = ctypes.CDLL(rclpy_implementation.__file__)
    linked.rcutils_get_error_string.restype = _ErrorText
    text = linked.rcutils_get_error_string().text.decode(errors='replace')
    linked.rcutils_reset_error()
    return MiddlewareError(f'a message cannot be published: {text}')

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


class Serialized(ctypes.Structure):
    """``rcutils_uint8_array_t``."""

    _fields_ = (('buffer', ctypes.c_void_p), ('length', ctypes.c_size_t),
                ('capacity', ctypes.c_size_t), ('allocator', 5 * ctypes.c_void_p))


class SerializedMessages(ctypes.Structure):
    """The struct ``block`` of ``tick.c``."""

    _fields_ = (*((name, ctypes.c_void_p) for name in (
        'send', 'publisher', 'message', 'memory', 'words', 'place', 'source')),
        ('messages', ctypes.c_int64), ('changes', ctypes.c_int64))


class Counters(ctypes.Structure):
    """The struct ``counters`` of ``tick.c``."""

    _fields_ = (*((name, ctypes.c_int64) for name in ('ticks', 'late', 'dropped', 'worst')),
                *((name, ctypes.c_int32) for name in ('resuming', 'wanted', 'stopping')))


class Output(ctypes.Structure):
    """The struct ``output`` of ``tick.c``: a block, and addresses of its parts' numbers."""

    _fields_ = (*((name, ctypes.c_void_p) for name in ('to', 'from', 'sizes')),
                *((name, ctypes.c_int64) for name in ('parts', 'every', 'since', 'quiet')),
                ('while_not_0', ctypes.c_void_p), ('first', ctypes.c_double))


class Input(ctypes.Structure):
    """The struct ``input`` of ``tick.c``."""

    _fields_ = (('subscription', ctypes.c_void_p), ('message', Serialized),
                *((name, ctypes.c_void_p) for name in (
                    'known', 'same', 'place', 'values', 'stamp', 'news')),
                *((name, ctypes.c_int64) for name in ('ranges', 'count', 'depth', 'length')),
                ('stamped', ctypes.c_int32), ('unread', ctypes.c_int32))


class Copy(ctypes.Structure):
    """The struct ``copy`` of ``tick.c``."""

    _fields_ = ('to', ctypes.c_void_p), ('from', ctypes.c_void_p), ('size', ctypes.c_int64)


class Correction(ctypes.Structure):
    """The struct ``correction`` of ``tick.c``."""

    _fields_ = (*((name, ctypes.c_void_p) for name in (
        'close', 'finish', 'arguments', 'report', 'plan', 'follow', 'take', 'forget', 'numbers',
        'gaits', 'inputs', 'resets')), ('count', ctypes.c_int64), ('parts', ctypes.c_int64))


class Simulated(ctypes.Structure):
    """The struct ``simulated`` of ``tick.c``."""

    _fields_ = (*((name, ctypes.c_void_p) for name in (
        'subscription', 'set', 'clear', 'add', 'wait', 'take', 'forget')),
                ('message', Serialized),
                *((name, ctypes.c_int64) for name in ('time', 'step', 'moved', 'deadline')))


class Loop(ctypes.Structure):
    """The struct ``loop`` of ``tick.c``."""

    _fields_ = (*((name, ctypes.c_void_p) for name in (
        'count', 'asked', 'advance', 'resume', 'what')),
                *((name, ctypes.c_int64) for name in (
                    'deadline', 'period', 'stall', 'stamp', 'behind')),
                *((name, ctypes.c_void_p) for name in ('offset', 'clock', 'correct')),
                ('outputs', 4 * ctypes.c_void_p), ('due', ctypes.c_int32))


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
    for name in ('run', 'sense', 'tick', 'publish_outputs'):
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

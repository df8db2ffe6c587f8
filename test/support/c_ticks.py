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

"""Ticks of a pattern and its feedback by ``tick.c``, on messages that a test brings."""

import ctypes

from cpg_ros.motion.pattern import Pattern
from cpg_ros.ros.feedback.loop import SensorLoop
from cpg_ros.ros.node import native

#: Return code of rcl if no message waits.
NOTHING_TAKEN = 401


class CTicks:
    """The ticks of a generator without its topics.

    Attributes:
        learnt: messages of a new layout so far.

    """

    def __init__(self, pattern: Pattern, loop: SensorLoop, dt: float) -> None:
        """Tick every dt in s; the loop's subscriptions have a method ``newest``."""
        self.learnt, self._loop, self._kept = 0, loop, {}
        addresses = pattern.addresses
        self._correction = loop.compiled()
        self._taking = ctypes.CFUNCTYPE(
            ctypes.c_int, ctypes.c_size_t, ctypes.POINTER(native.Serialized), ctypes.c_void_p,
            ctypes.c_void_p)(self._take)
        self._correction.take = ctypes.cast(self._taking, ctypes.c_void_p).value
        for k, struct in enumerate(loop.inputs.structs):
            struct.subscription, struct.depth = k + 1, 1
        self._native = native.Loop(
            **{name: addresses[name] for name in ('advance', 'resume', 'what')},
            period=round(1e9 * dt), correct=ctypes.addressof(self._correction))

    def _take(self, number, message, *_):
        data = self._loop.inputs.inputs[number - 1].messages.newest()
        if data is None:
            return NOTHING_TAKEN
        self._kept[number] = data
        message[0].buffer = ctypes.cast(ctypes.c_char_p(data), ctypes.c_void_p).value
        message[0].length = len(data)
        return 0

    def tick(self, stamp: int) -> None:
        """Take the messages, and do a tick of a stamp in ns."""
        self._loop.renew()
        if not native.library().sense(ctypes.byref(self._correction)):
            self.learnt += 1
            self._loop.inputs.read()
        self._native.stamp = stamp
        native.library().tick(ctypes.byref(self._native))

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

"""What is wrong with a robot's state, in words; each of it lets the joints go at once."""

import math

from cpg_ros.unitree.low_cmd import DRIVEN
from cpg_ros.unitree.low_state import LowState
from cpg_ros.unitree.settings import Settings

#: Packets that a motor may lose while the bridge drives it.
MOST_LOST = 100


class Dangers:
    """Looks at a state for what no motion is safe with."""

    def __init__(self, settings: Settings, state: LowState) -> None:
        """Look at ``state`` whenever asked, against the limits of ``settings``."""
        self._settings, self._state = settings, state
        self._lower = settings.lower - settings.margin
        self._upper = settings.upper + settings.margin
        self._upright = math.cos(settings.tilt)
        self.begin()

    def begin(self) -> None:
        """Take the motors' modes and lost packets as they are now."""
        self._modes, self._lost = self._state.modes, self._state.lost.copy()

    def found(self) -> str:
        """Return what is dangerous, or ''."""
        state, settings = self._state, self._settings
        q = state.q
        # One look is enough for all: a sum is finite only where every number is.
        if not math.isfinite(float(q.sum()) + float(state.dq.sum())):
            return "a joint's angle or speed is not a number"
        upright = state.tilt_cosine
        if not upright >= self._upright:
            return ('the IMU gives no orientation' if math.isnan(upright) else
                    f'the body leans by {math.degrees(math.acos(max(-1.0, upright))):.0f} degrees')
        outside = (q < self._lower) | (q > self._upper)
        if outside.any():
            worst = int(outside.argmax())
            return (f'{settings.names[worst]} is at {q[worst]:.2f} rad, beyond its limits '
                    f'{settings.lower[worst]:.2f} to {settings.upper[worst]:.2f}')
        hot = int(state.temperature.argmax())
        if state.temperature[hot] >= settings.hottest:
            return f'the motor of {settings.names[hot]} has {state.temperature[hot]} deg C'
        modes, before = state.modes, self._modes
        self._modes = modes
        if modes != before:
            for name, now, then in zip(settings.names, modes, before, strict=True):
                if then == DRIVEN != now:
                    return f'the motor of {name} has stopped by itself: mode {now}'
        # Unsigned: a counter that began anew is a motor that did.
        lost = state.lost - self._lost
        if lost.max() > MOST_LOST:
            worst = int(lost.argmax())
            return f'the motor of {settings.names[worst]} does not hear the robot any more'
        return ''

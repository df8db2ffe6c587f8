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

"""Checks of a robot's state; a fault that they find damps the joints at once."""

import math

from cpg_ros.safety.bridge_settings import BridgeSettings
from cpg_ros.safety.robot_state import RobotState


class SafetyChecks:
    """Checks a state for everything that makes any motion unsafe."""

    def __init__(self, settings: BridgeSettings, state: RobotState) -> None:
        """Check ``state`` against the limits of ``settings``."""
        self._settings, self._state = settings, state
        self._lower = settings.lower - settings.margin
        self._upper = settings.upper + settings.margin
        self._upright = math.cos(settings.tilt)

    def reset(self) -> None:
        """Compare motors with their state as it is now."""
        self._state.reset_motor_faults()

    def fault(self) -> str:
        """Return the first fault found, or ''."""
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
        if state.temperature.size:
            hot = int(state.temperature.argmax())
            if state.temperature[hot] >= settings.hottest:
                return f'the motor of {settings.names[hot]} has {state.temperature[hot]} deg C'
        return state.motor_fault()

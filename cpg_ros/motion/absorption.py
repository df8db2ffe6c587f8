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

"""Absorb jumps of a network's output: the difference decays smoothly."""

from cpg_ros.motion.smoothstep import smoothstep
import numpy as np

#: Jumps are absorbed over this time (s).
ABSORB = 0.3


class Absorption:
    """What is left of a jump of joint positions and velocities."""

    def __init__(self) -> None:
        self._jump: tuple[np.ndarray, np.ndarray] | None = None
        self._time = ABSORB

    @property
    def active(self) -> bool:
        """Tell whether a jump is being absorbed."""
        return self._time < ABSORB

    def begin(self) -> None:
        """Mark a jump of the output here; the next ``smooth`` measures it."""
        self._jump, self._time = None, 0.0

    def smooth(self, wanted: np.ndarray, rate: np.ndarray, dt: float,
               before: tuple[np.ndarray, np.ndarray]) -> tuple[np.ndarray, np.ndarray]:
        """Add a difference that starts where the output was and decays.

        Args:
            wanted: positions, rad, (joints,).
            rate: their velocities, rad/s.
            dt: since the last time, s.
            before: what was returned then.

        """
        if self._jump is None:
            self._jump = (before[0] + dt * before[1] - wanted, before[1] - rate)
        else:
            self._time += dt
        s = min(1.0, self._time / ABSORB)
        share, share_rate = smoothstep(s)
        gap, gap_rate = self._jump
        wanted = wanted + (1.0 - share) * gap + s * (1.0 - s) ** 2 * ABSORB * gap_rate
        rate = rate - share_rate / ABSORB * gap + (1.0 - s) * (1.0 - 3.0 * s) * gap_rate
        return wanted, rate

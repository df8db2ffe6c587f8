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

"""Resume a pattern's clock after a stall: from where it stopped, slowed at first."""

from cpg_ros.motion.smoothstep import smoothstep

#: A joint whose command stood still for this time (s) has come to rest.
HOLD = 0.1
#: The clock is slowed in for as long as the stall was, but no longer than this (s).
LONGEST = 0.5


class Resumption:
    """The pace of a clock: 1, and less after a stall."""

    def __init__(self) -> None:
        self._time = self._past = self._low = 0.0

    @property
    def active(self) -> bool:
        """Whether the clock is being slowed in."""
        return self._time > 0.0

    def begin(self, stall: float) -> None:
        """Slow the clock in after a stall in s: the longer, the more the joints have stopped."""
        share = self._share(self._past / self._time) if self.active else 1.0
        self._low = share * max(0.0, 1.0 - stall / HOLD)
        self._time = min(LONGEST, stall + self._time - self._past)
        self._past = 0.0

    def _share(self, s: float) -> float:
        return self._low + (1.0 - self._low) * smoothstep(s)[0]

    def advance(self, dt: float) -> tuple[float, float]:
        """Return how far the clock goes in dt, s, and its pace at the end of it."""
        time, low = self._time, self._low
        before, after = self._past / time, min(1.0, (self._past + dt) / time)
        # The integral of the smooth step.
        risen = after**3 * (1.0 - 0.5 * after) - before**3 * (1.0 - 0.5 * before)
        way = time * (low * (after - before) + (1.0 - low) * risen)
        way += max(0.0, self._past + dt - time)
        self._past += dt
        if after == 1.0:
            self._time = self._past = 0.0
        return way, self._share(after)

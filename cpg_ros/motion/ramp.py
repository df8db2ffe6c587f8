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

"""The ramp of a pattern between the stand and its gait, or to the stand: a level from 0 to 1."""

from collections import deque

from cpg_ros.motion.smoothstep import smoothstep


class Ramp:
    """A level and its rate, on the way to its target.

    Attributes:
        level: 0 at the stand, 1 in the full gait, or where the joints were found.
        rate: its derivative, 1/s of the pattern's clock.

    """

    def __init__(self, level: float = 0.0) -> None:
        """Rest at a level."""
        self.level, self.rate = level, 0.0
        self._parts: deque[tuple[float, float, float, float]] = deque()
        self._past = 0.0

    @property
    def active(self) -> bool:
        """Whether the level is on its way."""
        return bool(self._parts)

    def go(self, end: float, time: float) -> None:
        """Plan the level's way to its end in s, from its present value and rate, no overshoot.

        Cubics that end at rest, each (start, rate, end, time). One that starts towards its end
        stays in between if it takes no longer than 3 |end - start| / |rate|.
        """
        level, rate = self.level, self.rate
        self._parts.clear()
        self._past = 0.0
        if rate * (end - level) < 0.0:
            # Turned round half way: brake first, within half of the room that is left.
            turn = level + 0.5 * ((1.0 if rate > 0.0 else 0.0) - level)
            self._parts.append((level, rate, turn, 2.0 * (turn - level) / rate))
            level, rate = turn, 0.0
        if rate:
            time = min(time, 3.0 * (end - level) / rate)
        self._parts.append((level, rate, end, time))

    def advance(self, clock: float) -> None:
        """Advance by a time in s."""
        start, start_rate, end, time = self._parts[0]
        self._past += clock
        s = self._past / time if time > 0.0 else 1.0
        if s >= 1.0:
            self._parts.popleft()
            self._past = 0.0
            self.level, self.rate = end, 0.0
            return
        share, share_rate = smoothstep(s)
        self.level = start + share * (end - start) + s * (1.0 - s)**2 * time * start_rate
        self.rate = share_rate * (end - start) / time + (1.0 - s) * (1.0 - 3.0 * s) * start_rate

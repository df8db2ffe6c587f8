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

"""The angles that a generator asks for, and the way between one command and the next."""

import numpy as np

#: A target may be this far from the one before at once, rad, beside what joints do in the time.
LEAP = 0.05
#: Longest time between two targets that is bridged, or that excuses a leap, s.
LONGEST = 0.05


class Targets:
    """Angles wanted, led in straight lines from command to command.

    A command is reached as long after it has come as it came after the one before, so that a
    generator of 100 Hz moves joints as evenly as one of 500 Hz. What comes every period is taken
    at once.

    Attributes:
        fresh: when the last one was taken, s; -inf for never.
        refused: why the last one was not taken; '' if it was.

    """

    def __init__(self, names: tuple[str, ...], lower: np.ndarray, upper: np.ndarray,
                 velocity: np.ndarray, period: float) -> None:
        """Be ready; all arrays are of shape (joints,).

        Args:
            names: of the joints.
            lower: least angles, rad; targets are taken to the nearest within.
            upper: largest angles, rad.
            velocity: what joints can do, rad/s.
            period: between two calls of ``at``, s.

        """
        self._names, self._lower, self._upper = names, lower, upper
        self._velocity, self._period = velocity, period
        self.forget()

    def forget(self) -> None:
        """Be as before the first target."""
        self._from = self._to = np.zeros(0)
        self._began = self._heard = self.fresh = -np.inf
        self._span, self.refused = 0.0, ''

    def take(self, target: np.ndarray, now: float) -> None:
        """Take a target, rad, that has come now, s, unless no joint could follow it."""
        gap, self._heard = now - self._heard, now
        target = np.minimum(np.maximum(target, self._lower), self._upper)
        if self.fresh > -np.inf:
            leap = np.abs(target - self._to) - self._velocity * min(gap, LONGEST) - LEAP
            worst = int(leap.argmax())
            if not leap[worst] <= 0.0:
                self.refused = (f'the target of {self._names[worst]} leapt by '
                                f'{abs(target[worst] - self._to[worst]):.2f} rad')
                return
            self._from = self.at(now)
            self._span = min(gap, LONGEST) if gap > 1.5 * self._period else 0.0
        self._to, self._began, self.fresh, self.refused = target, now, now, ''

    def at(self, now: float) -> np.ndarray:
        """Return where the joints should be, rad, shape (joints,); after the first target."""
        if now - self._began >= self._span:
            return self._to
        share = (now - self._began) / self._span
        return self._from + share * (self._to - self._from)

    def reached(self, now: float) -> float:
        """Return how long the joints have been where the last target wants them, s."""
        return now - self._began - self._span

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

"""The target angles of a generator, interpolated from one to the next."""

import numpy as np

#: A target may differ from the one before by this much, rad, beyond what the joints can move
#: in the time between.
LEAP = 0.05
#: Longest time between two targets over which they are interpolated, or that allows for a jump,
#: s.
LONGEST = 0.05


class Targets:
    """Target angles with linear interpolation between them.

    A target is reached as long after its arrival as it arrived after the one before, so that a
    generator of 100 Hz moves joints as evenly as one of 500 Hz. Targets that arrive every period
    are used at once.

    Attributes:
        accepted: time of the last accepted target, s; -inf for none.
        rejection: why the last target was rejected; '' if it was accepted.

    """

    def __init__(self, names: tuple[str, ...], lower: np.ndarray, upper: np.ndarray,
                 velocity: np.ndarray, period: float) -> None:
        """Start without a target; all arrays have shape (joints,).

        Args:
            names: of the joints.
            lower: smallest angles, rad; targets are clipped to the limits.
            upper: largest angles, rad.
            velocity: largest speeds of the joints, rad/s.
            period: between two calls of ``at``, s.

        """
        self._names, self._lower, self._upper = names, lower, upper
        self._velocity, self._period = velocity, period
        self.reset()

    def reset(self) -> None:
        """Discard all targets."""
        self._from = self._to = np.zeros(0)
        self._began = self._received = self.accepted = -np.inf
        self._span, self.rejection = 0.0, ''

    def add(self, target: np.ndarray, now: float) -> None:
        """Add a target, rad, that arrived now, s; reject one that the joints could not follow."""
        gap, self._received = now - self._received, now
        target = np.minimum(np.maximum(target, self._lower), self._upper)
        if self.accepted > -np.inf:
            leap = np.abs(target - self._to) - self._velocity * min(gap, LONGEST) - LEAP
            worst = int(leap.argmax())
            if not leap[worst] <= 0.0:
                self.rejection = (f'the target of {self._names[worst]} leapt by '
                                  f'{abs(target[worst] - self._to[worst]):.2f} rad')
                return
            self._from = self.at(now)
            self._span = min(gap, LONGEST) if gap > 1.5 * self._period else 0.0
        self._to, self._began, self.accepted, self.rejection = target, now, now, ''

    def at(self, now: float) -> np.ndarray:
        """Return the angles for now, rad, shape (joints,); only after the first target."""
        if now - self._began >= self._span:
            return self._to
        share = (now - self._began) / self._span
        return self._from + share * (self._to - self._from)

    def time_at_target(self, now: float) -> float:
        """Return how long the last target has been reached, s."""
        return now - self._began - self._span

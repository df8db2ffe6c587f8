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

"""Monitoring of the feedback's inputs: whether each is valid, or since when it is not."""

import math

from cpg_ros.motion.smoothstep import smoothstep

#: An input is out after this time without a valid message, s.
STALE = 0.05
#: A stamp that is older, or further ahead, than this, s.
DELAYED = 0.1
#: Largest age of measurements, low-passed, when they are used, s: that of a quadruped's gaits, and
#: of a balanced walk, each below the delay at which it falls in simulation.
LATE, LATE_BALANCE = 0.03, 0.012
#: Time constant of that low-pass, s; an input that is late counts as good again below this share.
AGE_MEMORY, IN_TIME = 0.1, 0.9
#: From full feedback to none, and from none to full once all inputs have been good for a while, s.
FADE, GOOD = 0.15, 0.3


class InputMonitor:
    """Monitors the age of one input and the faults of its messages.

    Attributes:
        name: of the input.
        believed: when its last valid message came, s; -inf before the first one.
        since: when it went out, s; NaN while it is in.
        age: of its newest measurement when it is used, by its stamp, low-passed, s; NaN where
            messages have no stamps, and before the first one.

    """

    def __init__(self, name: str, latest: float = math.inf) -> None:
        """Monitor an input of which measurements count up to an age in s."""
        self.name, self._latest = name, latest
        self.restart()

    def restart(self) -> None:
        """Forget all messages."""
        self.believed, self.since = -math.inf, math.nan
        self._changed, self._content, self._wrong = -math.inf, b'', ''
        self._came = self._measured = -math.inf
        self._used = self.age = math.nan
        self._late = False

    @property
    def refused(self) -> bool:
        """Whether messages have come, none of them valid."""
        return self.believed == -math.inf and bool(self._wrong)

    def gap(self, now: float) -> float:
        """Time since the last valid message, s, at most 1."""
        return min(now - self.believed, 1.0)

    def interval(self, now: float) -> float:
        """Time since the last message, valid or not, s, at most 1."""
        return min(now - self._came, 1.0)

    def note(self, now: float, stamp: float | None, content: bytes, wrong: str = '',
             patience: float = 0.0) -> None:
        """Record a new message.

        Args:
            now: s.
            stamp: of the message, the same clock's, s; None if it has none.
            content: its numbers as bytes.
            wrong: what is wrong with them, '' for nothing.
            patience: for how long the same numbers may come again, s.

        """
        self._came = now
        if content != self._content:
            self._content, self._changed = content, now
        elif now > self._changed + patience:
            wrong = wrong or 'the same numbers again and again'
        if stamp is not None and not abs(now - stamp) <= DELAYED:
            late = now - stamp
            wrong = (f'stamps {late:.2f} s old' if late > 0.0 else
                     f'stamps {-late:.2f} s ahead: are the clocks of both computers the same?')
        self._wrong = wrong
        if not wrong:
            self.believed = now
            self._measured = -math.inf if stamp is None else stamp

    def _is_late(self, now: float) -> bool:
        """Update the age of what is used now, s; tell whether it is too large."""
        if self._measured == -math.inf:
            return False
        age = max(now - self._measured, 0.0)
        if math.isnan(self.age):
            self.age = age
        else:
            self.age += min((now - self._used) / AGE_MEMORY, 1.0) * (age - self.age)
        self._used = now
        self._late = self.age > self._latest * (IN_TIME if self._late else 1.0)
        return self._late

    def fault(self, now: float) -> str:
        """Say why the input is out, or ''."""
        stale = now - self.believed > STALE
        late = not stale and self._is_late(now)
        if stale:
            # What comes after a gap is as old as it is, whatever was before.
            self.age, self._late = math.nan, False
        if not (late or stale):
            self.since = math.nan
            return ''
        if math.isnan(self.since):
            self.since = now
        if not stale:
            return (f'the measurement is {1e3 * self.age:.0f} ms old when it is used, more than '
                    f'feedback.max_delay, {1e3 * self._latest:.0f} ms')
        return self._wrong or ('no message yet' if self.believed == -math.inf else 'no messages')


class Fade:
    """The share of the feedback: smoothly to 0 where an input is out, and back."""

    def __init__(self) -> None:
        self._way, self._good = 0.0, 0.0

    def advance(self, good: bool, dt: float) -> float:
        """Return the share dt in s later; good if all inputs are valid."""
        self._good = self._good + dt if good else 0.0
        if self._good >= GOOD or (good and self._way >= 1.0):
            self._way = min(1.0, self._way + dt / FADE)
        else:
            # Also where a good message comes between bad ones.
            self._way = max(0.0, self._way - dt / FADE)
        return smoothstep(self._way)[0]

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

"""Who may move a robot: at most one holder at a time, and anybody can take over."""

from collections.abc import Hashable

from cpg_ros.errors import CpgError

#: A holder that has been silent for this long has lost the lease, s.
SILENCE = 2.0


class LeaseError(CpgError):
    """Another page has control of the robot; one line for the sender of the command."""


class Lease:
    """A robot's lease.

    Attributes:
        holder: who may move the robot, None if nobody has the lease.
        confirmed: ids of the other publishers beside which the holder has chosen to steer.

    """

    def __init__(self) -> None:
        self.holder: Hashable | None = None
        self.confirmed: frozenset[bytes] = frozenset()
        self._heard = 0.0

    def acquire(self, who: Hashable, now: float) -> None:
        """Give the lease to ``who``, if it is free or already theirs; now is in s.

        Raises:
            LeaseError: another has it.

        """
        if self.holder is None:
            self._pass_to(who, frozenset())
        elif self.holder != who:
            raise LeaseError(f'{self.holder} has control of the robot: take over first')
        self._heard = now

    def take_over(self, who: Hashable, now: float,
                  others: frozenset[bytes] = frozenset()) -> Hashable | None:
        """Give the lease to ``who`` in any case, confirming these other publishers.

        Returns:
            The former holder, None if there was no other.

        """
        lost = None if self.holder == who else self.holder
        self._pass_to(who, others)
        self._heard = now
        return lost

    def renew(self, who: Hashable, now: float) -> None:
        """Record a sign of life of the holder."""
        if who == self.holder:
            self._heard = now

    def release(self, who: Hashable) -> bool:
        """Give the lease back; return whether ``who`` held it."""
        held = self.holder is not None and who == self.holder
        if held:
            self._pass_to(None, frozenset())
        return held

    def expire(self, now: float) -> Hashable | None:
        """End the lease of a holder that has been silent for too long; return it, or None."""
        holder = self.holder
        if holder is None or now - self._heard <= SILENCE:
            return None
        self._pass_to(None, frozenset())
        return holder

    def _pass_to(self, who: Hashable | None, others: frozenset[bytes]) -> None:
        self.holder, self.confirmed = who, others

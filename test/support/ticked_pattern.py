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

"""A balanced pattern that ticks in Python, with measurements that a test gives it."""

from cpg_ros.dynamics.integration.compilation import specialised
from cpg_ros.feedback.biped.balance import balance
from cpg_ros.feedback.biped.balanced_pattern import BalancedPattern


class TickedPattern(BalancedPattern):
    """A balanced pattern without a generator, which would tick it in C."""

    _kernel = None

    def prepare(self, feedback):
        """Prepare to tick with a feedback, by a kernel for its arguments."""
        super().prepare(feedback)
        self._kernel = None

    def sense(self, sensors):
        """Set the present measurements, joints in the feedback's order; None if unknown."""
        self._state.seen = sensors is not None
        if sensors is not None and self._feedback is not None:
            for own, given in zip(self.watch.measured, sensors, strict=True):
                own[:] = given

    def advance(self, dt):
        """Advance by dt in s, with the feedback if there is one."""
        if self._feedback is None:
            super().advance(dt)
            return
        if self.balance is None:
            self.start_drift()
        arguments = self._feedback.biped, self.watch, dt
        self._kernel = self._kernel or specialised(balance, *arguments)
        self._kernel(*arguments)

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

"""Whose commands drive the servos: those of one sender, until the servos are released."""


class CommandOwner:
    """Accepts the commands of one sender and refuses those of all others.

    The first sender whose command drives the servos owns them until they are released. If they
    are released without its doing, by its watchdog or a timeout, its commands stay refused until
    it releases them, too: it does not know, and would move them at full speed from where they
    have sunk to. A sender without a name, such as ``ros2 topic pub``, may go on.

    Attributes:
        sender: whose commands are accepted; None while the servos are released.
        blocked: the sender that has to release the servos first, '' for none.

    """

    def __init__(self, watchdog: str) -> None:
        """Have no owner; ``watchdog`` is a sender that may release the servos, too."""
        self._watchdog = watchdog
        self.sender: str | None = None
        self.blocked = ''

    def may_drive(self, sender: str) -> bool:
        """Take the servos for a sender if they are free; return whether it has them."""
        if self.sender is None and not (sender and sender == self.blocked):
            self.sender, self.blocked = sender, ''
        return sender == self.sender

    def may_release(self, sender: str) -> bool:
        """Note that a sender releases the servos; return whether it may."""
        if sender == self.blocked:
            self.blocked = ''
        if self.sender is None or sender not in (self.sender, self._watchdog):
            return False
        self.released('' if sender == self.sender else self.sender)
        return True

    def released(self, blocked: str) -> None:
        """Have no owner any more; ``blocked`` has to release the servos first."""
        self.sender, self.blocked = None, blocked

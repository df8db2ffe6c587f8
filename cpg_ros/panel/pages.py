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

"""The open pages: the robot that each shows, its limits, and what it is sent."""

import asyncio
from collections.abc import Callable, Iterable
import json
import time
from typing import Any

from cpg_ros.files.loopback import is_loopback
from websockets.asyncio.server import broadcast, ServerConnection

#: Largest number of pages that can do everything, and of further ones that can only stop.
MOST, MOST_STOPPING = 16, 240
#: Limits of a page's requests: per second, and at once.
RATE, BURST = 60.0, 120.0
#: Bytes that a page has not received yet: above the first limit it gets no frames; above the
#: second, or above the first for PATIENCE s, it is disconnected.
SLOW, LARGEST, PATIENCE = 200_000, 16_000_000, 20.0
#: Longest message to a page, characters: below LARGEST, so that none disconnects a page.
LONGEST = 8_000_000


class Page:
    """One open page.

    Attributes:
        connection: to the page.
        number: of the page, the smallest that is free.
        stop_only: whether it can only stop the robot.
        node: the generator that it shows, '' for none.
        round_trip: upper bound from the panel to the page and back, s; 0 before it is known.
        lost_to: the page that has taken over from it, '' for none.
        refused: the last reason it was given for not steering.

    """

    def __init__(self, connection: ServerConnection, number: int, stop_only: bool) -> None:
        self.connection, self.number, self.stop_only = connection, number, stop_only
        self.node = self.lost_to = self.refused = ''
        self.round_trip = 0.0
        self._lease: dict[str, Any] = {}
        self._left, self._when = BURST, time.monotonic()
        self._fast = time.monotonic()

    def __str__(self) -> str:
        """Return the page's name for people."""
        host = str(self.connection.remote_address[0])
        return f'page {self.number}' + ('' if is_loopback(host) else f' ({host})')

    def lease(self, message: dict[str, Any]) -> bool:
        """Store the state of the lease; return whether the page did not have it yet."""
        new = message != self._lease
        self._lease = message
        return new

    def may_ask(self) -> bool:
        """Count a request; return whether the rate of requests is within the limits."""
        now = time.monotonic()
        self._left = min(BURST, self._left + RATE * (now - self._when)) - 1.0
        self._when = now
        return self._left >= 0.0

    def waiting(self) -> int:
        """Return the number of bytes that were sent and not received yet."""
        return self.connection.transport.get_write_buffer_size()

    def keeps_up(self) -> bool:
        """Return whether the page keeps up with frames; disconnect it if it never will."""
        now, waiting = time.monotonic(), self.waiting()
        if waiting < SLOW:
            self._fast = now
        elif waiting > LARGEST or now - self._fast > PATIENCE:
            self.connection.transport.abort()
        return waiting < SLOW


class Pages:
    """The open pages; belongs to the thread of the event loop.

    Attributes:
        open: those that can do everything.
        stopping: those beyond the limit, oldest first, which can only stop the robot.

    """

    def __init__(self) -> None:
        self.open: set[Page] = set()
        self.stopping: list[Page] = []
        self._loop: asyncio.AbstractEventLoop | None = None

    def begin(self) -> None:
        """Use the running event loop."""
        self._loop = asyncio.get_running_loop()

    def later(self, act: Callable[..., None], *values: Any) -> None:
        """Call a function from the event loop soon; callable from any thread."""
        if self._loop is not None:
            self._loop.call_soon_threadsafe(act, *values)

    @property
    def full(self) -> bool:
        """Whether not even a page that can only stop the robot is admitted."""
        return len(self.stopping) >= MOST_STOPPING

    @property
    def everyone(self) -> list[Page]:
        """All pages, whatever they can do."""
        return [*self.open, *self.stopping]

    def admit(self, connection: ServerConnection) -> Page:
        """Add the page of a connection, and return it."""
        taken = {page.number for page in self.everyone}
        number = next(k for k in range(1, len(taken) + 2) if k not in taken)
        page = Page(connection, number, stop_only=len(self.open) >= MOST)
        if page.stop_only:
            self.stopping.append(page)
        else:
            self.open.add(page)
        return page

    def leave(self, page: Page) -> Page | None:
        """Remove a page; return one that can do everything from now on, if there is one."""
        if page.stop_only:
            self.stopping.remove(page)
            return None
        self.open.discard(page)
        if not self.stopping:
            return None
        promoted = self.stopping.pop(0)
        promoted.stop_only = False
        self.open.add(promoted)
        return promoted

    def of(self, node: str) -> list[Page]:
        """Return the pages that show a generator."""
        return [page for page in self.open if page.node == node]

    def send(self, pages: Iterable[Page], message: dict[str, Any]) -> None:
        """Send a message to pages; in place of one that is too long, a line that says so."""
        text = json.dumps(message, allow_nan=False)
        if len(text) > LONGEST:
            self.notify(pages, f"'{message['type']}' is not shown: it has {len(text) / 1e6:.3g} "
                        f'MB, more than the {LONGEST / 1e6:g} MB that a page is sent')
        else:
            broadcast([page.connection for page in pages], text)

    def frame(self, pages: Iterable[Page], frame: dict[str, Any], stamp: float) -> None:
        """Send a frame, which may be lost, and a stamp to echo; without a frame the stamp."""
        ready = [page for page in pages if page.keeps_up()]
        message = {'type': 'frame', **frame} if frame else {'type': 'stamp'}
        self.send(ready, {**message, 'stamp': stamp})

    def notify(self, pages: Iterable[Page], text: str, kind: str = 'refused') -> None:
        """Show a line of text; ``kind`` is refused or told."""
        self.send(pages, {'type': 'said', 'text': text[:1000], 'kind': kind})

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

"""The pages that are open: what each looks at, what it may ask, and what it is sent."""

import asyncio
from collections.abc import Callable, Iterable
import json
import time
from typing import Any

from cpg_ros.files.loopback import is_loopback
from websockets.asyncio.server import broadcast, ServerConnection

#: Pages at once that see and do everything, and more that can only stop the robot.
MOST, MOST_STOPPING = 16, 240
#: A page may ask this often, by the second and at once.
RATE, BURST = 60.0, 120.0
#: What a page has not taken yet, bytes: above the first it gets no frames, above the second,
#: or above the first for so long, s, it is let go.
SLOW, LARGEST, PATIENCE = 200_000, 16_000_000, 20.0


class Page:
    """One open page.

    Attributes:
        connection: to it.
        number: of the page, the smallest that is free.
        stop_only: whether it can do nothing but stop the robot.
        node: the generator that it looks at, '' for none.
        round_trip: from the panel to the page and back, at most, s; 0 before it is known.
        lost_to: who has taken over from it, '' for nobody.
        refused: the reason that it was shown last for not steering.

    """

    def __init__(self, connection: ServerConnection, number: int, stop_only: bool) -> None:
        self.connection, self.number, self.stop_only = connection, number, stop_only
        self.node = self.lost_to = self.refused = ''
        self.round_trip = 0.0
        self._lease: dict[str, Any] = {}
        self._left, self._when = BURST, time.monotonic()
        self._fast = time.monotonic()

    def __str__(self) -> str:
        """Return its name for people."""
        host = str(self.connection.remote_address[0])
        return f'page {self.number}' + ('' if is_loopback(host) else f' ({host})')

    def lease(self, message: dict[str, Any]) -> bool:
        """Tell whether what is known of the lease is news to it, and keep it."""
        new = message != self._lease
        self._lease = message
        return new

    def may_ask(self) -> bool:
        """Tell whether it asks at a rate that people have; counts this once."""
        now = time.monotonic()
        self._left = min(BURST, self._left + RATE * (now - self._when)) - 1.0
        self._when = now
        return self._left >= 0.0

    def waiting(self) -> int:
        """How much it has been sent and not taken, bytes."""
        return self.connection.transport.get_write_buffer_size()

    def keeps_up(self) -> bool:
        """Tell whether frames are of use to it; lets it go if that is hopeless."""
        now, waiting = time.monotonic(), self.waiting()
        if waiting < SLOW:
            self._fast = now
        elif waiting > LARGEST or now - self._fast > PATIENCE:
            self.connection.transport.abort()
        return waiting < SLOW


class Pages:
    """All of them; belongs to the thread of the event loop.

    Attributes:
        open: those that see and do everything.
        stopping: those that came when there were enough, oldest first: they can only stop.

    """

    def __init__(self) -> None:
        self.open: set[Page] = set()
        self.stopping: list[Page] = []
        self._loop: asyncio.AbstractEventLoop | None = None

    def begin(self) -> None:
        """Be of the loop that runs now."""
        self._loop = asyncio.get_running_loop()

    def later(self, act: Callable[..., None], *values: Any) -> None:
        """Let the loop do something soon, from whatever thread."""
        if self._loop is not None:
            self._loop.call_soon_threadsafe(act, *values)

    @property
    def full(self) -> bool:
        """Tell whether not even a page that can only stop the robot may come."""
        return len(self.stopping) >= MOST_STOPPING

    @property
    def everyone(self) -> list[Page]:
        """Return all of them, whatever they can do."""
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
        """Return those that look at a generator."""
        return [page for page in self.open if page.node == node]

    def send(self, pages: Iterable[Page], message: dict[str, Any]) -> None:
        """Send them a message."""
        broadcast([page.connection for page in pages], json.dumps(message, allow_nan=False))

    def frame(self, pages: Iterable[Page], frame: dict[str, Any], stamp: float) -> None:
        """Send a frame, of which the next one makes up for the loss, and a stamp to echo.

        An empty frame is not sent: the stamp comes alone.
        """
        ready = [page for page in pages if page.keeps_up()]
        message = {'type': 'frame', **frame} if frame else {'type': 'stamp'}
        self.send(ready, {**message, 'stamp': stamp})

    def notify(self, pages: Iterable[Page], text: str, kind: str = 'refused') -> None:
        """Show a line of text: kind is refused, or told."""
        self.send(pages, {'type': 'said', 'text': text[:1000], 'kind': kind})

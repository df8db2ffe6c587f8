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

from websockets.asyncio.server import broadcast, ServerConnection

#: A page may ask this often, by the second and at once.
RATE, BURST = 60.0, 120.0
#: What a page has not taken yet, bytes: above the first it gets no frames, above the second,
#: or above the first for so long, s, it is let go.
SLOW, LARGEST, PATIENCE = 200_000, 16_000_000, 20.0


class Page:
    """One open page.

    Attributes:
        connection: to it.
        node: the generator that it looks at, '' for none.

    """

    def __init__(self, connection: ServerConnection) -> None:
        self.connection = connection
        self.node = ''
        self._left, self._when = BURST, time.monotonic()
        self._fast = time.monotonic()

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
    """All of them; belongs to the thread of the event loop."""

    def __init__(self) -> None:
        self.open: set[Page] = set()
        self._loop: asyncio.AbstractEventLoop | None = None

    def begin(self) -> None:
        """Be of the loop that runs now."""
        self._loop = asyncio.get_running_loop()

    def later(self, act: Callable[..., None], *values: Any) -> None:
        """Let the loop do something soon, from whatever thread."""
        if self._loop is not None:
            self._loop.call_soon_threadsafe(act, *values)

    def of(self, node: str) -> list[Page]:
        """Return those that look at a generator."""
        return [page for page in self.open if page.node == node]

    def send(self, pages: Iterable[Page], message: dict[str, Any]) -> None:
        """Send them a message."""
        broadcast([page.connection for page in pages], json.dumps(message, allow_nan=False))

    def frame(self, pages: Iterable[Page], message: dict[str, Any]) -> None:
        """Send a message of which the next one makes up for the loss."""
        self.send([page for page in pages if page.keeps_up()], message)

    def say(self, pages: Iterable[Page], text: str, kind: str = 'refused') -> None:
        """Show a line of text: kind is refused, or told."""
        self.send(pages, {'type': 'said', 'text': text[:1000], 'kind': kind})

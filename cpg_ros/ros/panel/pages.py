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

"""The open pages: the robot that each shows, checks of its requests, and messages to it."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
import json
import math
import time
from typing import Any

from cpg_ros.common.errors import CpgError
from cpg_ros.common.files import is_loopback
from websockets.asyncio.server import broadcast, ServerConnection

# The requests of a page, checked completely before they are carried out.

#: Longest text in a request, characters.
MAX_TEXT_LENGTH = 500


class RequestError(CpgError):
    """A page's request is invalid, or cannot be carried out; one line for that page."""


@dataclass(frozen=True)
class Request:
    """An action and its values; ``stamp`` is the newest one that the page had received, s."""

    action: str
    values: Mapping[str, Any] = field(default_factory=dict)
    stamp: float | None = None


def _text(value: Any) -> str:
    if not isinstance(value, str) or len(value) > MAX_TEXT_LENGTH or not value.isprintable():
        raise RequestError(f'must be text of at most {MAX_TEXT_LENGTH} characters')
    return value


def _flag(value: Any) -> bool:
    if not isinstance(value, bool):
        raise RequestError('must be true or false')
    return value


def _number(low: float, high: float) -> Callable[[Any], float]:
    def check(value: Any) -> float:
        if (isinstance(value, bool) or not isinstance(value, (int, float))
                or not low <= value <= high):
            raise RequestError(f'must be a number from {low:g} to {high:g}')
        return float(value)

    return check


def _setting(value: Any) -> bool | int | float | str:
    """Return the value for a parameter; its node checks kind and range."""
    if isinstance(value, str):
        return _text(value)
    if (isinstance(value, bool) or (isinstance(value, int) and -2**63 <= value < 2**63)
            or (isinstance(value, float) and math.isfinite(value))):
        return value
    raise RequestError('must be true or false, text or a finite number')


#: Action -> its values, and the check of each. A direction is in degrees from x to y.
ACTIONS: dict[str, dict[str, Callable[[Any], Any]]] = {
    'choose': {'node': _text}, 'set': {'name': _text, 'value': _setting},
    'steer': {'speed': _number(-1.0, 1.0), 'turn': _number(-1.0, 1.0)},
    'alive': {}, 'take_over': {}, 'release': {}, 'stop': {}, 'enable': {'on': _flag}, 'reset': {},
    'seat': {'on': _flag},
    'sit': {'bridge': _text}, 'damp': {'bridge': _text},
    'push': {'force': _number(0.0, 500.0), 'direction': _number(-360.0, 360.0)},
    'record': {'on': _flag}, 'fit': {}}


def _checked(action: str, name: str, check: Callable[[Any], Any], value: Any) -> Any:
    try:
        return check(value)
    except RequestError as error:
        raise RequestError(f'{action}: {name} {error}') from error


def read(text: str | bytes) -> Request:
    """Parse a message of a page.

    Raises:
        RequestError: anything in it is invalid.

    """
    if not isinstance(text, str):
        raise RequestError('a request must be text')
    try:
        message = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise RequestError('the request is not JSON') from error
    if not isinstance(message, dict):
        raise RequestError('a request must be a JSON object')
    action = message.pop('do', None)
    if not isinstance(action, str) or action not in ACTIONS:
        raise RequestError(f"'do' is not one of {', '.join(ACTIONS)}")
    fields = ACTIONS[action]
    stamp = message.pop('stamp', None)
    if stamp is not None:
        stamp = _checked(action, 'stamp', _number(0.0, 1e12), stamp)
    if set(message) != set(fields):
        raise RequestError(f"'{action}' takes {', '.join(fields) or 'nothing'}")
    return Request(action, {name: _checked(action, name, check, message[name])
                            for name, check in fields.items()}, stamp)


#: MAX_PAGES: largest number of pages with all rights; MAX_STOP_PAGES: of further pages that can
#: only stop.
MAX_PAGES, MAX_STOP_PAGES = 16, 240
#: Limits of a page's requests. RATE: per second; BURST: at once.
RATE, BURST = 60.0, 120.0
#: A page with more than SLOW_BACKLOG unsent bytes gets no frames; one with more than MAX_BACKLOG,
#: or with more than SLOW_BACKLOG for BACKLOG_TIMEOUT s, is disconnected.
SLOW_BACKLOG, MAX_BACKLOG, BACKLOG_TIMEOUT = 200_000, 16_000_000, 20.0
#: Longest message to a page, characters: below MAX_BACKLOG, so that none disconnects a page.
MAX_MESSAGE_LENGTH = 8_000_000


class Page:
    """One open page.

    Attributes:
        connection: to the page.
        number: of the page, the smallest free one.
        stop_only: whether it can only stop the robot.
        node: the generator that it shows, '' for none.
        round_trip: upper bound from the panel to the page and back, s; 0 before it is known.
        lost_to: the page that has taken over from it, '' for none.
        refused: the last given reason for not steering.

    """

    def __init__(self, connection: ServerConnection, number: int, stop_only: bool) -> None:
        self.connection, self.number, self.stop_only = connection, number, stop_only
        self.node = self.lost_to = self.refused = ''
        self.round_trip = 0.0
        self._lease: dict[str, Any] = {}
        self._tokens, self._when = BURST, time.monotonic()
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
        self._tokens = min(BURST, self._tokens + RATE * (now - self._when)) - 1.0
        self._when = now
        return self._tokens >= 0.0

    def waiting(self) -> int:
        """Return the number of bytes that were sent and not received yet."""
        return self.connection.transport.get_write_buffer_size()

    def keeps_up(self) -> bool:
        """Return whether the page receives frames in time; disconnect it if it never will."""
        now, waiting = time.monotonic(), self.waiting()
        if waiting < SLOW_BACKLOG:
            self._fast = now
        elif waiting > MAX_BACKLOG or now - self._fast > BACKLOG_TIMEOUT:
            self.connection.transport.abort()
        return waiting < SLOW_BACKLOG


class Pages:
    """The open pages; belongs to the thread of the event loop.

    Attributes:
        everyone: all of them, oldest first; those beyond MAX_PAGES can only stop the robot.

    """

    def __init__(self) -> None:
        self.everyone: list[Page] = []

    @property
    def open(self) -> list[Page]:  # noqa: A003
        """Pages that can do everything."""
        return self.everyone[:MAX_PAGES]

    @property
    def full(self) -> bool:
        """Whether no page is admitted any more, not even one that can only stop the robot."""
        return len(self.everyone) >= MAX_PAGES + MAX_STOP_PAGES

    def admit(self, connection: ServerConnection) -> Page:
        """Add the page of a connection, and return it."""
        numbers = {page.number for page in self.everyone}
        number = next(k for k in range(1, len(numbers) + 2) if k not in numbers)
        self.everyone.append(Page(connection, number, stop_only=len(self.everyone) >= MAX_PAGES))
        return self.everyone[-1]

    def leave(self, page: Page) -> Page | None:
        """Remove a page; return one that is no longer limited to stopping, if there is one."""
        self.everyone.remove(page)
        promoted = next((other for other in self.open if other.stop_only), None)
        if promoted is not None:
            promoted.stop_only = False
        return promoted

    def of(self, node: str) -> list[Page]:
        """Return the pages that show a generator."""
        return [page for page in self.open if page.node == node]

    def send(self, pages: Iterable[Page], message: dict[str, Any]) -> None:
        """Send a message to pages; in place of one that is too long, a line that says so."""
        text = json.dumps(message, allow_nan=False)
        if len(text) > MAX_MESSAGE_LENGTH:
            self.notify(pages, f"'{message['type']}' is not shown: it has {len(text) / 1e6:.3g} "
                        f'MB, more than the {MAX_MESSAGE_LENGTH / 1e6:g} MB that a page is sent')
        else:
            broadcast([page.connection for page in pages], text)

    def frame(self, pages: Iterable[Page], frame: dict[str, Any], stamp: float) -> None:
        """Send a frame, which may be lost, and a stamp to echo; without a frame the stamp."""
        ready = [page for page in pages if page.keeps_up()]
        message = {'type': 'frame', **frame} if frame else {'type': 'stamp'}
        self.send(ready, {**message, 'stamp': stamp})

    def notify(self, pages: Iterable[Page], text: str, kind: str = 'refused') -> None:
        """Show a line of text; ``kind`` is refused or info."""
        self.send(pages, {'type': 'notice', 'text': text[:1000], 'kind': kind})

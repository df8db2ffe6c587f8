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

"""The panel's web server: access control, the page's files, recordings and the socket."""

import asyncio
from collections.abc import Awaitable, Callable
import hmac
from http import HTTPStatus
import logging
from pathlib import Path
import secrets
from socket import socket
from urllib.parse import parse_qs, urlsplit

from cpg_ros.common.errors import CpgError
from cpg_ros.common.files import is_loopback
from cpg_ros.ros.panel.pages import Page, Pages
from websockets.asyncio.server import serve, Server, ServerConnection
from websockets.datastructures import Headers
from websockets.exceptions import ConnectionClosed
from websockets.http11 import Request, Response

# Access control: pages of this machine on loopback, holders of the token elsewhere.

#: AUTO: setting that generates a token of 128 bits and shows it in the terminal.
AUTO = 'auto'
#: Least number of characters of a token: that of 128 bits, 6 bits each. Guesses are not delayed: a
#: delay of an address would also lock out the holder of the token behind the same address.
MIN_TOKEN_LENGTH = 22
#: How to generate a token.
TOKEN_COMMAND = 'python3 -c "import secrets; print(secrets.token_urlsafe(16))"'


class AccessError(CpgError):
    """The panel would be open to everybody; one line for the user."""


def token_for(host: str, setting: str, terminal: bool) -> str:
    """Return the required token; '' for none.

    Args:
        host: address to listen on.
        setting: the user's choice: a token, ``auto`` for a new one, or '' for none.
        terminal: whether there is a terminal to show a new token in.

    Raises:
        AccessError: other machines would have access without a token; the token can be guessed; or
            nobody would see a new one.

    """
    if setting == AUTO:
        if not terminal:
            raise AccessError(f'token:={AUTO} shows the token in the terminal, and there is none: '
                              f'make one ({TOKEN_COMMAND}) and set it in a parameter file')
        return secrets.token_urlsafe(16)
    if not setting and not is_loopback(host):
        raise AccessError(f"host '{host}' can be reached from other machines: set the parameter "
                          f'token to protect it; token:={AUTO} makes one')
    if setting and len(setting) < MIN_TOKEN_LENGTH:
        raise AccessError(f'the token has {len(setting)} characters, and can be guessed: '
                          f'it needs {MIN_TOKEN_LENGTH}; token:={AUTO} makes one, or: '
                          f'{TOKEN_COMMAND}')
    return setting


def rejected(token: str, path: str, host: str, origin: str) -> str:
    """Return why a request is rejected before its contents are read, or ''.

    Args:
        token: as of ``token_for``.
        path: of the request, with the query.
        host: header Host.
        origin: header Origin, '' for a client that is no browser.

    """
    # Another site's page, open in the same browser, must not move the robot.
    if origin and urlsplit(origin).netloc != host:
        return 'the request comes from a page of another site'
    if token:
        presented = parse_qs(urlsplit(path).query).get('token', [''])[0]
        if not presented:
            return 'the token is missing'
        if not hmac.compare_digest(presented.encode(errors='replace'), token.encode()):
            return 'the token is wrong'
    # A name that its owner lets point at this machine (DNS rebinding) is another site's, too.
    elif not is_loopback(urlsplit(f'//{host}').hostname or ''):
        return f"'{host[:80]}' is not a name of this machine"
    return ''


PAGE_FOLDER = Path(__file__).parent / 'page'
CONTENT_TYPES = {'.html': 'text/html', '.css': 'text/css', '.js': 'text/javascript',
         '.svg': 'image/svg+xml'}
#: Largest size of a request, bytes.
MAX_REQUEST_SIZE = 4096
#: Path of recordings.
BAGS_PATH = '/bags/'
#: CONTENT_POLICY: keeps the browser from loading anything from elsewhere.
CONTENT_POLICY = ("default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self' data:; "
          "connect-src 'self' ws: wss:; base-uri 'none'; form-action 'none'; "
          "frame-ancestors 'none'")
#: Logger whose records are dropped: errors of clients would fill the log.
_LOG = logging.getLogger('cpg_ros.ros.panel.socket')
_LOG.addHandler(logging.NullHandler())
_LOG.propagate = False


class WebServer:
    """Serves files to authorised clients, and reports pages that open, send requests and close."""

    def __init__(self, token: str, pages: Pages, bag: Callable[[str], bytes],
                 come: Callable[[Page], None],
                 on_request: Callable[[Page, str | bytes], Awaitable[None]],
                 gone: Callable[[Page], None]) -> None:
        self._token, self._pages, self._bag = token, pages, bag
        self._come, self._on_request, self._gone = come, on_request, gone
        self._files = {'/' if file.name == 'index.html' else f'/{file.name}':
                       (file.read_bytes(), CONTENT_TYPES[file.suffix])
                       for file in PAGE_FOLDER.iterdir() if file.suffix in CONTENT_TYPES}

    async def start(self, bound: socket) -> Server:
        """Serve at a socket; return the server."""
        return await serve(self._page, sock=bound, process_request=self._answer,
                           compression=None, max_size=MAX_REQUEST_SIZE, max_queue=8,
                           write_limit=65536, open_timeout=5.0, ping_interval=10.0,
                           ping_timeout=20.0, close_timeout=1.0, server_header=None,
                           logger=_LOG)

    async def _answer(self, connection: ServerConnection, request: Request) -> Response | None:
        path = urlsplit(request.path).path
        hosts, origins = (request.headers.get_all(name) for name in ('Host', 'Origin'))
        refused = rejected(self._token, request.path, hosts[0] if len(hosts) == 1 else '',
                           origins[0] if origins else '')
        # The page's files are public: with them it can show that a token is missing.
        if path in self._files and (not refused or 'token' in refused):
            body, kind = self._files[path]
            return _response(HTTPStatus.OK, body, f'{kind}; charset=utf-8')
        if refused:
            return _text(HTTPStatus.FORBIDDEN, refused)
        if path == '/socket':
            if self._pages.full:
                return _text(HTTPStatus.SERVICE_UNAVAILABLE, 'too many pages are open')
            return None
        if path.startswith(BAGS_PATH) and path.endswith('.zip'):
            try:
                bag = path.removeprefix(BAGS_PATH).removesuffix('.zip')
                return _response(HTTPStatus.OK, await asyncio.to_thread(self._bag, bag),
                                 'application/zip')
            except ValueError as error:
                return _text(HTTPStatus.NOT_FOUND, str(error))
        return _text(HTTPStatus.NOT_FOUND, 'there is nothing here')

    async def _page(self, connection: ServerConnection) -> None:
        page = self._pages.admit(connection)
        # One request may wait for another node; a stop must not wait for it.
        under_way: set[asyncio.Task] = set()
        try:
            self._come(page)
            async for message in connection:
                if not page.may_ask():
                    await connection.close(1008, 'too many requests')
                    break
                task = asyncio.ensure_future(self._on_request(page, message))
                under_way.add(task)
                task.add_done_callback(under_way.discard)
        except ConnectionClosed:
            pass
        finally:
            self._gone(page)
            if promoted := self._pages.leave(page):
                self._come(promoted)


def _text(status: HTTPStatus, text: str) -> Response:
    return _response(status, f'{text}\n'.encode(errors='replace'), 'text/plain; charset=utf-8')


def _response(status: HTTPStatus, body: bytes, kind: str) -> Response:
    headers = {'Content-Type': kind, 'Content-Length': str(len(body)),
               'Content-Security-Policy': CONTENT_POLICY, 'X-Content-Type-Options': 'nosniff',
               'Referrer-Policy': 'no-referrer', 'Cache-Control': 'no-cache',
               'Connection': 'close'}
    return Response(status.value, status.phrase, Headers(headers), body)

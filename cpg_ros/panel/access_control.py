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

"""Access control: pages of this machine on loopback, holders of the token elsewhere."""

import hmac
import secrets
from urllib.parse import parse_qs, urlsplit

from cpg_ros.errors import CpgError
from cpg_ros.files.loopback import is_loopback

#: In place of a token: generate one of 128 bits, and show it in the terminal.
AUTO = 'auto'
#: Least number of characters of a token: that of 128 bits, 6 bits each. Guesses are not delayed: a
#: delay of an address would also lock out the holder of the token behind the same address.
SHORTEST = 22
#: How to generate a token.
RECIPE = 'python3 -c "import secrets; print(secrets.token_urlsafe(16))"'


class AccessError(CpgError):
    """The panel would be open to everybody; one line for the user."""


def token_for(host: str, wish: str, terminal: bool) -> str:
    """Return the token to require; '' for none.

    Args:
        host: to listen on.
        wish: the user's choice: a token, ``auto`` for a new one, or '' for none.
        terminal: whether there is a terminal to show a new token in.

    Raises:
        AccessError: other machines would have access without a token; the token can be guessed;
            or nobody would see a new one.

    """
    if wish == AUTO:
        if not terminal:
            raise AccessError(f'token:={AUTO} shows the token in the terminal, and there is none: '
                              f'make one ({RECIPE}) and set it in a parameter file')
        return secrets.token_urlsafe(16)
    if not wish and not is_loopback(host):
        raise AccessError(f"host '{host}' can be reached from other machines: set the parameter "
                          f'token to protect it; token:={AUTO} makes one')
    if wish and len(wish) < SHORTEST:
        raise AccessError(f'the token has {len(wish)} characters, and can be guessed: it '
                          f'needs {SHORTEST}; token:={AUTO} makes one, or: {RECIPE}')
    return wish


class AccessControl:
    """Checks each request before its contents are read."""

    def __init__(self, token: str) -> None:
        """Require a token, as of ``token_for``."""
        self._token = token.encode()

    def refuses(self, path: str, host: str, origin: str) -> str:
        """Return why a request is rejected, or ''.

        Args:
            path: of the request, with the query.
            host: header Host.
            origin: header Origin, '' for a program that is not a browser.

        """
        # Another site's page, open in the same browser, must not move the robot.
        if origin and urlsplit(origin).netloc != host:
            return 'the request comes from a page of another site'
        if self._token:
            given = parse_qs(urlsplit(path).query).get('token', [''])[0]
            if not given:
                return 'the token is missing'
            if not hmac.compare_digest(given.encode(errors='replace'), self._token):
                return 'the token is wrong'
        # A name that its owner lets point at this machine (DNS rebinding) is another site's, too.
        elif not is_loopback(urlsplit(f'//{host}').hostname or ''):
            return f"'{host[:80]}' is not a name of this machine"
        return ''

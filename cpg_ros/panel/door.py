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

"""Who may come in: on loopback pages of this machine, elsewhere those who have the token."""

import hmac
import ipaddress
from urllib.parse import parse_qs, urlsplit

from cpg_ros.errors import CpgError


class DoorError(CpgError):
    """It would be open to everybody; one line for the user."""


def is_loopback(host: str) -> bool:
    """Tell whether only this machine can reach a host: a name or an address, without a port."""
    if host == 'localhost':
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


class Door:
    """Looks at each request before anything of it is read."""

    def __init__(self, host: str, token: str) -> None:
        """Be the door of an address.

        Raises:
            DoorError: others than this machine could come in, and no token is asked for.

        """
        if not is_loopback(host) and not token:
            raise DoorError(f"host '{host}' can be reached from other machines: set the parameter "
                            'token to protect it')
        self._token = token.encode()

    def refuses(self, path: str, host: str, origin: str) -> str:
        """Return why a request is refused, '' if it is not.

        Args:
            path: as asked for, with the query.
            host: header Host.
            origin: header Origin, '' for a program that is not a browser.

        """
        # Another site's page, open in the same browser, must not move the robot.
        if origin and urlsplit(origin).netloc != host:
            return 'the request comes from a page of another site'
        if self._token:
            given = parse_qs(urlsplit(path).query).get('token', [''])[0]
            if not hmac.compare_digest(given.encode(errors='replace'), self._token):
                return 'the token is missing or wrong'
        # A name that its owner lets point at this machine (DNS rebinding) is another site's, too.
        elif not is_loopback(urlsplit(f'//{host}').hostname or ''):
            return f"'{host[:80]}' is not a name of this machine"
        return ''

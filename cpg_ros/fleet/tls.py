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

"""TLS between this process and a dask cluster, and a warning where there is none.

Who reaches a scheduler without TLS can run any program on its workers, and what comes back from
it is unpickled here. With TLS both ends show certificates of the cluster's own authority.
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

from cpg_ros.errors import InputError
from cpg_ros.files.loopback import is_loopback

TLS = 'tls://'


@dataclass(frozen=True)
class Certificates:
    """Files of a client, in PEM format.

    Attributes:
        authority: certificate of the authority that signed the cluster's certificates.
        certificate: the client's own.
        key: the client's own; may be in the same file.

    """

    authority: str
    certificate: str
    key: str


def security(address: str, certificates: Certificates | None) -> Any:
    """Return the ``distributed.Security`` to speak to a scheduler with.

    Args:
        address: of the scheduler.
        certificates: None for those of dask's configuration, ``distributed.comm.tls``.

    Raises:
        InputError: the address is not one of TLS and there are certificates, or the other way
            round; or a file cannot be used.

    """
    from distributed import Security
    if certificates is None:
        found = Security()
    else:
        if not address.startswith(TLS):
            raise InputError(f"--tls needs an address that begins with {TLS}, not '{address}'")
        for file in (certificates.authority, certificates.certificate, certificates.key):
            if not Path(file).is_file():
                raise InputError(f'{file}: no such file')
        found = Security(tls_ca_file=certificates.authority, require_encryption=True,
                         tls_client_cert=certificates.certificate,
                         tls_client_key=certificates.key)
    try:
        context = found.get_connection_args('client')['ssl_context']
    except OSError as error:
        raise InputError(f'the certificates for {address} cannot be used: {error}') from error
    if context is None and address.startswith(TLS):
        raise InputError(f"{address} needs --tls CA CERT KEY, or dask's configuration "
                         'distributed.comm.tls')
    return found


def exposed(*addresses: str) -> str:
    """Return the first address that other machines reach without TLS, or ''.

    Args:
        *addresses: of one scheduler, as the user and as the scheduler itself give them.

    """
    for address in addresses:
        if not address.startswith(TLS) and not is_loopback(urlsplit(address).hostname or ''):
            return address
    return ''

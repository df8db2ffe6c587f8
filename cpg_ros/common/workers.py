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

"""Executors of jobs: processes of this machine, or the workers of a dask cluster.

A ``Fleet`` is a ``concurrent.futures.Executor`` over another one that is made anew when it breaks:
a pool whose worker was killed, a cluster whose scheduler was restarted. All jobs run on any
executor; on one that is no fleet, a broken pool ends the work.
"""

from argparse import ArgumentParser, Namespace
import asyncio
from collections.abc import Callable, Iterator
from concurrent.futures import CancelledError, Executor, ProcessPoolExecutor
import contextlib
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass
import logging
import multiprocessing
from multiprocessing.context import SpawnContext, SpawnProcess
import os
from pathlib import Path
import signal
import threading
import time
from typing import Any
from urllib.parse import urlsplit

from cpg_ros.common.errors import CpgError, InputError, MissingLibraryError
from cpg_ros.common.files import is_loopback
from cpg_ros.common.jobs import ResilientExecutor

# TLS between this process and a dask cluster, and a warning where there is none.

TLS_SCHEME = 'tls://'


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
        settings = Security()
    else:
        if not address.startswith(TLS_SCHEME):
            raise InputError(f'--tls needs an address that begins with {TLS_SCHEME}, not '
                             f"'{address}'")
        for file in (certificates.authority, certificates.certificate, certificates.key):
            if not Path(file).is_file():
                raise InputError(f'{file}: no such file')
        settings = Security(tls_ca_file=certificates.authority, require_encryption=True,
                            tls_client_cert=certificates.certificate,
                            tls_client_key=certificates.key)
    try:
        context = settings.get_connection_args('client')['ssl_context']
    except OSError as error:
        raise InputError(f'the certificates for {address} cannot be used: {error}') from error
    if context is None and address.startswith(TLS_SCHEME):
        raise InputError(f"{address} needs --tls CA CERT KEY, or dask's configuration "
                         'distributed.comm.tls')
    return settings


def exposed(*addresses: str) -> str:
    """Return the first address that other machines reach without TLS, or ''.

    Args:
        *addresses: of one scheduler, as the user and as the scheduler itself give them.

    """
    for address in addresses:
        if not (address.startswith(TLS_SCHEME) or is_loopback(urlsplit(address).hostname or '')):
            return address
    return ''


#: Longest waits for an address to answer, and for a lost scheduler, s.
CONNECT_TIMEOUT, RECONNECT_TIMEOUT = 6.0, 300.0
#: JOBS_PER_THREAD: of a worker, that run or wait there.
JOBS_PER_THREAD = 2
#: DEFAULT_THREADS: of a cluster that has no workers yet.
DEFAULT_THREADS = 4


class NoCluster(CpgError):
    """No usable scheduler responds at an address; the message says why."""


class _Worker(SpawnProcess):
    """A worker process that leaves Ctrl-C to its parent, also while it starts."""

    def start(self) -> None:
        # Signals that a thread blocks are blocked in the processes that it starts, too.
        before = signal.pthread_sigmask(signal.SIG_BLOCK, (signal.SIGINT,))
        try:
            super().start()
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)


class _Workers(SpawnContext):
    """Spawned: a process with threads, as numba's, must not be forked."""

    Process = _Worker


def _begin(parent: int) -> None:
    """Make a worker process exit with its parent."""
    def watch() -> None:
        while os.getppid() == parent:
            time.sleep(1.0)
        os._exit(1)

    threading.Thread(target=watch, daemon=True).start()


def processes(jobs: int = 0) -> ResilientExecutor:
    """Return a fleet of worker processes of this machine.

    Args:
        jobs: how many; 0 for as many as there are cores for this process.

    """
    count = jobs or cores()
    held: list[ProcessPoolExecutor] = []

    def made() -> tuple[Executor, int]:
        held[:] = [ProcessPoolExecutor(count, _Workers(), _begin, (os.getpid(),))]
        return held[0], JOBS_PER_THREAD * count

    def close(wait: bool) -> None:
        # Children of the pool; its own list of them is private.
        mine = [] if wait else multiprocessing.active_children()
        for process in mine:
            process.terminate()
        held[0].shutdown(wait=True, cancel_futures=not wait)

    return ResilientExecutor(*made(), made, close)


def cores() -> int:
    """Return the number of cores that this process may use."""
    return (len(os.sched_getaffinity(0)) if hasattr(os, 'sched_getaffinity')
            else os.cpu_count() or 1)


def _package() -> str:
    """Return where a worker has the package; runs on the worker."""
    return str(Path(__file__).resolve().parents[1] / '__init__.py')


def cluster(address: str, say: Callable[[str], None] = lambda line: None,
            certificates: Certificates | None = None) -> ResilientExecutor:
    """Return a fleet of the workers of a dask cluster.

    Args:
        address: of its scheduler, such as tcp://127.0.0.1:8786 or tls://head:8786.
        say: takes a line when the scheduler is lost and when it is back, and one when other
            machines reach it without TLS.
        certificates: for TLS; None for those of dask's configuration.

    Raises:
        InputError: the address is none, or the certificates cannot be used.
        MissingLibraryError: dask is missing.
        NoCluster: nothing answers, there are no workers, or they do not
            have the package.

    """
    try:
        from distributed import Client
    except ImportError as error:
        raise MissingLibraryError('--dask needs dask and distributed: pip install dask '
                                  'distributed') from error
    if '://' not in address:
        raise InputError(f"'{address}' is not the address of a scheduler, such as tcp://host:8786")
    # Failures are reported here, in a line.
    for name in ('distributed', 'distributed.core', 'distributed.client', 'distributed.comm'):
        logging.getLogger(name).setLevel(logging.CRITICAL)
    held: list[Any] = []
    own: list[str] = []
    safe = security(address, certificates)

    def connect(seconds: float) -> tuple[Executor, int]:
        # A client that fails to connect takes long to close.
        own[:] = [_answers(address, seconds, safe)]
        client = Client(address, timeout=seconds, set_as_default=False, security=safe)
        held[:] = [client]
        threads = sum(client.nthreads().values())
        return (client.get_executor(pure=False), JOBS_PER_THREAD * (threads or DEFAULT_THREADS))

    def again() -> tuple[Executor, int]:
        say(f'the scheduler at {address} is lost; waiting for it for up to '
            f'{RECONNECT_TIMEOUT:g} s')
        _leave(held)
        end = time.monotonic() + RECONNECT_TIMEOUT
        while True:
            try:
                connected = connect(CONNECT_TIMEOUT)
            except (NoCluster, OSError, TimeoutError):
                if time.monotonic() > end:
                    raise
                time.sleep(0.5)
                continue
            there = len(held[0].nthreads())
            say('the scheduler is back, with '
                + (f'{there} workers' if there else 'no worker yet: jobs wait for one'))
            return connected

    def close(wait: bool) -> None:
        _leave(held)

    fleet = ResilientExecutor(*connect(CONNECT_TIMEOUT), again, close)
    if where := exposed(address, *own):
        say(f'warning: the scheduler at {where} can be reached from other machines without TLS: '
            'anyone who can reach it can run any program on its workers and here')
    try:
        _workers_checked(held[0], address)
    except NoCluster:
        close(False)
        raise
    return fleet


def _answers(address: str, seconds: float, safe: Any) -> str:
    """Check that a scheduler responds at an address; return the address that it reports.

    Raises:
        InputError: it is no address.
        NoCluster: none does within these seconds.

    """
    from distributed.comm.core import connect

    async def ask() -> Any:
        comm = await connect(address, timeout=seconds, deserialize=False,
                             **safe.get_connection_args('client'))
        try:
            await comm.write({'op': 'identity', 'reply': True})
            return await comm.read()
        finally:
            comm.abort()

    try:
        answers = asyncio.run(asyncio.wait_for(ask(), seconds))
    except (OSError, TimeoutError) as error:
        raise NoCluster(f'no dask scheduler answers at {address}' + (
            ' to these certificates' if address.startswith(TLS_SCHEME) else '')) from error
    except (ValueError, RuntimeError, ImportError) as error:
        raise InputError(f'{address}: {" ".join(str(error).split())}') from error
    # Another protocol is taken for a message of any length.
    except MemoryError as error:
        raise NoCluster(f'what answers at {address} is not a dask scheduler') from error
    if not isinstance(answers, dict) or answers.get('type') != 'Scheduler':
        raise NoCluster(f'what answers at {address} is not a dask scheduler')
    return str(answers.get('address', address))


def _leave(held: list[Any]) -> None:
    # A scheduler that is gone cannot close the connection.
    with contextlib.suppress(OSError, TimeoutError, CancelledError):
        held[0].close(timeout=2)


def _workers_checked(client: Any, address: str) -> None:
    """Check that there are workers, and that they have the package.

    Raises:
        NoCluster: there are none, or one lacks it.

    """
    if not client.nthreads():
        raise NoCluster(f'the scheduler at {address} has no workers')
    future = client.submit(_package, pure=False)
    try:
        future.result(timeout=60)
    except ImportError as error:
        raise NoCluster(f'the workers of {address} lack the package: {error}') from error
    except (OSError, TimeoutError, CancelledError) as error:
        raise NoCluster(f'the workers of {address} do not answer') from error


# The options that choose where jobs run, the same for all executables that run many.

#: MAX_PROCESSES: more are a mistake.
MAX_PROCESSES = 1024
#: INTERRUPT_MESSAGE: after Ctrl-C, for jobs whose results are kept as they come.
INTERRUPT_MESSAGE = 'stopped; what was finished is kept, and the same command continues from there'


def add_options(parser: ArgumentParser) -> None:
    """Add the options --jobs and --dask, and those that go with it."""
    where = parser.add_mutually_exclusive_group()
    where.add_argument('--jobs', type=int, default=0, metavar='N', help='worker processes on '
                       'this machine (default: one per core); the results do not depend on the '
                       'number')
    where.add_argument('--dask', metavar='ADDRESS', help='scheduler of a dask cluster to use '
                       'instead, such as tcp://head:8786 (pip install dask distributed)')
    parser.add_argument('--tls', nargs=3, metavar=('CA', 'CERT', 'KEY'), help="for --dask "
                        "tls://...: certificate of the cluster's own authority, this client's "
                        'certificate and its key, as PEM files')


def chosen_fleet(args: Namespace, say: Callable[[str], None]) -> ResilientExecutor:
    """Return the fleet that the options choose.

    Raises:
        InputError: an impossible number of processes, or unusable certificates.
        NoCluster: no scheduler responds at the address.

    """
    if not 0 <= args.jobs <= MAX_PROCESSES:
        raise InputError(f'argument --jobs: {args.jobs} is not between 0 and {MAX_PROCESSES}')
    if args.tls and not args.dask:
        raise InputError('argument --tls: it needs --dask')
    if not args.dask:
        return processes(args.jobs)
    return cluster(args.dask, say, Certificates(*args.tls) if args.tls else None)


@contextmanager
def closing(fleet: ResilientExecutor) -> Iterator[ResilientExecutor]:
    """Close a fleet at the end; at once, with its running jobs, on an error or Ctrl-C."""
    try:
        yield fleet
    except BaseException:
        fleet.shutdown(wait=False)
        raise
    fleet.shutdown()


def working(args: Namespace, what: str, say: Callable[[str], None]
            ) -> AbstractContextManager[ResilientExecutor]:
    """Open the fleet that the options choose, and close it as closing does.

    Args:
        args: options.
        what: name of its jobs in progress messages.
        say: takes a line when a scheduler is lost.

    Raises:
        CpgError: as chosen_fleet.

    """
    fleet = chosen_fleet(args, say)
    fleet.what = what
    return closing(fleet)


def executor_for(count: int, args: Namespace, what: str, say: Callable[[str], None]
                 ) -> AbstractContextManager[Executor | None]:
    """Return the fleet for jobs, or None for a single one, which runs in this process.

    Args:
        count: number of jobs.
        args: options; with --dask, a single job is sent as well.
        what: as of working.
        say: as of working.

    """
    if count == 1 and not (args.dask or args.tls):
        return nullcontext()
    return working(args, what, say)

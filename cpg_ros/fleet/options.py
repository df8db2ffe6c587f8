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

"""The options that choose where jobs run, the same for all executables that run many."""

from argparse import ArgumentParser, Namespace
from collections.abc import Callable, Iterator
from concurrent.futures import Executor
from contextlib import AbstractContextManager, contextmanager, nullcontext

from cpg_ros.errors import InputError
from cpg_ros.fleet.executors import cluster, processes
from cpg_ros.fleet.outcomes import Fleet
from cpg_ros.fleet.tls import Certificates

#: More processes than this are a mistake.
MOST = 1024
#: What Ctrl-C leaves of jobs whose results are kept as they come.
KEPT = 'stopped; what was finished is kept, and the same command continues from there'


def add_options(parser: ArgumentParser) -> None:
    """Add --jobs, --dask, and what goes with it."""
    where = parser.add_mutually_exclusive_group()
    where.add_argument('--jobs', type=int, default=0, metavar='N', help='worker processes on '
                       'this machine (default: one per core); the results do not depend on the '
                       'number')
    where.add_argument('--dask', metavar='ADDRESS', help='scheduler of a dask cluster to use '
                       'instead, such as tcp://head:8786 (pip install dask distributed)')
    parser.add_argument('--tls', nargs=3, metavar=('CA', 'CERT', 'KEY'), help="for --dask "
                        "tls://...: certificate of the cluster's own authority, this client's "
                        'certificate and its key, as PEM files')


def chosen_fleet(chosen: Namespace, say: Callable[[str], None]) -> Fleet:
    """Return the fleet that the options choose.

    Raises:
        InputError: an impossible number of processes, or unusable certificates.
        NoCluster: no scheduler responds at the address.

    """
    if not 0 <= chosen.jobs <= MOST:
        raise InputError(f'argument --jobs: {chosen.jobs} is not between 0 and {MOST}')
    if chosen.tls and not chosen.dask:
        raise InputError('argument --tls: it needs --dask')
    if not chosen.dask:
        return processes(chosen.jobs)
    return cluster(chosen.dask, say, Certificates(*chosen.tls) if chosen.tls else None)


@contextmanager
def working(chosen: Namespace, what: str, say: Callable[[str], None]) -> Iterator[Fleet]:
    """Open the fleet that the options choose; close it at the end, and at once on an error.

    Args:
        chosen: options.
        what: name of its jobs in progress messages.
        say: takes a line when a scheduler is lost.

    Raises:
        CpgError: as chosen_fleet.

    """
    fleet = chosen_fleet(chosen, say)
    fleet.what = what
    try:
        yield fleet
    except BaseException:
        fleet.shutdown(wait=False)
        raise
    fleet.shutdown()


def executor_for(count: int, chosen: Namespace, what: str, say: Callable[[str], None]
                 ) -> AbstractContextManager[Executor | None]:
    """Return the fleet for jobs, or None for a single one, which runs in this process.

    Args:
        count: number of jobs.
        chosen: options; with --dask, a single job is sent as well.
        what: as of working.
        say: as of working.

    """
    if count == 1 and not (chosen.dask or chosen.tls):
        return nullcontext()
    return working(chosen, what, say)

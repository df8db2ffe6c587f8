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

"""Executable ``inversion`` with ``--bags``: folders of recordings into a folder of results."""

from argparse import Namespace
import sys

from cpg_ros.fleet.many_recordings import Folders, Summary
from cpg_ros.fleet.options import working
from cpg_ros.fleet.recording_job import Settings
from cpg_ros.robots.robot import Robot
from cpg_ros.tools.arguments import say
from cpg_ros.tools.reading_options import reading_arguments


def _note(line: str) -> None:
    print(f'inversion: {line}', file=sys.stderr)


def _settings(chosen: Namespace, robot: Robot | None) -> Settings:
    return Settings(robot, chosen.network or '', chosen.gait or '', chosen.preset or '',
                    tuple(chosen.free), chosen.order,
                    tuple(dict(start) for start in chosen.start) or ({},),
                    reading_arguments(chosen))


def run(chosen: Namespace, robot: Robot | None) -> int:
    """Invert what the folders hold; return the exit code.

    Raises:
        CpgError: the folders or the workers are of no use.
        OSError: a result cannot be written.
        KeyboardInterrupt: as it comes; what was finished is kept.

    """
    work = Folders(chosen.bags, chosen.out, _settings(chosen, robot))
    with working(chosen, 'recordings', _note) as fleet:
        summary = work.watch(fleet, _note) if chosen.watch else work.run(fleet)
    say(_told(summary))
    return 0 if summary.failed < summary.done else 1


def _told(summary: Summary) -> str:
    return (f'{summary.done} recordings, {summary.done - summary.failed} fitted, '
            f'{summary.failed} not (the table says why)'
            + (f'; {summary.kept} were done before' if summary.kept else '')
            + f'\nwritten: {", ".join(map(str, summary.written))}')

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

"""Executable ``reproduce``: computes every number that the papers print.

``reproduce`` prints a row for each: paper, place, quantity, published, computed, and whether they
agree or which erratum says why not.
"""

import argparse
from collections.abc import Sequence
import os
from pathlib import Path
import sys

from cpg_ros.files.atomic_write import write_atomically
from cpg_ros.files.progress_bar import progress_bar
from cpg_ros.papers.catalogue import PAPERS
from cpg_ros.papers.reproduction import parts, reproduce
from cpg_ros.tools.command_line import Parser, run, say
from cpg_ros.tools.reproduction_report import as_html, as_json, table

DESCRIPTION = """\
Compute every quantity printed in the papers and compare it with the printed value. A row
that differs names the erratum that explains it; otherwise it fails."""
EPILOG = 'exit codes: 0 nothing fails, 1 a row fails, 2 invalid arguments.'


def _jobs(text: str) -> int:
    if not (text.isascii() and text.isdigit() and int(text) > 0):
        raise argparse.ArgumentTypeError(f"'{text}' is not a number of processes, 1 or more")
    return int(text)


def _parser() -> Parser:
    parser = Parser(prog='reproduce', description=DESCRIPTION, epilog=EPILOG)
    parser.add_argument('--paper', metavar='NAME', choices=tuple(PAPERS),
                        help=f'one of {", ".join(PAPERS)} (default: all)')
    parser.add_argument('--json', metavar='FILE', help='write the rows as JSON; - writes them to '
                        'standard output instead of the table')
    parser.add_argument('--html', metavar='FILE', type=Path, nargs='?',
                        const=Path('out/reproduction.html'),
                        help='write an HTML page with the rows and figures (without a name: '
                        '%(const)s)')
    parser.add_argument('--jobs', type=_jobs, default=os.cpu_count() or 1, metavar='N',
                        help='number of processes (default: %(default)s)')
    return parser


def _ready(path: Path) -> None:
    """Make sure that a file can be written there.

    Raises:
        OSError: it cannot.

    """
    if path.is_dir():
        raise IsADirectoryError(f'{path} is a directory')
    path.parent.mkdir(parents=True, exist_ok=True)
    if not os.access(path.parent, os.W_OK):
        raise PermissionError(f'{path.parent} cannot be written to')


def _reproduce(chosen: argparse.Namespace) -> int:
    names = tuple(PAPERS) if chosen.paper is None else (chosen.paper,)
    json = None if chosen.json in (None, '-') else Path(chosen.json)
    files = [path for path in (json, chosen.html) if path is not None]
    # Now, and not when the work is done.
    for path in files:
        _ready(path)
    with progress_bar('reproducing', parts(names)) as progress:
        found = reproduce(names, chosen.jobs, chosen.html is not None, progress)
    if json is not None:
        write_atomically(json, as_json(found))
    if chosen.html is not None:
        write_atomically(chosen.html, as_html(found))
    say(as_json(found).rstrip() if chosen.json == '-' else '\n'.join(
        [table(found), *([f'written: {", ".join(map(str, files))}'] if files else [])]))
    return 1 if found.failed else 0


def main(arguments: Sequence[str] | None = None) -> int:
    """Reproduce the papers; return the exit code."""
    return run(_parser(), _reproduce, arguments)


if __name__ == '__main__':
    sys.exit(main())

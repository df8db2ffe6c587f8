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
from dataclasses import asdict
from html import escape
import json
import os
from pathlib import Path
import sys

from cpg_ros.analysis.papers.reproduction import PAPERS, parts, reproduce, Reproduction
from cpg_ros.analysis.papers.row import ReproducedRow
from cpg_ros.common import command_line
from cpg_ros.common.command_line import Parser, progress_bar, run, say
from cpg_ros.common.files import write_atomically
from cpg_ros.common.report_page import html_table, image, page

# The reproduction report as a table, as JSON and as a page that needs no other file.

#: Widest columns of the table on a terminal: quantity, published, computed.
WIDEST = (58, 30, 30)
HEAD = ('place', 'quantity', 'published', 'computed', 'verdict')


def _cut(text: str, width: int) -> str:
    return text if len(text) <= width else text[:width - 3] + '...'


def table(found: Reproduction) -> str:
    """Write the rows by paper in aligned columns, the errata that were used, and the summary."""
    head, *rest = command_line.table([HEAD, *(
        (row.place, *(_cut(text, width) for text, width in zip(
            (row.quantity, row.published, row.computed), WIDEST, strict=True)), row.verdict)
        for row in found.rows)])
    lines: list[str] = []
    for paper in found.papers:
        lines += [paper.reference, head, *(line for row, line in zip(
            found.rows, rest, strict=True) if row.paper == paper.authors), '']
    used = {row.erratum for row in found.explained}
    lines += [f'erratum {number} ({paper}): {text}'
              for number, (paper, text) in found.errata.items() if number in used]
    return '\n'.join([*lines, *([''] if used else []), found.summary])


def as_json(found: Reproduction) -> str:
    """Write everything but the figures for machines."""
    tree = {
        'papers': [{'name': paper.name, 'authors': paper.authors, 'reference': paper.reference}
                   for paper in found.papers],
        'summary': {'published': len(found.rows), 'agree': sum(row.agrees for row in found.rows),
                    'explained': len(found.explained), 'failed': len(found.failed)},
        'rows': [{**asdict(row), 'verdict': row.verdict} for row in found.rows],
        'errata': {str(number): {'paper': paper, 'text': text}
                   for number, (paper, text) in found.errata.items()}}
    return json.dumps(command_line.finite(tree), indent=1, allow_nan=False) + '\n'


def _line(row: ReproducedRow) -> str:
    kind = 'agrees' if row.agrees else 'erratum' if row.explained else 'fails'
    verdict = (f'<a href="#erratum-{row.erratum}">{row.verdict}</a>' if kind == 'erratum'
               else row.verdict)
    right = f'right: {row.corrected}' if kind == 'erratum' else ''
    note = '; '.join(part for part in (row.note, row.compared, right) if part)
    return (f'<tr class="{kind}"><td>{escape(row.place)}</td><td>{escape(row.quantity)}</td>'
            f'<td class="value">{escape(row.published)}</td>'
            f'<td class="value">{escape(row.computed)}</td>'
            f'<td class="verdict">{verdict}</td><td class="note">{escape(note)}</td></tr>')


def as_html(found: Reproduction) -> str:
    """Write one page with the rows, the errata and the figures."""
    parts = [f'<p>{escape(found.summary)}.</p>']
    for paper in found.papers:
        parts += [f'<h2>{escape(paper.reference)}</h2>', html_table(
            (*HEAD, 'note; how compared'),
            [_line(row) for row in found.rows if row.paper == paper.authors])]
        for figure in found.figures:
            if figure.paper == paper.authors:
                name = f'{figure.paper}, {figure.place}'
                parts.append(image(figure.png, name, '<figcaption>'
                                   f'{escape(f"{name}. {figure.caption}")}</figcaption>'))
    parts += ['<h2>Errata</h2>', '<ol>']
    parts += [f'<li id="erratum-{number}" value="{number}">{escape(paper)}: {escape(text)}</li>'
              for number, (paper, text) in found.errata.items()]
    return page('The papers reproduced', [*parts, '</ol>'])


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


def _reproduce(args: argparse.Namespace) -> int:
    names = tuple(PAPERS) if args.paper is None else (args.paper,)
    json = None if args.json in (None, '-') else Path(args.json)
    files = [path for path in (json, args.html) if path is not None]
    # Now, and not when the work is done.
    for path in files:
        _ready(path)
    with progress_bar('reproducing', parts(names)) as progress:
        found = reproduce(names, args.jobs, args.html is not None, progress)
    if json is not None:
        write_atomically(json, as_json(found))
    if args.html is not None:
        write_atomically(args.html, as_html(found))
    say(as_json(found).rstrip() if args.json == '-' else '\n'.join(
        [table(found), *([f'written: {", ".join(map(str, files))}'] if files else [])]))
    return 1 if found.failed else 0


def main(arguments: Sequence[str] | None = None) -> int:
    """Reproduce the papers; return the exit code."""
    return run(_parser(), _reproduce, arguments)


if __name__ == '__main__':
    sys.exit(main())

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

"""Compute every quantity printed in the papers and compare it with the printed value. A row
that differs names the erratum that explains it; otherwise it fails.
"""

import argparse
from collections.abc import Callable, Sequence
from contextlib import nullcontext
from dataclasses import asdict, dataclass, replace
from functools import partial
from html import escape
import json
import os
from pathlib import Path
import sys
from typing import Any

from cpg_ros.analysis.papers import (
    buono_gaits,
    buono_hopf,
    liu_zhang,
    oscillators,
    rashidi,
)
from cpg_ros.analysis.papers.row import Paper, Picture, ReproducedRow
from cpg_ros.common import command_line
from cpg_ros.common.command_line import Parser, progress_bar, run, say
from cpg_ros.common.errors import CpgError
from cpg_ros.common.files import write_atomically
from cpg_ros.common.report_page import html_table, image, page, rendered
from cpg_ros.common.workers import closing, processes
import yaml

# Buono & Golubitsky (2001), Models of central pattern generators for quadruped locomotion I.

PAPER = Paper('buono_golubitsky', buono_hopf.AUTHORS,
              'P.-L. Buono, M. Golubitsky: Models of central pattern generators for quadruped '
              'locomotion. I. Primary gaits (2001)',
              (buono_gaits.constants, partial(buono_gaits.gaits, 'pronk', 'pace', 'bound', 'jump'),
               partial(buono_gaits.gaits, 'walk', 'trot'), buono_gaits.dihedral,
               buono_gaits.lattice, buono_gaits.four_cells, buono_gaits.legs,
               buono_hopf.phases, buono_hopf.tables, buono_hopf.coupled_variable,
               buono_hopf.equal_couplings, buono_hopf.the_stand, buono_hopf.existence,
               buono_hopf.table_12, buono_hopf.theorem_4_2, buono_hopf.genericity,
               buono_hopf.jump, buono_hopf.stable_points, buono_hopf.near_equal,
               buono_hopf.necessary_and_sufficient, buono_gaits.conditions,
               buono_gaits.one_variable))


# The papers by name.

PAPERS: dict[str, Paper] = {paper.name: paper for paper in (
    liu_zhang.PAPER, PAPER, rashidi.PAPER, *oscillators.PAPERS)}


#: Errata of the papers by number: paper and text.
ERRATA: dict[int, tuple[str, str]] = {
    number: (erratum['paper'], erratum['text']) for number, erratum in
    yaml.safe_load(Path(__file__).with_name('errata.yaml').read_text('utf-8')).items()}


#: FIGURE_DPI: of a figure, dots per inch.
FIGURE_DPI = 100


@dataclass(frozen=True)
class Reproduction:
    """The rows and figures of some papers.

    Attributes:
        papers: whose they are.
        rows: in the order of the papers.
        figures: likewise; none if they were not drawn.

    """

    papers: tuple[Paper, ...]
    rows: tuple[ReproducedRow, ...]
    figures: tuple[Picture, ...]

    @property
    def failed(self) -> tuple[ReproducedRow, ...]:
        """Rows that differ, but not as an erratum says."""
        return tuple(row for row in self.rows if not row.agrees and not row.explained)

    @property
    def explained(self) -> tuple[ReproducedRow, ...]:
        """Rows that differ as an erratum says."""
        return tuple(row for row in self.rows if not row.agrees and row.explained)

    @property
    def errata(self) -> dict[int, tuple[str, str]]:
        """Errata of these papers, by number: paper and text."""
        authors = {paper.authors for paper in self.papers}
        return {number: erratum for number, erratum in ERRATA.items() if erratum[0] in authors}

    @property
    def summary(self) -> str:
        """The number of rows that agree, as one line."""
        agree = sum(row.agrees for row in self.rows)
        return (f'{len(self.rows)} published quantities: {agree} agree, {len(self.explained)} '
                f'explained by errata, {len(self.failed)} fail')


def _section(paper: Paper, number: int, draw: bool) -> tuple[list[ReproducedRow], list[Picture]]:
    """Compute a section of a paper; an error becomes a row that fails."""
    rows: list[ReproducedRow] = []
    figures: list[Picture] = []
    section = paper.sections[number]
    try:
        for row in section():
            if isinstance(row, ReproducedRow):
                rows.append(row)
            elif draw:
                figures.append(replace(row, figure=rendered(row.figure, dpi=FIGURE_DPI)))
    except (CpgError, ArithmeticError) as error:
        name = getattr(section, 'func', section).__name__.replace('_', ' ')
        rows.append(ReproducedRow(paper.authors, name, 'what is printed here', 'a result',
                                  f'no result: {error}', False, 'computed at all'))
    return rows, figures


def reproduce(names: Sequence[str], jobs: int = 1, draw: bool = True,
              progress: Callable[[int], None] = lambda done: None) -> Reproduction:
    """Compute all rows of some papers.

    Args:
        names: of the papers, from ``PAPERS``.
        jobs: number of processes; 1 for this process.
        draw: whether to draw the figures.
        progress: takes the number of sections done, out of ``sections(names)``.

    """
    papers = tuple(PAPERS[name] for name in names)
    tasks = [(paper, number, draw) for paper in papers for number in range(len(paper.sections))]
    parts: list[tuple[list[ReproducedRow], list[Picture]]] = []
    with (nullcontext() if jobs == 1 else closing(processes(min(jobs, len(tasks))))) as fleet:
        run_all: Callable[..., Any] = map if fleet is None else fleet.map
        for part in run_all(_section, *zip(*tasks, strict=True)):
            parts.append(part)
            progress(len(parts))
    return Reproduction(papers, tuple(row for rows, _ in parts for row in rows),
                        tuple(figure for _, figures in parts for figure in figures))


def sections(names: Sequence[str]) -> int:
    """Return the number of sections of the papers."""
    return sum(len(PAPERS[name].sections) for name in names)


# The reproduction report as a table, as JSON and as a page that needs no other file.

#: Of the columns quantity, published and computed on a terminal.
MAX_WIDTHS = (58, 30, 30)
COLUMNS = ('place', 'quantity', 'published', 'computed', 'verdict')


def _cut(text: str, width: int) -> str:
    return text if len(text) <= width else text[:width - 3] + '...'


def table(report: Reproduction) -> str:
    """Write the rows by paper in aligned columns, the errata that were used, and the summary."""
    head, *rest = command_line.table([COLUMNS, *(
        (row.place, *(_cut(text, width) for text, width in zip(
            (row.quantity, row.published, row.computed), MAX_WIDTHS, strict=True)), row.verdict)
        for row in report.rows)])
    lines: list[str] = []
    for paper in report.papers:
        lines += [paper.reference, head, *(line for row, line in zip(
            report.rows, rest, strict=True) if row.paper == paper.authors), '']
    used = {row.erratum for row in report.explained}
    lines += [f'erratum {number} ({paper}): {text}'
              for number, (paper, text) in report.errata.items() if number in used]
    return '\n'.join([*lines, *([''] if used else []), report.summary])


def as_json(report: Reproduction) -> str:
    """Write everything but the figures for machines."""
    tree = {
        'papers': [{'name': paper.name, 'authors': paper.authors, 'reference': paper.reference}
                   for paper in report.papers],
        'summary': {'published': len(report.rows), 'agree': sum(row.agrees for row in report.rows),
                    'explained': len(report.explained), 'failed': len(report.failed)},
        'rows': [{**asdict(row), 'verdict': row.verdict} for row in report.rows],
        'errata': {str(number): {'paper': paper, 'text': text}
                   for number, (paper, text) in report.errata.items()}}
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


def as_html(report: Reproduction) -> str:
    """Write one page with the rows, the errata and the figures."""
    parts = [f'<p>{escape(report.summary)}.</p>']
    for paper in report.papers:
        parts += [f'<h2>{escape(paper.reference)}</h2>', html_table(
            (*COLUMNS, 'note; how compared'),
            [_line(row) for row in report.rows if row.paper == paper.authors])]
        for figure in report.figures:
            if figure.paper == paper.authors:
                name = f'{figure.paper}, {figure.place}'
                parts.append(image(figure.figure, name, '<figcaption>'
                                   f'{escape(f"{name}. {figure.caption}")}</figcaption>'))
    parts += ['<h2>Errata</h2>', '<ol>']
    parts += [f'<li id="erratum-{number}" value="{number}">{escape(paper)}: {escape(text)}</li>'
              for number, (paper, text) in report.errata.items()]
    return page('The papers reproduced', [*parts, '</ol>'])


EPILOG = 'exit codes: 0 nothing fails, 1 a row fails, 2 invalid arguments.'


def _jobs(text: str) -> int:
    if not (text.isascii() and text.isdigit() and int(text) > 0):
        raise argparse.ArgumentTypeError(f"'{text}' is not a number of processes, 1 or more")
    return int(text)


def _parser() -> Parser:
    parser = Parser(prog='reproduce', description=__doc__, epilog=EPILOG)
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
    with progress_bar('reproducing', sections(names)) as progress:
        report = reproduce(names, args.jobs, args.html is not None, progress)
    if json is not None:
        write_atomically(json, as_json(report))
    if args.html is not None:
        write_atomically(args.html, as_html(report))
    say(as_json(report).rstrip() if args.json == '-' else '\n'.join(
        [table(report), *([f'written: {", ".join(map(str, files))}'] if files else [])]))
    return 1 if report.failed else 0


def main(arguments: Sequence[str] | None = None) -> int:
    """Reproduce the papers; return the exit code."""
    return run(_parser(), _reproduce, arguments)


if __name__ == '__main__':
    sys.exit(main())

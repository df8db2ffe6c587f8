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

"""The reproduction report as a table, as JSON and as a page that needs no other file."""

import base64
from dataclasses import asdict
from html import escape
import json

from cpg_ros.files import plain_text
from cpg_ros.files.page_style import STYLE
from cpg_ros.papers.reproduction import Reproduction
from cpg_ros.papers.row import ReproducedRow

#: Widest columns of the table on a terminal: quantity, published, computed.
WIDEST = (58, 30, 30)
HEAD = ('place', 'quantity', 'published', 'computed', 'verdict')


def _cut(text: str, width: int) -> str:
    return text if len(text) <= width else text[:width - 3] + '...'


def table(found: Reproduction) -> str:
    """Write the rows by paper in aligned columns, the errata that were used, and the summary."""
    head, *rest = plain_text.table([HEAD, *(
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
    return json.dumps(plain_text.finite(tree), indent=1, allow_nan=False) + '\n'


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
    head = ''.join(f'<th>{name}</th>' for name in (*HEAD, 'note; how compared'))
    parts = ['<!DOCTYPE html>', '<html lang="en"><head><meta charset="utf-8">',
             '<title>The papers reproduced</title>', f'<style>{STYLE}</style></head><body>',
             '<h1>The papers reproduced</h1>', f'<p>{escape(found.summary)}.</p>']
    for paper in found.papers:
        parts += [f'<h2>{escape(paper.reference)}</h2>', f'<table><thead><tr>{head}</tr></thead>'
                  '<tbody>', *(_line(row) for row in found.rows if row.paper == paper.authors),
                  '</tbody></table>']
        for figure in found.figures:
            if figure.paper == paper.authors:
                image = base64.b64encode(figure.png).decode('ascii')
                name = escape(f'{figure.paper}, {figure.place}')
                parts.append(
                    f'<figure><img alt="{name}" src="data:image/png;base64,{image}">'
                    f'<figcaption>{name}. {escape(figure.caption)}</figcaption></figure>')
    parts += ['<h2>Errata</h2>', '<ol>']
    parts += [f'<li id="erratum-{number}" value="{number}">{escape(paper)}: {escape(text)}</li>'
              for number, (paper, text) in found.errata.items()]
    return '\n'.join([*parts, '</ol>', '</body></html>', ''])

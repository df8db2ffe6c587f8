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

"""The page of many inverted recordings: one file, a table that can be sorted, small pictures."""

from collections.abc import Iterable
from html import escape
from pathlib import Path
from typing import Any

from cpg_ros.files.atomic_write import replacing
from cpg_ros.files.page_style import STYLE

MORE = """
th { cursor: pointer; white-space: nowrap; } th[aria-sort]::after { content: " \\2191"; }
th[aria-sort=descending]::after { content: " \\2193"; }
svg polyline { fill: none; stroke-width: 1.2; } svg .r { stroke: #a0aec0; stroke-width: 2.5; }
svg .f { stroke: #2b6cb0; } td.num { text-align: right; font-variant-numeric: tabular-nums; }
body { max-width: 110em; } td:first-child { min-width: 14em; }
td:nth-child(2) { white-space: nowrap; }
td.value { white-space: nowrap; } td.note { max-width: 40em; }
input { font: inherit; padding: 0.3em 0.5em; width: 24em; max-width: 100%; }
"""
SCRIPT = """
const body = document.querySelector('tbody'), heads = [...document.querySelectorAll('th')];
heads.forEach((head, k) => head.addEventListener('click', () => {
  const down = head.getAttribute('aria-sort') === 'ascending';
  heads.forEach(one => one.removeAttribute('aria-sort'));
  head.setAttribute('aria-sort', down ? 'descending' : 'ascending');
  const value = row => row.cells[k].dataset.v ?? row.cells[k].textContent;
  const order = (a, b) => {
    const [x, y] = [value(a), value(b)];
    if (x === '' || y === '') return (x === '') - (y === '');
    const d = x - y;
    return (isNaN(d) ? x.localeCompare(y) : d) * (down ? -1 : 1);
  };
  body.append(...[...body.rows].sort(order));
}));
document.querySelector('input').addEventListener('input', event => {
  const wanted = event.target.value.toLowerCase();
  for (const row of body.rows) row.hidden = !row.textContent.toLowerCase().includes(wanted);
});
"""
HEADS = ('file', 'gait', 'frequency [Hz]', 'confidence', 'residual / range [%]', 'parameters',
         'mean cycles', 'remarks', 'seconds')


def _number(value: float | None, form: str, more: str = '') -> str:
    if value is None:
        return '<td class="num" data-v=""></td>'
    return f'<td class="num" data-v="{value!r}">{value:{form}}{more}</td>'


def _row(row: dict[str, Any]) -> str:
    fitted = row.get('fitted', '')
    name = (f'<a href="{escape(fitted)}">{escape(row["file"])}</a>' if fitted
            else escape(row['file']))
    error = row.get('frequency_error') or 0.0
    parameters = '<br>'.join(
        f'{escape(name)} {one["value"]:.5g} ({one["low"]:.5g} to {one["high"]:.5g})'
        for name, one in row.get('parameters', {}).items())
    share = row.get('rms_share')
    remarks = '<br>'.join(escape(text) for text in
                          ([row['reason']] if row['reason'] else row.get('warnings', [])))
    return (f'<tr{" class=fails" if row["reason"] else ""}><td>{name}</td>'
            f'<td>{escape(row.get("gait", ""))}</td>'
            f'{_number(row.get("frequency"), ".4f", f" &plusmn; {error:.1g}")}'
            f'{_number(row.get("confidence"), ".2f")}'
            f'{_number(None if share is None else 100.0 * share, ".1f")}'
            f'<td class="value">{parameters}</td><td>{row.get("picture", "")}</td>'
            f'<td class="note">{remarks}</td>{_number(row.get("seconds"), ".1f")}</tr>\n')


def write_page(path: Path, rows: Iterable[dict[str, Any]], done: int, failed: int) -> None:
    """Write the page, row by row, beside and rename it.

    Raises:
        OSError: it cannot be written.

    """
    title = f'{done} recordings, {done - failed} fitted, {failed} not'
    with replacing(path) as beside, beside.open('w', encoding='utf-8') as out:
        out.write(f'<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">'
                  f'<title>{title}</title><style>{STYLE}{MORE}</style></head><body>\n'
                  f'<h1>{title}</h1>\n<p><input placeholder="show rows that contain this" '
                  'aria-label="filter"> Click a column head to sort. Grey: recorded; blue: '
                  'fitted.</p>\n<table><thead><tr>'
                  + ''.join(f'<th>{escape(head)}</th>' for head in HEADS)
                  + '</tr></thead><tbody>\n')
        out.writelines(_row(row) for row in rows)
        out.write(f'</tbody></table><script>{SCRIPT}</script></body></html>\n')

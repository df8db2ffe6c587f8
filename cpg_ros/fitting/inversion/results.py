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

"""Results of many recordings: finding recordings, the folder of results, its page and tables."""

from collections.abc import Callable, Iterable, Iterator, Sequence
import csv
import hashlib
from html import escape
import json
import os
from pathlib import Path
from typing import Any

from cpg_ros.common.command_line import printable
from cpg_ros.common.errors import InputError, MissingLibraryError
from cpg_ros.common.files import replacing, stored_json, write_atomically
from cpg_ros.common.report_page import STYLE
from cpg_ros.fitting.recordings.formats import FORMATS

# Recordings in folders: bags, split ones as one, and other files of known formats.

#: MARKER_FILE: marks a folder of results, in which no recordings are searched for.
MARKER_FILE = 'cpg_ros_results.json'
#: BLOCK_SIZE: bytes that are read at once.
BLOCK_SIZE = 1 << 20


def recordings_in(folders: Sequence[Path]) -> Iterator[Path]:
    """Yield the recordings in folders, each of which may be one, sorted, each once.

    A folder that a format recognises as one recording is one; otherwise each file with a known
    suffix is a recording.

    Raises:
        InputError: a folder does not exist.

    """
    paths: set[Path] = set()
    for folder in folders:
        if not folder.exists():
            raise InputError(f'{folder}: there is no such folder')
        for path in _below(folder):
            if (target := path.resolve()) not in paths:
                paths.add(target)
                yield path


def _below(folder: Path) -> Iterator[Path]:
    if folder.is_file():
        if folder.name.endswith(tuple(
                ending for entry in FORMATS.values() for ending in entry.endings)):
            yield folder
        return
    if (folder / MARKER_FILE).exists():
        return
    try:
        inside = sorted(folder.iterdir())
        complete = bool(files_of(folder))
    except PermissionError:
        inside, complete = [], True
    if complete:
        yield folder
        return
    for entry in inside:
        if not entry.name.startswith('.') and not (entry.is_symlink() and entry.is_dir()):
            yield from _below(entry)


def files_of(recording: Path) -> list[Path]:
    """Return the sorted files of a recording; none for a folder that is not a recording."""
    if not recording.is_dir():
        return [recording]
    return next((files for form in FORMATS.values()
                 if form.files_in is not None and (files := form.files_in(recording))), [])


def digest(recording: Path) -> str:
    """SHA-256 of the names and the contents of a recording's files, as hexadecimal digits.

    Raises:
        OSError: one cannot be read.

    """
    total = hashlib.sha256()
    for path in files_of(recording):
        size = path.stat().st_size
        total.update(os.fsencode(f'{path.name if recording.is_dir() else path.suffix}\n{size}\n'))
        with path.open('rb') as file:
            while block := file.read(BLOCK_SIZE):
                total.update(block)
    return total.hexdigest()


def outline(recording: Path) -> tuple[tuple[str, int, int], ...]:
    """Return names, sizes and times of a recording's files, which change while it is written."""
    sizes = []
    for file in files_of(recording):
        try:
            status = file.stat()
        except FileNotFoundError:
            continue
        sizes.append((file.name, status.st_size, status.st_mtime_ns))
    return tuple(sizes)


# A folder of results: a file for every recording that is done, from which the table is made.

ROW_FOLDER, FIT_FOLDER = 'rows', 'fitted'


def key(recording: Path) -> str:
    """Return the name of a recording's files here, from its path."""
    return hashlib.sha256(os.fsencode(recording.resolve())).hexdigest()[:16]


class Results:
    """Rows on disk, by recording.

    Attributes:
        folder: of all.
        settings: digest of the fit's settings; rows with others are done again.

    """

    def __init__(self, folder: Path, settings: str) -> None:
        """Create the folder, or resume in it.

        Raises:
            InputError: it contains something else.
            OSError: it cannot be created.

        """
        self.folder, self.settings = folder, settings
        mark = folder / MARKER_FILE
        if folder.exists() and not mark.exists() and any(folder.iterdir()):
            raise InputError(f'{folder} is not a results folder: it contains other files')
        for name in (ROW_FOLDER, FIT_FOLDER):
            (folder / name).mkdir(parents=True, exist_ok=True)
        write_atomically(mark, json.dumps({'made by': 'inversion --bags'}) + '\n')

    def _place(self, recording: Path) -> Path:
        return self.folder / ROW_FOLDER / f'{key(recording)}.json'

    def get(self, recording: Path) -> dict[str, Any] | None:
        """Return a recording's row, if it was made with the same settings."""
        row: dict[str, Any] | None = stored_json(self._place(recording))
        return row if row and row.get('settings') == self.settings else None

    def put(self, recording: Path, row: dict[str, Any]) -> None:
        """Store the result of a recording: first its files, then the row that names them.

        Raises:
            OSError: it cannot be written.

        """
        files = row.pop('files', {})
        for name, text in files.items():
            write_atomically(self.folder / FIT_FOLDER / name, text)
        if not files:
            # Remove files that the new result no longer has.
            for ending in ('.yaml', '_robot.yaml'):
                name = f'{self.name(recording)}{ending}'
                (self.folder / FIT_FOLDER / name).unlink(missing_ok=True)
        entry = {'file': printable(str(recording)), 'settings': self.settings, **row,
                'reason': printable(row['reason']),
                'fitted': str(Path(FIT_FOLDER, next(iter(files)))) if files else ''}
        write_atomically(self._place(recording), json.dumps(entry))

    def name(self, recording: Path) -> str:
        """Return the name of a recording's fitted file, without its ending."""
        stem = ''.join(letter if letter.isalnum() or letter in '-_' else '_'
                       for letter in recording.name.split('.')[0])
        return f'{stem[:60]}-{key(recording)[:8]}'

    def rows(self, recordings: list[Path]) -> Iterator[dict[str, Any]]:
        """Yield the rows of those recordings that have one, in their order."""
        yield from filter(None, map(self.get, recordings))


# The page of many inverted recordings: one file, a table that can be sorted, small pictures.

TABLE_STYLE = """
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
  const query = event.target.value.toLowerCase();
  for (const row of body.rows) row.hidden = !row.textContent.toLowerCase().includes(query);
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
        f'{escape(name)} {estimate["value"]:.5g} ({estimate["low"]:.5g} to {estimate["high"]:.5g})'
        for name, estimate in row.get('parameters', {}).items())
    fraction = row.get('rms_share')
    remarks = '<br>'.join(escape(text) for text in
                          ([row['reason']] if row['reason'] else row.get('warnings', [])))
    return (f'<tr{" class=fails" if row["reason"] else ""}><td>{name}</td>'
            f'<td>{escape(row.get("gait", ""))}</td>'
            f'{_number(row.get("frequency"), ".4f", f" &plusmn; {error:.1g}")}'
            f'{_number(row.get("confidence"), ".2f")}'
            f'{_number(None if fraction is None else 100.0 * fraction, ".1f")}'
            f'<td class="value">{parameters}</td><td>{row.get("picture", "")}</td>'
            f'<td class="note">{remarks}</td>{_number(row.get("seconds"), ".1f")}</tr>\n')


def write_page(path: Path, rows: Iterable[dict[str, Any]], done: int, failed: int) -> None:
    """Write the page row by row under a temporary name, and rename it.

    Raises:
        OSError: it cannot be written.

    """
    title = f'{done} recordings, {done - failed} fitted, {failed} not'
    with replacing(path) as beside, beside.open('w', encoding='utf-8') as out:
        out.write(f'<!DOCTYPE html>\n<html lang="en"><head><meta charset="utf-8">'
                  f'<title>{title}</title><style>{STYLE}{TABLE_STYLE}</style></head><body>\n'
                  f'<h1>{title}</h1>\n<p><input placeholder="show rows that contain this" '
                  'aria-label="filter"> Click a column head to sort. Grey: recorded; blue: '
                  'fitted.</p>\n<table><thead><tr>'
                  + ''.join(f'<th>{escape(head)}</th>' for head in HEADS)
                  + '</tr></thead><tbody>\n')
        out.writelines(_row(row) for row in rows)
        out.write(f'</tbody></table><script>{SCRIPT}</script></body></html>\n')


#: BATCH_SIZE: rows that are in memory at once.
BATCH_SIZE = 256
#: COLUMN_UNITS: of the table, in its order, before the columns of the parameters.
COLUMN_UNITS = {'file': '', 'digest': '', 'reason': '', 'gait': '', 'recognised': '',
                'frequency': 'Hz', 'frequency_error': 'Hz', 'confidence': '', 'cycles': '',
                'begin': 's', 'end': 's', 'network': '', 'rms_share': ''}
TEXT_COLUMNS = ('file', 'digest', 'reason', 'gait', 'recognised', 'network', 'fitted')
#: ESTIMATE_FIELDS: columns of each parameter.
ESTIMATE_FIELDS = ('value', 'stderr', 'low', 'high')

Rows = Callable[[], Iterable[dict[str, Any]]]


def library() -> Any:
    """Return pyarrow.

    Raises:
        MissingLibraryError: it is not installed.

    """
    try:
        import pyarrow.parquet
    except ImportError as error:
        raise MissingLibraryError('tables need pyarrow: pip install pyarrow') from error
    return pyarrow


def parameter_columns(rows: Iterable[dict[str, Any]]) -> list[str]:
    """Return the names of the columns of the parameters, those of all rows, sorted."""
    names = {f'{row["network"]}.{name}' for row in rows for name in row.get('parameters', {})}
    return [f'{name}{"" if part == "value" else f".{part}"}' for name in sorted(names)
            for part in ESTIMATE_FIELDS]


def flat(row: dict[str, Any], columns: list[str]) -> dict[str, Any]:
    """Return a row with a field for every column."""
    cells: dict[str, Any] = {name: row.get(name, '' if name in TEXT_COLUMNS else None)
                             for name in COLUMN_UNITS}
    cells |= dict.fromkeys(columns)
    for name, estimate in row.get('parameters', {}).items():
        for part in ESTIMATE_FIELDS:
            column = f'{row["network"]}.{name}{"" if part == "value" else f".{part}"}'
            cells[column] = estimate[part]
    return cells | {'phases': row.get('phases', {}), 'joints': row.get('joints', {}),
                    'warnings': row.get('warnings', []), 'fitted': row.get('fitted', ''),
                    'seconds': row.get('seconds')}


def _batches(rows: Iterable[dict[str, Any]], columns: list[str]
             ) -> Iterator[list[dict[str, Any]]]:
    batch: list[dict[str, Any]] = []
    for row in rows:
        batch.append(flat(row, columns))
        if len(batch) == BATCH_SIZE:
            yield batch
            batch = []
    if batch:
        yield batch


def write_tables(folder: Path, rows: Rows) -> list[Path]:
    """Write both tables under temporary names, and rename them; return their paths.

    Args:
        folder: of the tables.
        rows: returns a new iterator over the rows on each call.

    Raises:
        OSError: they cannot be written.

    """
    arrow = library()
    columns = parameter_columns(rows())
    kinds = {**{name: arrow.string() if name in TEXT_COLUMNS else arrow.float64()
                for name in COLUMN_UNITS},
             'cycles': arrow.int64(), **dict.fromkeys(columns, arrow.float64()),
             'phases': arrow.map_(arrow.string(), arrow.float64()),
             'joints': arrow.map_(arrow.string(), arrow.float64()),
             'warnings': arrow.list_(arrow.string()), 'fitted': arrow.string(),
             'seconds': arrow.float64()}
    schema = arrow.schema([arrow.field(name, kind, metadata={'unit': COLUMN_UNITS[name]}
                                       if COLUMN_UNITS.get(name) else None)
                           for name, kind in kinds.items()])
    parquet, table = folder / 'table.parquet', folder / 'table.csv'
    with (replacing(parquet) as one, replacing(table) as other,
          arrow.parquet.ParquetWriter(one, schema) as out,
          other.open('w', newline='', encoding='utf-8') as text):
        writer = csv.DictWriter(text, list(kinds), lineterminator='\n')
        writer.writeheader()
        for batch in _batches(rows(), columns):
            out.write_table(arrow.Table.from_pylist(
                [{**row, 'phases': list(row['phases'].items()),
                  'joints': list(row['joints'].items())} for row in batch], schema))
            writer.writerows(_cells_of(row) for row in batch)
    return [parquet, table]


def _cells_of(row: dict[str, Any]) -> dict[str, Any]:
    """Return a row as text: maps as JSON, lists with bars between."""
    return {**row, 'phases': json.dumps(row['phases']) if row['phases'] else '',
            'joints': json.dumps(row['joints']) if row['joints'] else '',
            'warnings': ' | '.join(row['warnings'])}

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

"""Rows of inverted recordings as table.parquet and table.csv, made a batch at a time."""

from collections.abc import Callable, Iterable, Iterator
import csv
import json
from pathlib import Path
from typing import Any

from cpg_ros.errors import MissingLibraryError
from cpg_ros.files.atomic_write import replacing

#: Rows that are held at once.
BATCH = 256
#: Columns with their units, in the order of the table; before those of the parameters.
FIRST = {'file': '', 'digest': '', 'reason': '', 'gait': '', 'recognised': '',
         'frequency': 'Hz', 'frequency_error': 'Hz', 'confidence': '', 'cycles': '',
         'begin': 's', 'end': 's', 'network': '', 'rms_share': ''}
TEXT = ('file', 'digest', 'reason', 'gait', 'recognised', 'network', 'fitted')
#: What each parameter has: its value, standard error and 95 % interval.
PARTS = ('value', 'stderr', 'low', 'high')

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
    """Names of the columns of the parameters, those of all rows, sorted."""
    names = {f'{row["network"]}.{name}' for row in rows for name in row.get('parameters', {})}
    return [f'{name}{"" if part == "value" else f".{part}"}' for name in sorted(names)
            for part in PARTS]


def flat(row: dict[str, Any], columns: list[str]) -> dict[str, Any]:
    """A row with a field for every column."""
    cells: dict[str, Any] = {name: row.get(name, '' if name in TEXT else None) for name in FIRST}
    cells |= dict.fromkeys(columns)
    for name, one in row.get('parameters', {}).items():
        for part in PARTS:
            column = f'{row["network"]}.{name}{"" if part == "value" else f".{part}"}'
            cells[column] = one[part]
    return cells | {'phases': row.get('phases', {}), 'joints': row.get('joints', {}),
                    'warnings': row.get('warnings', []), 'fitted': row.get('fitted', ''),
                    'seconds': row.get('seconds')}


def _batches(rows: Iterable[dict[str, Any]], columns: list[str]
             ) -> Iterator[list[dict[str, Any]]]:
    batch: list[dict[str, Any]] = []
    for row in rows:
        batch.append(flat(row, columns))
        if len(batch) == BATCH:
            yield batch
            batch = []
    if batch:
        yield batch


def write_tables(folder: Path, rows: Rows) -> list[Path]:
    """Write both tables beside and rename them; return their paths.

    Args:
        folder: for them.
        rows: begins with the first row anew whenever it is called.

    Raises:
        OSError: they cannot be written.

    """
    arrow = library()
    columns = parameter_columns(rows())
    kinds = {**{name: arrow.string() if name in TEXT else arrow.float64() for name in FIRST},
             'cycles': arrow.int64(), **dict.fromkeys(columns, arrow.float64()),
             'phases': arrow.map_(arrow.string(), arrow.float64()),
             'joints': arrow.map_(arrow.string(), arrow.float64()),
             'warnings': arrow.list_(arrow.string()), 'fitted': arrow.string(),
             'seconds': arrow.float64()}
    schema = arrow.schema([arrow.field(name, kind, metadata={'unit': FIRST[name]}
                                       if FIRST.get(name) else None)
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
    """A row as text: maps as JSON, lists with bars between."""
    return {**row, 'phases': json.dumps(row['phases']) if row['phases'] else '',
            'joints': json.dumps(row['joints']) if row['joints'] else '',
            'warnings': ' | '.join(row['warnings'])}

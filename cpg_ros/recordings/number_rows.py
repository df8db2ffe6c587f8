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

"""Rows of numbers out of lines of text, with every mistake named by its line."""

from collections.abc import Sequence
from pathlib import Path

from cpg_ros.recordings.recording import RecordingError
import numpy as np


def number_rows(lines: Sequence[str], delimiter: str | None, width: int, path: Path, first: int
                ) -> tuple[np.ndarray, list[str]]:
    """Return the numbers of lines that are not blank, nan where a cell is empty, and notes.

    A last line with fewer cells than the others is one that was not written to its end: it is
    left out.

    Args:
        lines: of text.
        delimiter: of cells; None for any white space.
        width: cells in a line; more may follow if they are empty.
        path: for messages.
        first: number of the first of the lines, counted from 1.

    Returns:
        Numbers, shape (rows, width), and what was left out, one line each.

    Raises:
        RecordingError: a cell that is no number, or a line of another width.

    """
    numbered = [(k, line) for k, line in enumerate(lines, first) if line.strip()]
    try:
        table = np.loadtxt([line for _, line in numbered], delimiter=delimiter, comments=None,
                           ndmin=2) if numbered else np.empty((0, width))
        if table.shape[1] == width:
            return table, []
    except ValueError:
        pass  # Cells that are empty or no number: which, the slow way tells.
    rows: list[list[float]] = []
    notes = []
    for number, line in numbered:
        cells = line.rstrip('\r\n').split(delimiter)
        while len(cells) > width and not cells[-1].strip():
            cells.pop()
        if len(cells) < width and number == numbered[-1][0] and rows:
            notes.append(f'line {number} is cut, left out')
            continue
        if len(cells) != width:
            raise RecordingError(f'{path}, line {number}: {len(cells)} columns, where there '
                                 f'should be {width}')
        rows.append([_number(cell, path, number) for cell in cells])
    return np.array(rows).reshape(-1, width), notes


def _number(cell: str, path: Path, line: int) -> float:
    cell = cell.strip()
    try:
        return float(cell) if cell else float('nan')
    except ValueError:
        raise RecordingError(f'{path}, line {line}: {cell[:40]!r} is not a number') from None

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

"""Text tables: rows of numbers, limits of unpacked size, stamps of frames, preambles."""

import codecs
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
import csv
from datetime import datetime, UTC
import gzip
import io
import itertools
import math
import os
from pathlib import Path
from typing import cast, IO
import zlib

from cpg_ros.common import files
from cpg_ros.fitting.recordings.recording import MAX_TIME, Option, RecordingError
import numpy as np

# Rows of numbers out of lines of text, with every mistake named by its line.

BOOLEANS = {'true': 1.0, 'false': 0.0}
#: What the words of a column count as; None for no number.
Meaning = Callable[[str], float | None]


def number_in(cell: str) -> float | None:
    """Return the number in a cell, nan if it is empty, None if it is something else."""
    try:
        return float(cell) if cell.strip() else float('nan')
    except ValueError:
        return None


def seconds_of(date: str) -> float | None:
    """Return the seconds since 1970 of a date of ISO 8601, UTC by default; None if it is none."""
    try:
        when = datetime.fromisoformat(date)
    except ValueError:
        return None
    return (when if when.tzinfo else when.replace(tzinfo=UTC)).timestamp()


def cells_of(line: str, delimiter: str | None, where: str) -> list[str]:
    """Return the cells of a line; the delimiter None is any white space.

    Raises:
        RecordingError: it is no text, or quotes do not end; messages begin with ``where``.

    """
    if '\0' in line:
        raise RecordingError(f'{where}: not a text file (a byte 0)')
    if delimiter is None:
        return line.split()
    try:
        return next(csv.reader([line], delimiter=delimiter, strict=True), [])
    except csv.Error as error:
        raise RecordingError(f'{where}: {error}') from error


def number_rows(lines: Sequence[str], headers: Sequence[str], delimiter: str | None, path: Path,
                first: int, *, cut: bool = True,
                words: Mapping[int, Meaning] | None = None,
                fixed: Mapping[int, str] | None = None) -> tuple[np.ndarray, list[str]]:
    """Return the numbers of lines that are not blank, nan where a cell is empty, and notes.

    Args:
        lines: of text.
        headers: of the columns; '' for those that need not contain numbers.
        delimiter: of cells; None for any white space.
        path: for messages.
        first: number of the first line, counted from 1.
        cut: drop a last line with fewer cells, as incompletely written.
        words: column -> what its words mean, such as dates.
        fixed: column -> text in all of its lines.

    Returns:
        Numbers, shape (rows, columns), and a line for each kind of row that was dropped.

    Raises:
        RecordingError: a cell is no number, or a line has another width.

    """
    numbered = [(k, line) for k, line in enumerate(lines, first) if line.strip()]
    width = len(headers)
    try:
        table = np.loadtxt([line for _, line in numbered], delimiter=delimiter, comments=None,
                           ndmin=2) if numbered else np.empty((0, width))
        if table.shape[1] == width:
            return table, []
    except ValueError:
        pass  # Cells that are empty or no number: which, the slow way tells.
    rows: list[list[float]] = []
    notes: dict[str, None] = {}
    for number, line in numbered:
        where = f'{path}, line {number}'
        cells = cells_of(line, delimiter, where)
        while len(cells) > width and not cells[-1].strip():
            cells.pop()
            notes['lines that end in a delimiter'] = None
        if cut and len(cells) < width and number == numbered[-1][0] and rows:
            notes[f'line {number} is cut, left out'] = None
            continue
        if len(cells) != width:
            raise RecordingError(f'{where}: {len(cells)} columns, where the header has {width}')
        for k, text in (fixed or {}).items():
            if cells[k] != text:
                raise RecordingError(f'{where}: joint {cells[k][:40]!r}, where the first line has '
                                     f'{text!r}')
        row = [number_in(cell) if header else math.nan
               for cell, header in zip(cells, headers, strict=True)]
        for k, meaning in (words or {}).items():
            row[k] = meaning(cells[k].strip()) if row[k] is None else row[k]
        if None in row:
            k = row.index(None)
            raise RecordingError(f'{where}, column {headers[k]!r}: {cells[k].strip()[:40]!r} is '
                                 'not a number')
        rows.append(cast(list[float], row))
    return np.array(rows).reshape(-1, width), list(notes)


# Limits of unpacked data: a small file may hold endless zeros.

#: A file may unpack to UNPACKED_ALLOWANCE bytes, or MAX_UNPACKED_RATIO times its size if more.
UNPACKED_ALLOWANCE, MAX_UNPACKED_RATIO = 20_000_000, 100


class UnpackedSize:
    """Counter of the bytes unpacked from one file, chunk or message."""

    def __init__(self, packed: int) -> None:
        self.most, self._size = max(UNPACKED_ALLOWANCE, MAX_UNPACKED_RATIO * packed), 0

    def add(self, count: int) -> None:
        """Count bytes.

        Raises:
            RecordingError: there are too many.

        """
        self._size += count
        if self._size > self.most:
            raise RecordingError(
                f'more than {self.most / 1e6:.0f} MB unpacked, which recordings do not have; if '
                'this one does, unpack it and read that')


# Stamps of frames that have numbers but no times.

FPS = Option('fps', 'frames a second, for files that do not say', 'HZ')
MIN_FPS, MAX_FPS = 1e-2, 1e6


def stamps_of_frames(frames: np.ndarray, fps: str | float | None, path: Path) -> np.ndarray:
    """Return the stamps of frames.

    Args:
        frames: their numbers, shape (n,).
        fps: frames per second, a number or its text; None if unknown.
        path: for messages.

    Returns:
        ns, int64, shape (n,).

    Raises:
        RecordingError: the rate is missing or impossible, or a frame has no number.

    """
    if fps is None:
        raise RecordingError(f'{path}: it has no times: give the frames a second (fps)')
    try:
        rate = float(fps)
    except ValueError:
        rate = math.nan
    if not MIN_FPS <= rate <= MAX_FPS:
        raise RecordingError(f'{path}: {fps!s:.40} frames a second are not from {MIN_FPS:g} to '
                             f'{MAX_FPS:g}')
    seconds = np.asarray(frames, float) / rate
    if not (np.abs(seconds) < MAX_TIME).all():
        raise RecordingError(f'{path}: frames without a plausible number')
    return np.rint(seconds * 1e9).astype(np.int64)


#: MAX_SIZE: of a file, bytes, packed or not; MAX_LINE_LENGTH: letters.
MAX_SIZE, MAX_LINE_LENGTH = 4_000_000_000, 1 << 17
#: MAX_LINES: of a file that is in memory as text: six hours at 100 Hz.
MAX_LINES = 2_000_000
GZIP_MAGIC = b'\x1f\x8b'
#: UTF-16 is how some spreadsheets write tables.
UTF_16_BOMS = codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE
#: SEPARATORS: stripped at the end of a line, such as delimiters of empty cells.
SEPARATORS = ',;\t \r\n'
#: Of OpenSim's .mot and .sto files.
PREAMBLE_END, MAX_PREAMBLE_LINES = 'endheader', 100
class _Lines(io.TextIOWrapper):
    """Text with a limit on the length of lines, which would otherwise fill the memory.

    Attributes:
        path: of the file.

    """

    path = Path()

    def readline(self, size: int | None = -1, /) -> str:  # type: ignore[override]
        """Read a line.

        Raises:
            RecordingError: it is too long.

        """
        line = super().readline(MAX_LINE_LENGTH)
        if len(line) == MAX_LINE_LENGTH:
            raise RecordingError(f'{self.path}: not a table: a line has {MAX_LINE_LENGTH} letters '
                                 'or more')
        return line

    def __next__(self) -> str:  # type: ignore[override]
        if line := self.readline():
            return line
        raise StopIteration


class _Unpacked(gzip.GzipFile):
    """The unpacked contents of a file, limited to the size of a recording."""

    def __init__(self, file: IO[bytes], path: Path) -> None:
        super().__init__(fileobj=file)
        self._path, self._unpacked = path, UnpackedSize(os.fstat(file.fileno()).st_size)

    def read1(self, size: int = -1) -> bytes:
        """Read some bytes; text is read by this alone."""
        data = super().read1(size)
        try:
            self._unpacked.add(len(data))
        except RecordingError as error:
            raise RecordingError(f'{self._path}: {error}') from error
        return data


@contextmanager
def opened(path: Path) -> Iterator[io.TextIOBase]:
    """Open a text, compressed by gzip or not.

    Raises:
        RecordingError: it is not a regular file, truncated, damaged, no text, or larger than
            recordings may be (see `UnpackedSize`); also within the context.

    """
    try:
        with files.opened(path, RecordingError, largest=MAX_SIZE) as file:
            start = file.read(2)
            file.seek(0)
            unpacked = _Unpacked(file, path) if start == GZIP_MAGIC else file
            with _Lines(cast(IO[bytes], unpacked), newline='',
                        encoding='utf-16' if start in UTF_16_BOMS else 'utf-8-sig') as text:
                text.path = path
                yield text
    except (gzip.BadGzipFile, zlib.error, EOFError) as error:
        raise RecordingError(f'{path}: packed by gzip, and damaged: {error}') from error
    except OSError as error:
        raise RecordingError(f'{path}: {error.strerror}') from error
    except UnicodeDecodeError as error:
        raise RecordingError(f'{path}: not a text file ({error.reason})') from error


def remaining_lines(text: io.TextIOBase, path: Path) -> list[str]:
    """Return the lines that are left of a text.

    Raises:
        RecordingError: they are more than MAX_LINES.

    """
    lines = list(itertools.islice(text, MAX_LINES + 1))
    if len(lines) > MAX_LINES:
        raise RecordingError(f'{path}: more than {MAX_LINES} lines: divide it into parts')
    return lines


def preamble(first: str, text: Iterator[str]
             ) -> tuple[str, int, str | None, int | None] | None:
    """Skip the preamble of OpenSim's files.

    Args:
        first: its first line, already read.
        text: the rest.

    Returns:
        The header line, the number of lines before it, and, if declared, the unit of angles and
            the number of rows; None if it is no such file.

    """
    lines = [first]
    while lines[-1].strip(SEPARATORS).lower() != PREAMBLE_END:
        lines.append(next(text, ''))
        if not lines[-1] or len(lines) > MAX_PREAMBLE_LINES:
            return None
    values = {name.strip().lower(): value.strip(SEPARATORS).lower()
              for name, mark, value in (line.partition('=') for line in lines) if mark}
    units = {'yes': 'deg', 'no': 'rad'}
    rows = values.get('nrows', values.get('datarows', ''))
    return (next(text, ''), len(lines), units.get(values.get('indegrees', '')),
            int(rows) if rows.isdecimal() and len(rows) < 12 else None)

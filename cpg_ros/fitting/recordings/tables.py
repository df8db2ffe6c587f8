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

"""The text of tables as programs write it: packed, with a preamble, with a row of units."""

import codecs
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from fnmatch import fnmatchcase
import gzip
import io
import itertools
import math
import os
from pathlib import Path
import re
from typing import cast, IO
import zlib

from cpg_ros.common import files
from cpg_ros.fitting.recordings.recording import (
    abbreviate,
    FootLoads,
    LATEST,
    Option,
    RecordingError,
)
import numpy as np

# What the columns of a table are: its time, angles of joints, and loads on feet.

#: What a header may call its unit -> that in rad, or in s.
ANGLES = {'rad': 1.0, 'radian': 1.0, 'radians': 1.0,
          'deg': np.pi / 180.0, 'degree': np.pi / 180.0, 'degrees': np.pi / 180.0,
          '°': np.pi / 180.0}
TIMES = {'s': 1.0, 'sec': 1.0, 'secs': 1.0, 'second': 1.0, 'seconds': 1.0,
         'ms': 1e-3, 'msec': 1e-3, 'us': 1e-6, 'ns': 1e-9, 'nsec': 1e-9}
#: 'knee [deg]', 'Time(s)', and for times also 'time_ms'.
BRACKETED = re.compile(r'^(.*?)\s*[\[(]\s*([^\[\]()]*?)\s*[\])]$')
TIME = re.compile(r'^[_%#/\s]*(t|time|times|stamp|timestamp|time_?stamp|zeit|temps|tiempo|tempo'
                  r'|elapsed[_ ]time)(?:[_ ]([a-z]+))?$', re.I)
#: Times by another clock, taken where there is no other; and halves of a stamp in integers.
RECEIPT = re.compile(r'^(receive|recv|log|publish)[_ ]?time$', re.I)
SECONDS = re.compile(r'^(.*[./_])?(secs?)$', re.I)
NANOSECONDS = re.compile(r'^(.*[./_])?(nanosecs?|nsecs?)$', re.I)
#: In a table with a line for each value: columns of names, and of values.
NAMED = re.compile(r'^(joint|joint_?name|name|topic|variable|series|label|signal|channel)$', re.I)
VALUE = re.compile(r'^(position|pos|angle|value|q)$', re.I)
#: Where a stride is 0 to 100 %: '%', 'percent', 'Gait cycle [%]'.
SHARE = re.compile(r'^(%|percent|%? ?(percent_?)?(gait|stride)?[_ ]?cycle)([_ ]?percent)?$', re.I)
#: Among other columns, those so called are the joints': 'JointPosFR_hip', as PlotJuggler has it
#: '/joint_states/lf_knee/position'.
POSITION = re.compile(r'^joint_?pos(?:ition)?s?[_./ ]*(.+)$|^/.*/position/([^/]+)$'
                      r'|^/.*/([^/]+)/position$', re.I)
#: Words of a load on a foot, and those of one of several axes of it.
LOAD = {'force', 'forces', 'contact', 'contacts', 'load', 'loads', 'grf', 'fz'}
AXIS = {'x', 'y', 'z', 'fx', 'fy', 'vx', 'vy', 'vz', 'px', 'py', 'pz'}
#: A contact may be written as a word.
TRUTH = {'true': 1.0, 'false': 0.0}


@dataclass(frozen=True)
class Column:
    """Where a number is, what its header says, which joint it is of, and its unit's size."""

    index: int
    header: str
    joint: str
    scale: float


def split(header: str) -> tuple[str, str | None]:
    """Return name and unit of a header."""
    match = BRACKETED.match(header)
    return (match[1], match[2]) if match else (header, None)


def number_in(cell: str) -> float | None:
    """Return the number in a cell, nan where it is empty, None where it is something else."""
    cell = cell.strip()
    if not cell:
        return float('nan')
    try:
        return float(cell)
    except ValueError:
        return None


def load_columns(headers: list[str]) -> list[Column]:
    """Return the columns of loads on feet, or of whether they touch the ground: two or more."""
    found = []
    for k, header in enumerate(headers):
        name, unit = split(header)
        words = {word.lower() for word in re.findall(r'[A-Z]?[a-z]+|[A-Z]+', name)}
        if (len(words) > 1 and words & LOAD and not words & AXIS
                and (unit is None or unit.lower() not in ANGLES)):
            found.append(Column(k, header, name, 1.0))
    return found if len(found) > 1 else []


class LoadColumns:
    """Those of a table that are loads on feet, and what they hold."""

    def __init__(self, columns: list[Column]) -> None:
        self.columns = columns
        self._seconds: list[np.ndarray] = []
        self._rows: list[np.ndarray] = []

    def add(self, seconds: np.ndarray, numbers: np.ndarray) -> None:
        """Take some lines of the table: times, s, and all its columns, shape (n, columns)."""
        if self.columns:
            self._seconds.append(seconds)
            self._rows.append(numbers[:, [column.index for column in self.columns]])

    def taken(self, start: float, length: float) -> FootLoads | None:
        """Return the loads from a time on, for some seconds; None if there are no columns."""
        if not self._rows:
            return None
        times = np.concatenate(self._seconds) - start
        rows = np.concatenate(self._rows)
        held = (times >= 0.0) & (times <= length) & np.isfinite(rows).all(axis=1)
        times, rows = times[held], rows[held]
        rising = np.append(True, np.diff(times) > 0.0)[:len(times)]
        return FootLoads(tuple(column.joint for column in self.columns), times[rising],
                         rows[rising])


# Rows of numbers out of lines of text, with every mistake named by its line.

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


# How large what is unpacked may become: a small file may hold zeros without end.

#: What a file may always unpack to, bytes; a larger one to so many times its own size.
ALWAYS, RATIO = 20_000_000, 100


class UnpackedSize:
    """Counts the bytes that come out of one file, chunk or message."""

    def __init__(self, packed: int) -> None:
        self.most, self._size = max(ALWAYS, RATIO * packed), 0

    def add(self, count: int) -> None:
        """Count bytes.

        Raises:
            RecordingError: they have become too many.

        """
        self._size += count
        if self._size > self.most:
            raise RecordingError(
                f'more than {self.most / 1e6:.0f} MB unpacked, which recordings do not have; if '
                'this one does, unpack it and read that')


# Stamps of frames that have numbers but no times.

FPS = Option('fps', 'frames a second, for files that do not say', 'HZ')
#: Slowest and fastest that is believed, Hz.
SLOWEST, FASTEST = 1e-2, 1e6


def stamps_of_frames(frames: np.ndarray, fps: str | float | None, path: Path) -> np.ndarray:
    """Return the stamps of frames.

    Args:
        frames: their numbers, shape (n,).
        fps: frames a second, as a number or its text; None if nobody said.
        path: for messages.

    Returns:
        ns, int64, shape (n,).

    Raises:
        RecordingError: there is no rate or an impossible one, or a frame without a number.

    """
    if fps is None:
        raise RecordingError(f'{path}: it has no times: give the frames a second (fps)')
    try:
        rate = float(fps)
    except ValueError:
        rate = math.nan
    if not SLOWEST <= rate <= FASTEST:
        raise RecordingError(f'{path}: {fps!s:.40} frames a second are not from {SLOWEST:g} to '
                             f'{FASTEST:g}')
    seconds = np.asarray(frames, float) / rate
    if not (np.abs(seconds) < LATEST).all():
        raise RecordingError(f'{path}: frames without a plausible number')
    return np.rint(seconds * 1e9).astype(np.int64)


# The joints of a file that names or patterns ask for.

def matching(wanted: Sequence[str], names: Sequence[str], source: str) -> list[str]:
    """Return the names that are asked for, each once, in the order in which they are.

    Args:
        wanted: names, or patterns such as 'left*'; all names, if empty.
        names: that are there.
        source: what to call the file in messages.

    Raises:
        RecordingError: nothing fits one of them.

    """
    found: list[str] = []
    for pattern in wanted:
        fitting = [name for name in names if pattern == name or fnmatchcase(name, pattern)]
        if not fitting:
            raise RecordingError(f'{source}: no joint {pattern!r}; there are '
                                 f'{abbreviate(names, 40)}')
        found += fitting
    return list(dict.fromkeys(found if wanted else names))


#: Largest file, bytes, packed or not, and longest line, letters.
LARGEST, LONGEST = 4_000_000_000, 1 << 17
#: Most lines of a file that is kept as text while it is read: six hours at 100 Hz.
MOST_LINES = 2_000_000
#: What a file packed by gzip begins with.
GZIP = b'\x1f\x8b'
#: What a file in UTF-16 begins with, as some spreadsheets write it.
UTF_16 = codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE
#: What may end a line, such as the delimiters that spreadsheets fill it up with.
EMPTY = ',;\t \r\n'
#: The preamble of OpenSim's .mot and .sto files ends so, after this many lines at most.
END, PREAMBLE = 'endheader', 100
#: What a row of units has in its cells, beside numbers that would make it one of samples.
UNIT = re.compile(r'[(\[]?\s*([a-zA-Z°%][a-zA-Z°%/^*.0-9]{0,11}|-|)\s*[)\]]?')
#: A number with a decimal comma.
COMMA = re.compile(r'\s*[-+]?\d*,\d+([eE][-+]?\d+)?\s*')


class _Lines(io.TextIOWrapper):
    """Text whose lines have a largest length: what has none is no table, and fills the memory.

    Attributes:
        path: of the file.

    """

    path = Path()

    def readline(self, size: int | None = -1, /) -> str:  # type: ignore[override]
        """Read a line.

        Raises:
            RecordingError: it is too long.

        """
        line = super().readline(LONGEST)
        if len(line) == LONGEST:
            raise RecordingError(f'{self.path}: not a table: a line has {LONGEST} letters or more')
        return line

    def __next__(self) -> str:  # type: ignore[override]
        if line := self.readline():
            return line
        raise StopIteration


class _Unpacked(gzip.GzipFile):
    """What is packed in a file, of which no more than a recording has is read."""

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
    """Open a text, packed by gzip or not.

    Raises:
        RecordingError: it is no regular file, cut or damaged, no text, or unpacks to more than
            recordings have (see `UnpackedSize`); from within, too.

    """
    try:
        with files.opened(path, RecordingError, largest=LARGEST) as file:
            start = file.read(2)
            file.seek(0)
            unpacked = _Unpacked(file, path) if start == GZIP else file
            with _Lines(cast(IO[bytes], unpacked), newline='',
                        encoding='utf-16' if start in UTF_16 else 'utf-8-sig') as text:
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
        RecordingError: they are more than MOST_LINES.

    """
    lines = list(itertools.islice(text, MOST_LINES + 1))
    if len(lines) > MOST_LINES:
        raise RecordingError(f'{path}: more than {MOST_LINES} lines: divide it into parts')
    return lines


def preamble(first: str, text: Iterator[str]
             ) -> tuple[str, int, str | None, int | None] | None:
    """Pass over the preamble of OpenSim's files.

    Args:
        first: its first line, read already.
        text: the rest.

    Returns:
        The line of the header, how many lines come before that, and, if they are declared, the
        unit of angles and the number of rows; None if it is no such file.

    """
    lines = [first]
    while lines[-1].strip(EMPTY).lower() != END:
        lines.append(next(text, ''))
        if not lines[-1] or len(lines) > PREAMBLE:
            return None
    values = {name.strip().lower(): value.strip(EMPTY).lower()
              for name, mark, value in (line.partition('=') for line in lines) if mark}
    units = {'yes': 'deg', 'no': 'rad'}
    rows = values.get('nrows', values.get('datarows', ''))
    return (next(text, ''), len(lines), units.get(values.get('indegrees', '')),
            int(rows) if rows.isdecimal() and len(rows) < 12 else None)


def units_of(cells: Sequence[str]) -> list[str] | None:
    """Return the units that a row has, '' where a column has none; None if it is no such row."""
    found = [UNIT.fullmatch(cell.strip()) for cell in cells]
    units = ['' if match is None or match[1] == '-' else match[1] for match in found]
    return units if all(found) and any(units) and 'nan' not in map(str.lower, units) else None


def decimal_commas(line: str, delimiter: str) -> bool:
    """Tell whether the numbers of a line have decimal commas, and no decimal points."""
    return (delimiter != ',' and '.' not in line
            and any(COMMA.fullmatch(cell) for cell in line.strip().split(delimiter)))

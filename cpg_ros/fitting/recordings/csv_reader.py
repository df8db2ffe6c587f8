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

"""Joint angles out of CSV files: a time column and one column per joint."""

from collections.abc import Iterator, Sequence
import csv
from dataclasses import replace
from fnmatch import fnmatchcase
import io
from itertools import chain, islice, takewhile
from pathlib import Path

from cpg_ros.common.command_line import printable, progress_bar
from cpg_ros.fitting.recordings.recording import (
    abbreviate,
    Chunk,
    JOINTS,
    LATEST,
    merged,
    Option,
    Recording,
    RecordingError,
    RecordingFormat,
    require,
    UNIT,
    UNNAMED,
)
from cpg_ros.fitting.recordings.tables import (
    ANGLES,
    Column,
    decimal_commas,
    EMPTY,
    load_columns,
    LoadColumns,
    MOST_LINES,
    NAMED,
    NANOSECONDS,
    number_in,
    opened,
    POSITION,
    PREAMBLE,
    preamble,
    RECEIPT,
    SECONDS,
    SHARE,
    split,
    TIME,
    TIMES,
    TRUTH,
    units_of,
    VALUE,
)
from cpg_ros.fitting.recordings.thinned import pluralize
import numpy as np

DELIMITERS = ',;\t'
#: A time that is so far ahead of both neighbours (s) is a stamp gone wrong.
ASTRAY = 3600.0
#: Lines that are parsed together.
LINES = 8192


def read_csv(path: str | Path, unit: str | None = None, time: str | None = None,
             joints: Sequence[str] = (), progress: bool = True) -> Recording:
    """Read joint angles from a CSV file (commas, semicolons or tabs; the first line the header).

    A unit in a header, as in `knee [deg]` or `time [ms]`, counts for its column; other columns
    are in `unit` and `time`, or in rad and s. Columns in another unit are not joints. Where some
    columns are called positions (`JointPosFR_hip`), only those are joints, named `FR_hip`.
    Otherwise every column but the time is a joint.

    The file may be packed by gzip or have OpenSim's preamble (.mot, .sto), a second header row of
    units, decimal commas where commas do not part the columns, and delimiters at the ends of its
    lines. A single time far ahead of both neighbours is left out. Instead of a time there
    may be a column such as `Gait cycle [%]`; the duration of the stride is then to be given (see
    `repeat_stride`).

    Args:
        path: the file.
        unit: 'rad' or 'deg', of columns whose header names no unit.
        time: 's', 'ms', 'us' or 'ns', of the time column if its header names no unit.
        joints: the joints or columns to take, in this order, or patterns such as 'JointPos*';
            all joints, if empty.
        progress: show a progress bar.

    Raises:
        RecordingError: see `merged`; a file that is no such table, time that goes back, or a
            value that is no number; the message names line and column.

    """
    path = Path(path)
    for value, units in ((unit, ANGLES), (time, TIMES)):
        if value is not None and value not in units:
            raise RecordingError(f'{path}: unit {value!r} is none of '
                                 f'{abbreviate(list(units), 20)}')
    with opened(path) as file:
        size = path.stat().st_size
        table = _Table(path, file, unit, time, joints)
        with progress_bar(f'reading {path.name}', max(1, size), enabled=progress) as bar:
            def chunks() -> Iterator[Chunk]:
                for chunk in table.chunks():
                    yield chunk
                    bar(min(size, table.read))

            recording = merged(chunks(), printable(str(path)),
                               [column.joint for column in table.columns])
    notes = [*table.notes, *(['lines that end in a delimiter'] if table.ended else [])]
    return replace(recording, notes=(*notes, *recording.notes),
                   cycle=np.nan if table.shares else 0.0,
                   loads=table.loads.taken(recording.start, recording.times[-1]))


class _Table:
    """A CSV file, its header read."""

    def __init__(self, path: Path, file: io.TextIOBase, unit: str | None, time: str | None,
                 joints: Sequence[str]) -> None:
        self.path = path
        self.line, self.read = 1, 0
        self.notes: list[str] = []
        #: Cells that are the same in all rows.
        self.fixed: dict[int, str] = {}
        line = file.readline()
        while line and not line.strip():
            line, self.line = file.readline(), self.line + 1
        if not line:
            raise RecordingError(f'{path}: the file is empty')
        self._printable(line, self.line)
        head = [line, *islice(file, PREAMBLE)]
        rest = iter(head[1:])
        if not any(map(line.strip(EMPTY).count, DELIMITERS)) and (
                found := preamble(line, rest)) is not None:
            line, self.line, declared = found[0], self.line + found[1], found[2]
            if unit and declared and unit != declared:
                raise RecordingError(f'{path}: its preamble says {declared}, not {unit}')
            unit = unit or declared
        else:
            before = _lines_before_header(head)
            line, rest = head[before], iter(head[before + 1:])
            if before:
                self.line += before
                self.notes.append(f'{pluralize(before, "line")} before the header, passed over')
        self.lines = chain(rest, file)
        self.delimiter = max(DELIMITERS, key=line.count)
        headers = [header.strip() for header in self._cells(line.lstrip('#'), self.line)]
        if echoed := self._echoed(headers):
            headers, self.lines = echoed, chain([line], self.lines)
            self.line -= 1
        while len(headers) > 2 and not headers[-1] and not echoed:
            headers.pop()
        if len(headers) < 2:
            raise RecordingError(f'{path}, line {self.line}: one column only, '
                                 f'{"".join(headers)!r}; a table has a time column and one per '
                                 'joint')
        if all(number_in(header) is not None for header in headers if header):
            raise RecordingError(f'{path}, line {self.line}: no header; the first line has to '
                                 'name the columns')
        headers = self._begin(headers)
        self.time = self._time(headers, time)
        self.loads = LoadColumns(load_columns(headers))
        if self.loads.columns:
            self.notes.append('taken for loads on the feet: '
                              + abbreviate([one.header for one in self.loads.columns]))
        self.columns = self._joints(headers, unit, joints)
        self.last = -np.inf

    def _begin(self, headers: list[str]) -> list[str]:
        """Look at the first line below the header; return the header as it is to be read."""
        self.width, self.ended = len(headers), False
        first = next(self.lines, '')
        if (named := self._units(headers, first)) != headers:
            headers, first = named, next(self.lines, '')
            self.line += 1
            self.notes.append(f'line {self.line} is taken for the units of the columns')
        self.commas = decimal_commas(first, self.delimiter)
        if self.commas:
            self.notes.append('commas are taken for decimal points')
        self.lines = chain([first] if first else [], self.lines)
        if first.strip() and '\0' not in first and (places := _tidy(
                headers, self._cells(first, self.line + 1))):
            headers = self._widened(headers, *places)
            self.width = len(headers)
        return headers

    def _echoed(self, cells: list[str]) -> list[str]:
        """Return headers for the output of ``ros2 topic echo --csv``, [] for any other line.

        Its lines are the seconds and nanoseconds of the stamp, the frame, the names, positions,
        velocities and efforts.
        """
        if len(cells) < 5 or not (cells[0].isdecimal() and cells[1].isdecimal()
                                  and len(cells[1]) < 10):
            return []
        names = list(takewhile(lambda cell: number_in(cell) is None, cells[3:]))
        rest = cells[3 + len(names) + len(names):]
        if not names or len(cells) < 3 + 2 * len(names):
            return []
        self.fixed = dict(enumerate(names, 3))
        self.notes.append('taken for the output of ros2 topic echo --csv')
        return ['sec', 'nanosec', '', *[''] * len(names), *names, *[''] * len(rest)]

    def _widened(self, headers: list[str], name: int, value: int) -> list[str]:
        """Turn a table with a line for each value into one with a column for each joint.

        Args:
            headers: of the columns.
            name: the column of the joints' names.
            value: that of their angles.

        Returns:
            The headers of the new table, whose lines replace those of the file.

        """
        time = self._time(headers, None).index
        rows: dict[str, dict[str, str]] = {}
        joints: dict[str, None] = {}
        for number, line in enumerate(self.lines, self.line + 1):
            self.read += len(line)
            if number > MOST_LINES:
                raise RecordingError(f'{self.path}: more than {MOST_LINES} lines: divide it into '
                                     'parts')
            if not line.strip():
                continue
            self._printable(line, number)
            cells = self._cells(line, number)
            if len(cells) < self.width:
                raise RecordingError(f'{self.path}, line {number}: {len(cells)} columns, where '
                                     f'the header has {self.width}')
            when, joint = cells[time].strip(), cells[name].strip()
            for cell in (when, cells[value]):
                if number_in(cell) is None:
                    raise RecordingError(f'{self.path}, line {number}: {cell.strip()[:40]!r} is '
                                         'not a number')
            joints.setdefault(joint)
            rows.setdefault(when, {}).setdefault(joint, cells[value].strip())
        unit = split(headers[value])[1]
        self.notes.append(f'a line for each value: {headers[value]!r} by {headers[name]!r}')
        times = sorted(rows, key=lambda when: number_in(when) or 0.0)
        self.lines = chain(self.delimiter.join((when, *(rows[when].get(joint, '')
                                                        for joint in joints))) + '\n'
                           for when in times)
        return [headers[time], *(f'{joint} [{unit}]' if unit else joint for joint in joints)]

    def _cells(self, line: str, number: int) -> list[str]:
        try:
            return next(csv.reader([line], delimiter=self.delimiter, strict=True))
        except csv.Error as error:
            raise RecordingError(f'{self.path}, line {number}: {error}') from error

    def _units(self, headers: list[str], line: str) -> list[str]:
        """Return the headers with the units that the next line has, if it is one of units."""
        if '\0' in line or not line.strip() or any(split(header)[1] for header in headers):
            return headers
        cells = self._cells(line, self.line + 1)
        units = units_of(cells[:self.width])
        if units is None or len(units) < self.width or any(map(str.strip, cells[self.width:])):
            return headers
        return [f'{header} [{unit}]' if unit else header
                for header, unit in zip(headers, units, strict=True)]

    def _printable(self, line: str, number: int) -> None:
        if '\0' in line:
            raise RecordingError(f'{self.path}, line {number}: not a text file (a byte 0)')

    def _time(self, headers: list[str], option: str | None) -> Column:
        """Find the time column, or that of the seconds beside one of nanoseconds."""
        self.rest, self.shares = -1, False
        found: list[tuple[int, str, str | None]] = []
        for k, header in enumerate(headers):
            name, unit = split(header)
            match = TIME.match(name)
            if match and match[2]:
                unit = unit or match[2]
            if match and (unit is None or unit in TIMES):
                found.append((k, header, unit))
        names = [split(header)[0] for header in headers]
        if len(found) != 1:
            pair = [[k for k, name in enumerate(names) if kind.match(name)]
                    for kind in (SECONDS, NANOSECONDS)]
            if len(pair[0]) == len(pair[1]) == 1:
                self.rest = pair[1][0]
                return Column(pair[0][0], headers[pair[0][0]], '', 1.0)
        shares = [k for k, name in enumerate(names)
                  if SHARE.match(name) and split(headers[k])[1] in (None, '%')]
        self.shares = not found and len(shares) == 1
        if self.shares:
            return Column(shares[0], headers[shares[0]], '', 0.01)
        if not found:
            found += [(k, name, None) for k, name in enumerate(names) if RECEIPT.match(name)][:1]
        if len(found) != 1:
            raise RecordingError(
                f'{self.path}, line {self.line}: '
                + (f'{len(found)} time columns, {abbreviate([one[1] for one in found])}' if found
                   else
                   "no time column, such as 'time' or 'time [ms]'; the columns are "
                   + abbreviate(headers, 20)))
        k, header, unit = found[0]
        return Column(k, header, '', self._scale(header, unit, option, TIMES))

    def _scale(self, header: str, unit: str | None, option: str | None,
               units: dict[str, float]) -> float:
        """Return the size of a column's unit: its header's, the option's, or the first."""
        if unit and option and units[unit.lower()] != units[option]:
            raise RecordingError(f'{self.path}: column {header!r} is in {unit}, not {option}')
        return units[(unit or option or next(iter(units))).lower()]

    def _joints(self, headers: list[str], option: str | None, wanted: Sequence[str]
                ) -> list[Column]:
        """Find the joints' columns."""
        columns, others = [], []
        loads = {column.index for column in self.loads.columns}
        for k, header in enumerate(headers):
            name, unit = split(header)
            if k in (self.time.index, self.rest) or k in loads or not name or any(
                    kind.match(name) for kind in (RECEIPT, SECONDS, NANOSECONDS)):
                continue
            if UNNAMED.match(header):
                name, unit = header.rpartition('.')[2], None
            if unit is None or unit.lower() in ANGLES:
                columns.append(Column(k, header, name,
                                       self._scale(header, unit, option, ANGLES)))
            else:
                others.append(header)
        positions = [replace(column, joint=match[match.lastindex or 0])
                     for column in columns if (match := POSITION.match(column.joint))]
        named = {column.index: column for column in (*columns, *positions)}
        if wanted:
            matches = []
            for pattern in wanted:
                fitting = [column for column in named.values() if any(
                    pattern == name or fnmatchcase(name, pattern)
                    for name in (column.joint, column.header))]
                if not fitting:
                    raise RecordingError(f'{self.path}: no column {pattern!r}; there are '
                                         f'{abbreviate([one.header for one in columns], 40)}')
                matches += fitting
            columns = list(dict.fromkeys(matches))
        else:
            others += [one.header for one in columns] if positions else []
            columns = positions or columns
            left = [header for header in others
                    if header not in {column.header for column in columns}]
            if left:
                self.notes.append(f'{len(left)} columns left out: {abbreviate(left)}')
        names = [column.joint for column in columns]
        if not names:
            raise RecordingError(f'{self.path}, line {self.line}: no column of angles')
        require(names, names, f'{self.path}, line {self.line}')
        return columns

    def chunks(self) -> Iterator[Chunk]:
        """Yield the samples."""
        names = [column.joint for column in self.columns]
        places = [column.index for column in self.columns]
        scales = np.array([column.scale for column in self.columns])
        while lines := list(islice(self.lines, LINES)):
            self.read += sum(map(len, lines))
            if self.commas:
                lines = [line.replace(',', '.') for line in lines]
            numbers = self._numbers(lines)
            seconds = whole = numbers[:, self.time.index] * self.time.scale
            rest = numbers[:, self.rest] if self.rest >= 0 else np.zeros(len(seconds))
            seconds = whole + 1e-9 * rest
            self._check(seconds, lines)
            self.loads.add(seconds, numbers)
            # In two parts, as floats do not hold a date to the nanosecond.
            yield (np.rint(whole * 1e9).astype(np.int64) + rest.astype(np.int64), names,
                   numbers[:, places] * scales)
            self.line += len(lines)

    def _numbers(self, lines: list[str]) -> np.ndarray:
        """Return the numbers of some lines, shape (lines that are not blank, columns)."""
        if any(map(str.strip, lines)):
            try:
                numbers = np.loadtxt(lines, delimiter=self.delimiter, comments=None, ndmin=2)
                if numbers.shape[1] == self.width:
                    return numbers
            except ValueError:
                pass  # Cells without a number, or with a text: which, the slow way tells.
        loads = {column.index for column in self.loads.columns}
        needed = {column.index: column.header
                  for column in (self.time, *self.columns, *self.loads.columns)}
        if self.rest >= 0:
            needed[self.rest] = 'nanoseconds'
        rows = []
        for number, line in enumerate(lines, self.line + 1):
            if not line.strip():
                continue
            self._printable(line, number)
            cells = self._cells(line, number)
            while len(cells) > self.width and not cells[-1].strip():
                cells.pop()
                self.ended = True
            if len(cells) != self.width:
                raise RecordingError(f'{self.path}, line {number}: {len(cells)} columns, where '
                                     f'the header has {self.width}')
            for k, text in self.fixed.items():
                if cells[k] != text:
                    raise RecordingError(f'{self.path}, line {number}: joint {cells[k][:40]!r}, '
                                         f'where the first line has {text!r}')
            row = np.full(self.width, np.nan)
            for k, header in needed.items():
                value = number_in(cells[k])
                if value is None and k in loads:
                    value = TRUTH.get(cells[k].strip().lower(), np.nan)
                if value is None:
                    raise RecordingError(f'{self.path}, line {number}, column {header!r}: '
                                         f'{cells[k].strip()[:40]!r} is not a number')
                row[k] = value
            rows.append(row)
        return np.array(rows).reshape(-1, self.width)

    def _check(self, seconds: np.ndarray, lines: list[str]) -> None:
        """Refuse times that are none, or go back."""
        before = np.append(self.last, seconds[:-1])[:len(seconds)]
        wrong = ~(np.abs(seconds) < LATEST) | (seconds < before)
        # A single stamp far ahead of the next one is the one that is wrong: merged leaves it out.
        first, ahead, after = seconds[:-2], seconds[1:-1], seconds[2:]
        wrong[2:] &= ~((first <= after) & (ahead > after + ASTRAY))
        if wrong.any():
            row = int(np.argmax(wrong))
            number = [k for k, line in enumerate(lines, self.line + 1) if line.strip()][row]
            where = f'{self.path}, line {number}, column {self.time.header!r}: '
            value = float(seconds[row])
            if not np.isfinite(value):
                raise RecordingError(where + 'no time')
            if abs(value) >= LATEST:
                raise RecordingError(where + f'{value:.6g} s is not a plausible time; if it is in '
                                     'ms, us or ns, declare the unit')
            raise RecordingError(where + f'time goes back from {before[row]:.9g} to '
                                 f'{value:.9g} s')
        if len(seconds):
            self.last = float(seconds[-1])


def _lines_before_header(head: Sequence[str]) -> int:
    """Return how many lines come before the one that has the time among its columns."""
    for k, line in enumerate(head):
        cells = [split(cell.strip())[0] for cell in line.lstrip('#').strip().split(
            max(DELIMITERS, key=line.count))]
        if len(cells) > 1 and any(kind.match(cell) for kind in (TIME, RECEIPT, SECONDS, SHARE)
                                  for cell in cells):
            return k
    return 0


def _tidy(headers: Sequence[str], cells: Sequence[str]) -> tuple[int, int] | None:
    """Return the columns of names and of values of a table with a line for each value, or None."""
    names = [k for k, header in enumerate(headers) if NAMED.match(header)]
    values = [k for k, header in enumerate(headers) if VALUE.match(split(header)[0])]
    if len(names) != 1 or len(values) != 1 or len(cells) < len(headers):
        return None
    return None if number_in(cells[names[0]]) is not None else (names[0], values[0])


CSV = RecordingFormat(
    name='csv', contents='a CSV file with a column for time and one for each joint',
    help='a table with a header, optionally compressed with gzip',
    metavar='FILE',
    read=read_csv, endings=('.csv', '.csv.gz'),
    options=(JOINTS,
             UNIT,
             Option('time', 'unit of the time in the CSV file (default: as in its header, or s)',
                    choices=('s', 'ms', 'us', 'ns'))),
    lacks={'topics': 'a CSV file has none', 'servo': 'a CSV file has no efforts'})

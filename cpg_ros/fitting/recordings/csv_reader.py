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

"""Joint angles from CSV files: a time column and one column for each joint."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from fnmatch import fnmatchcase
import io
from itertools import chain, islice, takewhile
from pathlib import Path
import re

from cpg_ros.common.command_line import printable, progress_bar
from cpg_ros.fitting.recordings.downsampling import pluralize
from cpg_ros.fitting.recordings.recording import (
    abbreviate,
    ANGLE_UNITS,
    Chunk,
    FootLoads,
    INDEXED_NAME,
    JOINTS,
    MAX_TIME,
    merge_chunks,
    Option,
    Recording,
    RecordingError,
    RecordingFormat,
    require,
    UNIT,
)
from cpg_ros.fitting.recordings.tables import (
    BOOLEANS,
    cells_of,
    MAX_LINES,
    MAX_PREAMBLE_LINES,
    Meaning,
    number_in,
    number_rows,
    opened,
    preamble,
    seconds_of,
    SEPARATORS,
)
import numpy as np

# Columns of a table: time, angles of joints, loads on feet.

#: TIME_UNITS: name of a unit of time in a header -> that unit in s.
TIME_UNITS = {'s': 1.0, 'sec': 1.0, 'secs': 1.0, 'second': 1.0, 'seconds': 1.0,
              'ms': 1e-3, 'msec': 1e-3, 'us': 1e-6, 'ns': 1e-9, 'nsec': 1e-9}
#: Headers with a unit: 'knee [deg]', 'Time(s)', and for times also 'time_ms'.
UNIT_HEADER = re.compile(r'^(.*?)\s*[\[(]\s*([^\[\]()]*?)\s*[\])]$')
TIME = re.compile(r'^[_%#/\s]*(t|time|times|stamp|timestamp|time_?stamp|zeit|temps|tiempo|tempo'
                  r'|elapsed[_ ]time)(?:[_ ]([a-z]+))?$', re.I)
#: RECEIPT: times of reception, used if there is no other time; SECONDS, NANOSECONDS: parts of a
#: stamp in integers.
RECEIPT = re.compile(r'^(receive|recv|log|publish)[_ ]?time$', re.I)
SECONDS = re.compile(r'^(.*[./_])?(secs?)$', re.I)
NANOSECONDS = re.compile(r'^(.*[./_])?(nanosecs?|nsecs?)$', re.I)
#: NAME_COLUMN, VALUE_COLUMN: columns of names and of values in a table with a line for each value.
NAME_COLUMN = re.compile(
    r'^(joint|joint_?name|name|topic|variable|series|label|signal|channel)$', re.I)
VALUE_COLUMN = re.compile(r'^(position|pos|angle|value|q)$', re.I)
#: CYCLE: column of a stride's phase from 0 to 100 %: '%', 'percent', 'Gait cycle [%]'.
CYCLE = re.compile(r'^(%|percent|%? ?(percent_?)?(gait|stride)?[_ ]?cycle)([_ ]?percent)?$', re.I)
#: POSITION: columns of joints among others: 'JointPosFR_hip', or in PlotJuggler's way
#: '/joint_states/lf_knee/position'.
POSITION = re.compile(r'^joint_?pos(?:ition)?s?[_./ ]*(.+)$|^/.*/position/([^/]+)$'
                      r'|^/.*/([^/]+)/position$', re.I)
#: Words of a load on a foot, and of its components.
LOAD_WORDS = {'force', 'forces', 'contact', 'contacts', 'load', 'loads', 'grf', 'fz'}
AXIS_WORDS = {'x', 'y', 'z', 'fx', 'fy', 'vx', 'vy', 'vz', 'px', 'py', 'pz'}
UNIT_CELL = re.compile(r'[(\[]?\s*([a-zA-Z°%][a-zA-Z°%/^*.0-9]{0,11}|-|)\s*[)\]]?')
DECIMAL_COMMA = re.compile(r'\s*[-+]?\d*,\d+([eE][-+]?\d+)?\s*')
DELIMITERS = ',;\t'
#: MAX_TIME_JUMP: of a time ahead of both neighbours, s; beyond, it is wrong.
MAX_TIME_JUMP = 3600.0
#: BATCH_SIZE: lines that are parsed together.
BATCH_SIZE = 8192


@dataclass(frozen=True)
class Column:
    """A column of numbers: its index, header and joint, and the size of its unit."""

    index: int
    header: str
    joint: str
    scale: float


def split(header: str) -> tuple[str, str | None]:
    """Return name and unit of a header."""
    match = UNIT_HEADER.match(header)
    return (match[1], match[2]) if match else (header, None)


def load_columns(headers: list[str]) -> list[Column]:
    """Return the columns of foot loads or contacts, if there are two or more."""
    loads = []
    for k, header in enumerate(headers):
        name, unit = split(header)
        words = {word.lower() for word in re.findall(r'[A-Z]?[a-z]+|[A-Z]+', name)}
        if (len(words) > 1 and words & LOAD_WORDS and not words & AXIS_WORDS
                and (unit is None or unit.lower() not in ANGLE_UNITS)):
            loads.append(Column(k, header, name, 1.0))
    return loads if len(loads) > 1 else []


def read_csv(path: str | Path, unit: str | None = None, time: str | None = None,
             joints: Sequence[str] = (), progress: bool = True) -> Recording:
    """Read joint angles from a CSV file with a header line and commas, semicolons or tabs.

    A unit in a header, as in `knee [deg]` or `time [ms]`, holds for its column; other columns are
    in `unit` and `time`, or in rad and s. Columns in another unit are not joints. If some columns
    are called positions (`JointPosFR_hip`), only those are joints, named `FR_hip`. Otherwise every
    column except the time is a joint.

    The file may be compressed by gzip or have OpenSim's preamble (.mot, .sto), a second header row
    of units, decimal commas where commas do not separate columns, and delimiters at the ends of
    its lines. A single time far ahead of both neighbours is dropped. A column such as `Gait cycle
    [%]` may replace the time; the duration of the stride must then be given (see `repeat_stride`).

    Args:
        path: the file.
        unit: 'rad' or 'deg', for columns whose header has no unit.
        time: 's', 'ms', 'us' or 'ns', for a time column whose header has no unit.
        joints: joints or columns in the order to return, or patterns such as 'JointPos*'; all
            joints if empty.
        progress: show a progress bar.

    Raises:
        RecordingError: see `merged`; the file is no such table, a time goes back, or a value is no
            number; the message names line and column.

    """
    path = Path(path)
    for value, units in ((unit, ANGLE_UNITS), (time, TIME_UNITS)):
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

            recording = merge_chunks(chunks(), printable(str(path)),
                               [column.joint for column in table.columns])
    return replace(recording, notes=(*dict.fromkeys(table.notes), *recording.notes),
                   cycle=np.nan if table.in_percent else 0.0,
                   loads=table.foot_loads(recording.start, recording.times[-1]))


class _Table:
    """A CSV file, its header read."""

    def __init__(self, path: Path, file: io.TextIOBase, unit: str | None, time: str | None,
                 joints: Sequence[str]) -> None:
        self.path, self.read, self.last = path, 0, -np.inf
        self.notes: list[str] = []
        #: Cells that are the same in all rows.
        self.fixed: dict[int, str] = {}
        head = list(islice(file, MAX_PREAMBLE_LINES + 1))
        blank = len(list(takewhile(lambda line: not line.strip(), head)))
        if blank == len(head):
            raise RecordingError(f'{path}: the file is empty')
        line, rest, self.line = head[blank], iter(head[blank + 1:]), blank + 1
        if not any(map(line.strip(SEPARATORS).count, DELIMITERS)) and '\0' not in line and (
                after := preamble(line, rest)) is not None:
            line, self.line, declared = after[0], self.line + after[1], after[2]
            if unit and declared and unit != declared:
                raise RecordingError(f'{path}: its preamble says {declared}, not {unit}')
            unit = unit or declared
        else:
            before = _lines_before_header(head[blank:])
            self.line += before
            line, rest = head[self.line - 1], iter(head[self.line:])
            if before:
                self.notes.append(f'{pluralize(before, "line")} before the header, passed over')
        self.lines = chain(rest, file)
        self.delimiter = max(DELIMITERS, key=line.count)
        headers = [header.strip() for header in self._cells(line.lstrip('#'), self.line)]
        if echoed := self._echo_header(headers):
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
        self.loads = load_columns(headers)
        self._loads: list[np.ndarray] = []
        if self.loads:
            self.notes.append('taken for loads on the feet: '
                              + abbreviate([one.header for one in self.loads]))
        self.columns = self._joints(headers, unit, joints)
        self.needed = [''] * len(headers)
        for column in (self.time, *self.columns, *self.loads):
            self.needed[column.index] = column.header
        if self.rest >= 0:
            self.needed[self.rest] = 'nanoseconds'

    def _begin(self, headers: list[str]) -> list[str]:
        """Examine the first line below the header; return the header to use."""
        first = next(self.lines, '')
        cells = self._cells(first, self.line + 1) if first.strip() else []
        units = [UNIT_CELL.fullmatch(cell.strip()) for cell in cells]
        texts = [match[1].strip('-') for match in units if match]
        if (len(cells) >= len(headers) == len(texts[:len(headers)]) and len(texts) == len(cells)
                and any(texts) and not any(texts[len(headers):])
                and 'nan' not in map(str.lower, texts)
                and not any(split(header)[1] for header in headers)):
            headers = [f'{header} [{unit}]' if unit else header
                       for header, unit in zip(headers, texts, strict=False)]
            self.line += 1
            self.notes.append(f'line {self.line} is taken for the units of the columns')
            first = next(self.lines, '')
            cells = self._cells(first, self.line + 1) if first.strip() else []
        self.commas = (self.delimiter != ',' and '.' not in first
                       and any(map(DECIMAL_COMMA.fullmatch, first.strip().split(self.delimiter))))
        if self.commas:
            self.notes.append('commas are taken for decimal points')
        self.lines = chain([first] if first else [], self.lines)
        places = _tidy(headers, cells)
        return self._pivot(headers, *places) if places else headers

    def _echo_header(self, cells: list[str]) -> list[str]:
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

    def _pivot(self, headers: list[str], name: int, value: int) -> list[str]:
        """Convert a table with a line for each value into one with a column for each joint.

        Args:
            headers: of the columns.
            name: column of the joints' names.
            value: column of their angles.

        Returns:
            The headers of the new table, whose lines replace those of the file.

        """
        time = self._time(headers, None).index
        rows: dict[float, dict[str, str]] = {}
        for number, line in enumerate(self.lines, self.line + 1):
            self.read += len(line)
            if number > MAX_LINES:
                raise RecordingError(f'{self.path}: more than {MAX_LINES} lines: divide it into '
                                     'parts')
            if not line.strip():
                continue
            cells = [cell.strip() for cell in self._cells(line, number)]
            where = f'{self.path}, line {number}'
            if len(cells) < len(headers):
                raise RecordingError(f'{where}: {len(cells)} columns, where the header has '
                                     f'{len(headers)}')
            when, _ = (number_in(cell.replace(',', '.') if self.commas else cell)
                       for cell in (cells[time], cells[value]))
            for cell, number_there in ((cells[time], when), (cells[value], _)):
                if number_there is None:
                    raise RecordingError(f'{where}: {cell[:40]!r} is not a number')
            row = rows.setdefault(when or 0.0, {'': cells[time]})
            row.setdefault(cells[name], cells[value])
        joints = list(dict.fromkeys(joint for row in rows.values() for joint in row if joint))
        unit = split(headers[value])[1]
        self.notes.append(f'a line for each value: {headers[value]!r} by {headers[name]!r}')
        self.lines = chain(self.delimiter.join(rows[when].get(joint, '')
                                               for joint in ('', *joints)) + '\n'
                           for when in sorted(rows))
        return [headers[time], *(f'{joint} [{unit}]' if unit else joint for joint in joints)]

    def _cells(self, line: str, number: int) -> list[str]:
        return cells_of(line, self.delimiter, f'{self.path}, line {number}')

    def _time(self, headers: list[str], option: str | None) -> Column:
        """Find the time column, or the column of seconds beside one of nanoseconds."""
        self.rest, self.in_percent = -1, False
        names, units = zip(*map(split, headers), strict=True)

        def columns_like(kind: re.Pattern[str]) -> list[int]:
            return [k for k, name in enumerate(names) if kind.match(name)]

        candidates = [(k, units[k] or match[2]) for k, name in enumerate(names)
                 if (match := TIME.match(name))]
        candidates = [(k, unit) for k, unit in candidates if unit is None or unit in TIME_UNITS]
        seconds, nanoseconds = columns_like(SECONDS), columns_like(NANOSECONDS)
        if len(candidates) != 1 and len(seconds) == len(nanoseconds) == 1:
            self.rest = nanoseconds[0]
            return Column(seconds[0], headers[seconds[0]], '', 1.0)
        in_percent = [k for k in columns_like(CYCLE) if units[k] in (None, '%')]
        if not candidates and len(in_percent) == 1:
            self.in_percent = True
            return Column(in_percent[0], headers[in_percent[0]], '', 0.01)
        candidates = candidates or [(k, None) for k in columns_like(RECEIPT)[:1]]
        if len(candidates) != 1:
            raise RecordingError(
                f'{self.path}, line {self.line}: '
                + (f'{len(candidates)} time columns, '
                   + abbreviate([headers[k] for k, _ in candidates])
                   if candidates
                   else "no time column, such as 'time' or 'time [ms]'; the columns are "
                   + abbreviate(headers, 20)))
        k, unit = candidates[0]
        return Column(k, headers[k], '', self._scale(headers[k], unit, option, TIME_UNITS))

    def _scale(self, header: str, unit: str | None, option: str | None,
               units: dict[str, float]) -> float:
        """Return the size of a column's unit: from its header, the option, or the first unit."""
        if unit and option and units[unit.lower()] != units[option]:
            raise RecordingError(f'{self.path}: column {header!r} is in {unit}, not {option}')
        return units[(unit or option or next(iter(units))).lower()]

    def _joints(self, headers: list[str], option: str | None, joints: Sequence[str]
                ) -> list[Column]:
        """Find the joints' columns."""
        columns, others = [], []
        other_columns = {self.time.index, self.rest, *(column.index for column in self.loads)}
        for k, header in enumerate(headers):
            name, unit = split(header)
            if k in other_columns or not name or any(
                    kind.match(name) for kind in (RECEIPT, SECONDS, NANOSECONDS)):
                continue
            if INDEXED_NAME.match(header):
                name, unit = header.rpartition('.')[2], None
            if unit is None or unit.lower() in ANGLE_UNITS:
                columns.append(Column(k, header, name,
                                       self._scale(header, unit, option, ANGLE_UNITS)))
            else:
                others.append(header)
        positions = [column for column in columns if INDEXED_NAME.match(column.header)] or [
            replace(column, joint=match[match.lastindex or 0])
            for column in columns if (match := POSITION.match(column.joint))]
        angle_columns = {column.index: column for column in (*columns, *positions)}
        if joints:
            matches = []
            for pattern in joints:
                fitting = [column for column in angle_columns.values() if any(
                    pattern == name or fnmatchcase(name, pattern)
                    for name in (column.joint, column.header))]
                if not fitting:
                    raise RecordingError(f'{self.path}: no column {pattern!r}; there are '
                                         f'{abbreviate([other.header for other in columns], 40)}')
                matches += fitting
            columns = list(dict.fromkeys(matches))
        else:
            others += [other.header for other in columns] if positions else []
            columns = positions or columns
            ignored = [header for header in others
                       if header not in {column.header for column in columns}]
            if ignored:
                self.notes.append(f'{len(ignored)} columns left out: {abbreviate(ignored)}')
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
        loads = [column.index for column in self.loads]
        words: dict[int, Meaning] = dict.fromkeys(
            loads, lambda word: BOOLEANS.get(word.lower(), np.nan))
        if self.time.scale == 1.0:
            words[self.time.index] = seconds_of
        while lines := list(islice(self.lines, BATCH_SIZE)):
            self.read += sum(map(len, lines))
            if self.commas:
                lines = [line.replace(',', '.') for line in lines]
            numbers, notes = number_rows(lines, self.needed, self.delimiter, self.path,
                                         self.line + 1, cut=False, words=words, fixed=self.fixed)
            self.notes += notes
            whole = numbers[:, self.time.index] * self.time.scale
            rest = numbers[:, self.rest] if self.rest >= 0 else np.zeros(len(whole))
            seconds = whole + 1e-9 * rest
            self._check(seconds, lines)
            if loads:
                self._loads.append(np.column_stack([seconds, numbers[:, loads]]))
            # In two parts, as floats do not hold a date to the nanosecond.
            yield (np.rint(whole * 1e9).astype(np.int64) + rest.astype(np.int64), names,
                   numbers[:, places] * scales)
            self.line += len(lines)

    def foot_loads(self, start: float, length: float) -> FootLoads | None:
        """Return the loads from a time on, for some seconds; None if there are no columns."""
        if not self._loads:
            return None
        rows = np.concatenate(self._loads)
        rows[:, 0] -= start
        rows = rows[(rows[:, 0] >= 0.0) & (rows[:, 0] <= length) & np.isfinite(rows).all(axis=1)]
        rows = rows[np.append(True, np.diff(rows[:, 0]) > 0.0)[:len(rows)]]
        return FootLoads(tuple(column.joint for column in self.loads), rows[:, 0], rows[:, 1:])

    def _check(self, seconds: np.ndarray, lines: list[str]) -> None:
        """Raise RecordingError for times that are not numbers, or that go back."""
        before = np.append(self.last, seconds[:-1])[:len(seconds)]
        wrong = ~(np.abs(seconds) < MAX_TIME) | (seconds < before)
        # A single stamp far ahead of the next one is the one that is wrong: merged leaves it out.
        first, ahead, after = seconds[:-2], seconds[1:-1], seconds[2:]
        wrong[2:] &= ~((first <= after) & (ahead > after + MAX_TIME_JUMP))
        if wrong.any():
            row = int(np.argmax(wrong))
            number = [k for k, line in enumerate(lines, self.line + 1) if line.strip()][row]
            where = f'{self.path}, line {number}, column {self.time.header!r}: '
            value = float(seconds[row])
            if not np.isfinite(value):
                raise RecordingError(where + 'no time')
            if abs(value) >= MAX_TIME:
                raise RecordingError(where + f'{value:.6g} s is not a plausible time; if it is in '
                                     'ms, us or ns, declare the unit')
            raise RecordingError(where + f'time goes back from {before[row]:.9g} to '
                                 f'{value:.9g} s')
        if len(seconds):
            self.last = float(seconds[-1])


def _lines_before_header(head: Sequence[str]) -> int:
    """Return the number of lines before the one that has the time among its columns."""
    for k, line in enumerate(head):
        cells = [split(cell.strip())[0] for cell in line.lstrip('#').strip().split(
            max(DELIMITERS, key=line.count))]
        if len(cells) > 1 and any(kind.match(cell) for kind in (TIME, RECEIPT, SECONDS, CYCLE)
                                  for cell in cells):
            return k
    return 0


def _tidy(headers: Sequence[str], cells: Sequence[str]) -> tuple[int, int] | None:
    """Return the columns of names and of values of a table with a line for each value, or None."""
    names = [k for k, header in enumerate(headers) if NAME_COLUMN.match(header)]
    values = [k for k, header in enumerate(headers) if VALUE_COLUMN.match(split(header)[0])]
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

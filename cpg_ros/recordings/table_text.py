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

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
import gzip
import io
import itertools
import os
from pathlib import Path
import re
from typing import cast, IO
import zlib

from cpg_ros.files import regular_file
from cpg_ros.recordings.recording import RecordingError
from cpg_ros.recordings.unpacked_size import UnpackedSize

#: Largest file, bytes, packed or not, and longest line, letters.
LARGEST, LONGEST = 4_000_000_000, 1 << 17
#: Most lines of a file that is kept as text while it is read: six hours at 100 Hz.
MOST_LINES = 2_000_000
#: What a file packed by gzip begins with.
GZIP = b'\x1f\x8b'
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
        with regular_file.opened(path, RecordingError, largest=LARGEST) as file:
            packed = file.read(2) == GZIP
            file.seek(0)
            unpacked = _Unpacked(file, path) if packed else file
            with _Lines(cast(IO[bytes], unpacked), encoding='utf-8-sig', newline='') as text:
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


def preamble(first: str, text: io.TextIOBase
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
    while lines[-1].strip().lower() != END:
        lines.append(text.readline())
        if not lines[-1] or len(lines) > PREAMBLE:
            return None
    values = {name.strip().lower(): value.strip().lower()
              for name, mark, value in (line.partition('=') for line in lines) if mark}
    units = {'yes': 'deg', 'no': 'rad'}
    rows = values.get('nrows', values.get('datarows', ''))
    return (text.readline(), len(lines), units.get(values.get('indegrees', '')),
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

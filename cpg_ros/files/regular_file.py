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

"""Opening files that others name: regular files of a bounded size, and nothing that can block.

A FIFO holds up whoever opens it, ``/dev/zero`` never ends, and files below ``/proc`` state a size
of 0, whatever is in them. None of them is a robot, a mesh or a recording.
"""

from collections.abc import Iterator
from contextlib import contextmanager
import errno
import os
from pathlib import Path
import stat
from typing import BinaryIO

from cpg_ros.errors import CpgError
from cpg_ros.files.plain_text import printable

#: Largest file that is read at once, bytes.
LARGEST = 64_000_000
#: Kinds of files that are refused.
KINDS = {stat.S_IFIFO: 'a pipe', stat.S_IFCHR: 'a device', stat.S_IFBLK: 'a device',
         stat.S_IFSOCK: 'a socket'}


@contextmanager
def opened(path: str | Path, error: type[CpgError], what: str = '',
           largest: float = LARGEST) -> Iterator[BinaryIO]:
    """Open a regular file to read its bytes.

    Args:
        path: of the file.
        error: kind of error to raise.
        what: a word or two for what the file should be, before its name in the message.
        largest: size above which it is refused, bytes; infinite where it is read piece by piece.

    Raises:
        CpgError: of the given kind, one line with the file and the reason: it is not there, may
            not be read, is too large, or is a folder, a pipe, a device or a socket.

    """
    name = f'{what} {path}'.strip()

    def check(found: os.stat_result) -> None:
        if stat.S_ISDIR(found.st_mode):
            raise error(one_line(f'{name}: {os.strerror(errno.EISDIR)}'))
        if not stat.S_ISREG(found.st_mode):
            kind = KINDS.get(stat.S_IFMT(found.st_mode), 'something else')
            raise error(one_line(f'{name}: is {kind}, not a regular file'))
        if found.st_size > largest:
            raise error(one_line(f'{name}: has {found.st_size / 1e6:.4g} MB, more than the '
                                 f'{largest / 1e6:g} MB that are read; make it smaller'))

    try:
        # Looked at first: some devices act when they are opened. Without O_NONBLOCK, a pipe that
        # took the file's place since would hold the process up.
        check(os.stat(path))
        file = os.fdopen(os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_NOCTTY | os.O_CLOEXEC),
                         'rb')
    except CpgError:
        raise
    except (OSError, ValueError) as why:  # ValueError: a byte 0 in the name
        raise error(one_line(f'{name}: {getattr(why, "strerror", None) or why}')) from why
    with file:
        check(os.fstat(file.fileno()))
        yield file


def read_bytes(path: str | Path, error: type[CpgError], what: str = '',
               largest: float = LARGEST) -> bytes:
    """Read a regular file; arguments and errors as of ``opened``."""
    with opened(path, error, what, largest) as file:
        try:
            # No more than the size it states: what grows, or states none, is read to there.
            return file.read(os.fstat(file.fileno()).st_size)
        except OSError as why:
            raise error(one_line(f'{what} {path}: {why.strerror}'.strip())) from why


def one_line(text: str) -> str:
    """Return a text as one line that can be printed, whatever bytes a file's name has."""
    return printable(' '.join(text.split()))

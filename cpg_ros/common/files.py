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

"""Files named by users: regular files of a bounded size, and nothing that can block.

A FIFO blocks its reader, ``/dev/zero`` never ends, and files below ``/proc`` state a size of 0.
None of them is a robot, a mesh or a recording.
"""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
import errno
import ipaddress
import json
import os
from pathlib import Path
import stat
from typing import Any, BinaryIO
from xml.etree.ElementTree import Element, TreeBuilder
from xml.parsers import expat

from cpg_ros.common.command_line import printable
from cpg_ros.common.errors import CpgError

# Atomic writing: a file is written under another name and then renamed.

def write_atomically(path: str | Path, content: str | bytes) -> None:
    """Write a file; the old one remains until the new one is complete.

    Raises:
        OSError: it cannot be written; the error names the file, also if the disk is full.

    """
    try:
        with replacing(Path(path)) as beside:
            beside.write_bytes(content.encode() if isinstance(content, str) else content)
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(path)) from error


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Yield the name of a file to write, which replaces the target unless writing fails."""
    beside = path.with_name(f'.{path.name}.{os.getpid()}.part')
    try:
        yield beside
        beside.replace(path)
    finally:
        beside.unlink(missing_ok=True)


def stored_json(path: Path) -> Any:
    """Return the content of a JSON file; None if the file is missing or damaged."""
    try:
        return json.loads(path.read_text())
    except (FileNotFoundError, ValueError):
        return None


# Paths of the package's shipped files, installed or in a source tree.

def resource_folder(kind: str) -> Path:
    """Return a folder of files that the package ships, in the sources or in share/cpg_ros.

    Args:
        kind: ``config``, ``urdf``, ``rviz`` or ``models``.

    Raises:
        FileNotFoundError: the installation is incomplete.

    """
    package = Path(__file__).resolve().parents[1]
    if (package.parent / 'config' / 'presets').is_dir():
        return package.parent / ('config' if kind == 'config' else f'resource/{kind}')
    for above in package.parents:
        if (above / 'share' / 'cpg_ros' / 'config' / 'presets').is_dir():
            return above / 'share' / 'cpg_ros' / kind
    raise FileNotFoundError(f'share/cpg_ros/config is missing from the installation at {package}')


# XML as a tree, without entities and of a bounded depth.

#: Depth of nested elements; descriptions of robots have a dozen, assemblies in Collada more.
MAX_DEPTH = 200
#: MAX_ELEMENTS: of a document; a robot with meshes has a few thousand.
MAX_ELEMENTS = 1_000_000


def parse(data: bytes, fail: Callable[[str], CpgError]) -> Element:
    """Return the root of an XML document; names keep their prefixes, which need no declaration.

    Args:
        data: the file.
        fail: reason -> error.

    Raises:
        CpgError: made by ``fail``: it is no XML, declares an entity, is nested too deep, or has
            too many elements.

    """
    builder, parser, depth, count = TreeBuilder(), expat.ParserCreate(), 0, 0

    def start(tag: str, attributes: dict[str, str]) -> None:
        nonlocal depth, count
        depth, count = depth + 1, count + 1
        if count > MAX_ELEMENTS:
            raise fail(f'it has more than {MAX_ELEMENTS} elements')
        if depth > MAX_DEPTH:
            raise fail(f'line {parser.CurrentLineNumber}: elements are nested more than '
                       f'{MAX_DEPTH} deep')
        builder.start(tag, attributes)

    def end(tag: str) -> None:
        nonlocal depth
        depth -= 1
        builder.end(tag)

    def entity(name: str, *_: object) -> None:
        raise fail(f"it declares the entity '{name}'; entities are not read")

    parser.StartElementHandler, parser.EndElementHandler = start, end
    parser.CharacterDataHandler, parser.EntityDeclHandler = builder.data, entity
    parser.buffer_text = True
    try:
        parser.Parse(data, True)
    except expat.ExpatError as error:
        raise fail(f'line {error.lineno}: {expat.ErrorString(error.code)}') from error
    except CpgError:
        raise
    # An encoding that Python does not know, or cannot use.
    except (ValueError, LookupError) as error:
        raise fail(str(error)) from error
    return builder.close()


# Addresses that only this machine can reach.

def is_loopback(host: str) -> bool:
    """Tell whether only this machine can reach a host: a name or an address, without a port."""
    if host == 'localhost':
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


#: MAX_SIZE: of a file that is read at once, bytes.
MAX_SIZE = 64_000_000
#: FILE_KINDS: of files that are refused.
FILE_KINDS = {stat.S_IFIFO: 'a pipe', stat.S_IFCHR: 'a device', stat.S_IFBLK: 'a device',
              stat.S_IFSOCK: 'a socket'}


@contextmanager
def opened(path: str | Path, error: type[CpgError], what: str = '',
           largest: float = MAX_SIZE) -> Iterator[BinaryIO]:
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

    def check(status: os.stat_result) -> None:
        if stat.S_ISDIR(status.st_mode):
            raise error(one_line(f'{name}: {os.strerror(errno.EISDIR)}'))
        if not stat.S_ISREG(status.st_mode):
            kind = FILE_KINDS.get(stat.S_IFMT(status.st_mode), 'something else')
            raise error(one_line(f'{name}: is {kind}, not a regular file'))
        if status.st_size > largest:
            raise error(one_line(f'{name}: has {status.st_size / 1e6:.4g} MB, more than the '
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
               largest: float = MAX_SIZE) -> bytes:
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

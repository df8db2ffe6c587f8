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

"""Recordings in folders: bags, split ones as one, and other files of known formats."""

from collections.abc import Iterator, Sequence
import hashlib
import os
from pathlib import Path

from cpg_ros.errors import InputError
from cpg_ros.recordings.formats import FORMATS

#: A folder that has this is one that results are written to: what is in it is no recording.
RESULTS = 'cpg_ros_results.json'
#: Bytes that are read at once.
BLOCK = 1 << 20


def found(folders: Sequence[Path]) -> Iterator[Path]:
    """Yield the recordings in folders, each of which may be one, sorted, each once.

    A folder that a format takes for one recording is one; other files of known endings are
    recordings by themselves.

    Raises:
        InputError: a folder is not there.

    """
    seen: set[Path] = set()
    for folder in folders:
        if not folder.exists():
            raise InputError(f'{folder}: there is no such folder')
        for one in _below(folder):
            if (place := one.resolve()) not in seen:
                seen.add(place)
                yield one


def _below(place: Path) -> Iterator[Path]:
    if place.is_file():
        if place.name.endswith(tuple(
                ending for one in FORMATS.values() for ending in one.endings)):
            yield place
        return
    if (place / RESULTS).exists():
        return
    try:
        inside = sorted(place.iterdir())
        whole = bool(files_of(place))
    except PermissionError:
        inside, whole = [], True
    if whole:
        yield place
        return
    for one in inside:
        if not one.name.startswith('.') and not (one.is_symlink() and one.is_dir()):
            yield from _below(one)


def files_of(recording: Path) -> list[Path]:
    """The files that a recording is made of, sorted; none of a folder that is no recording."""
    if not recording.is_dir():
        return [recording]
    return next((files for one in FORMATS.values()
                 if one.files_in is not None and (files := one.files_in(recording))), [])


def digest(recording: Path) -> str:
    """SHA-256 of the names and the contents of a recording's files, as hexadecimal digits.

    Raises:
        OSError: one cannot be read.

    """
    total = hashlib.sha256()
    for one in files_of(recording):
        size = one.stat().st_size
        total.update(os.fsencode(f'{one.name if recording.is_dir() else one.suffix}\n{size}\n'))
        with one.open('rb') as file:
            while block := file.read(BLOCK):
                total.update(block)
    return total.hexdigest()


def outline(recording: Path) -> tuple[tuple[str, int, int], ...]:
    """Names, sizes and times of a recording's files: while it is written they change."""
    found = []
    for one in files_of(recording):
        try:
            status = one.stat()
        except FileNotFoundError:
            continue
        found.append((one.name, status.st_size, status.st_mtime_ns))
    return tuple(found)

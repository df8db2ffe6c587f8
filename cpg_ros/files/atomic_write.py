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

"""Files are written whole or not at all: under another name, then renamed."""

from collections.abc import Iterator
from contextlib import contextmanager
import json
import os
from pathlib import Path
from typing import Any


def write_atomically(path: str | Path, content: str | bytes) -> None:
    """Write a file, which until then stays what it was.

    Raises:
        OSError: it cannot be written; the error has the file's name, also where a disk is full.

    """
    try:
        with replacing(Path(path)) as beside:
            beside.write_bytes(content.encode() if isinstance(content, str) else content)
    except OSError as error:
        raise OSError(error.errno, error.strerror, str(path)) from error


@contextmanager
def replacing(path: Path) -> Iterator[Path]:
    """Yield the name of a file to write, which then replaces another one, unless writing fails."""
    beside = path.with_name(f'.{path.name}.{os.getpid()}.part')
    try:
        yield beside
        beside.replace(path)
    finally:
        beside.unlink(missing_ok=True)


def stored_json(path: Path) -> Any:
    """Return what a file of JSON holds; None if it is missing, or damaged by a disk failure."""
    try:
        return json.loads(path.read_text())
    except (FileNotFoundError, ValueError):
        return None

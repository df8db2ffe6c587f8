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

"""Code that is generated from a network's equations, kept on disk between processes."""

from collections.abc import Callable, Iterator
import contextlib
from functools import cache
import hashlib
import importlib.util
import logging
import os
from pathlib import Path
import stat
import sys
import tempfile
from types import ModuleType

from cpg_ros.files.atomic_write import write_atomically

_LOGGER = logging.getLogger(__name__)


@cache
def folder() -> Path | None:
    """Return where generated code and numba's machine code are kept, created if need be.

    ``NUMBA_CACHE_DIR`` if it is set, else beside the package, else among the user's caches, else
    one temporary folder a user, to which ``NUMBA_CACHE_DIR`` is set. None if nothing can be
    written; either is said.
    """
    own = Path(__file__).resolve().parent / '__pycache__'
    wanted = [own, Path(os.environ.get('XDG_CACHE_HOME') or '~/.cache').expanduser() / 'cpg_ros']
    if os.environ.get('NUMBA_CACHE_DIR'):
        wanted.insert(0, Path(os.environ['NUMBA_CACHE_DIR']))
    for place in wanted:
        with contextlib.suppress(OSError):
            place.mkdir(parents=True, exist_ok=True)
            if os.access(place, os.W_OK):
                return place
    tried = f'compiled code cannot be kept in {" or ".join(map(str, wanted))}'
    with contextlib.suppress(OSError):
        place = _temporary()
        os.environ['NUMBA_CACHE_DIR'] = str(place)
        _LOGGER.warning('%s: kept in %s', tried, place)
        return place
    _LOGGER.warning('%s, nor in a temporary folder: it is compiled at every start', tried)
    return None


@contextlib.contextmanager
def keeping() -> Iterator[None]:
    """Write into the folder; a disk that is full ends nothing, and is said once."""
    try:
        yield
    except OSError as error:
        _not_kept(error.strerror or str(error))


@cache
def _not_kept(why: str) -> None:
    _LOGGER.warning('compiled code cannot be kept in %s: %s; it is compiled at every start until '
                    'there is room', folder(), why)


def _temporary() -> Path:
    """Return a temporary folder that is the user's alone: what is in it will be run.

    Raises:
        OSError: there is none.

    """
    user = os.getuid() if hasattr(os, 'getuid') else 0
    place = Path(tempfile.gettempdir()) / f'cpg_ros-{user}'
    with contextlib.suppress(FileExistsError):
        place.mkdir(mode=0o700)
    found = place.lstat()
    if found.st_uid != user or found.st_mode != stat.S_IFDIR | 0o700:
        return Path(tempfile.mkdtemp(prefix='cpg_ros-'))
    return place


@cache
def sources_digest(key: str = '') -> int:
    """Return a number that changes whenever a file with compiled code does, or the key.

    numba's disk cache watches only the file a cached kernel stands in, not the files of the
    functions it calls. A kernel that closes over this number is compiled again when any of
    them changes, because numba keys its cache on closed-over values.
    """
    digest = hashlib.sha256(key.encode())
    package = Path(__file__).resolve().parent.parent
    for room in ('networks', 'integration', 'dynamics', 'motion', 'feedback'):
        for source in sorted((package / room).rglob('*.py')):
            # What is generated may stand beside the sources, and follows from them.
            if source.parent.name != '__pycache__':
                digest.update(source.read_bytes())
    return int.from_bytes(digest.digest()[:7], 'big')


def load(name: str, write: Callable[[], str]) -> ModuleType:
    """Return a generated module, written first where it is not on disk yet.

    Args:
        name: of the module, which says all that its text depends on but the sources.
        write: makes the text.

    """
    place, name = folder(), f'{name}_{sources_digest():014x}'
    known = f'cpg_ros_generated_{name}'
    if known in sys.modules:
        return sys.modules[known]
    path = None if place is None else place / f'{name}.py'
    if path is None or not path.exists():
        text = write()
        with keeping():
            if path is not None:
                write_atomically(path, text)
        if path is None or not path.exists():
            module = sys.modules[known] = ModuleType(known)
            exec(compile(text, known, 'exec'), vars(module))
            return module
    spec = importlib.util.spec_from_file_location(known, path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    # Under its name, or numba's disk cache does not find the module of what it has compiled.
    sys.modules[known] = module
    spec.loader.exec_module(module)
    return module

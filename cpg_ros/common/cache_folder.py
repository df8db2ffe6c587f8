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


"""A cache whose folders are named after the inputs of their contents.

Contents for other inputs have another folder, so nothing in a folder is ever out of date. Unused
folders are removed when a new one is made.

The contents are executed. Therefore only the user and root may have written them: a folder that
others own, can write to or could replace is not used.
"""

from collections.abc import Iterator
import contextlib
import fcntl
from functools import cache
import grp
import logging
import os
from pathlib import Path
import pwd
import shutil
import stat
import tempfile
from typing import IO

_LOGGER = logging.getLogger(__name__)
#: MAX_FOLDERS: of about 1 MB, the last used ones; those of running processes are kept always. The
#: package's tests use 31, and each edit of a source makes new ones.
MAX_FOLDERS = 128
#: File in each folder that the processes using it lock; its time is that of the last start.
_LOCK_FILE = 'in_use'
#: Locks of this process, which the system releases when it ends, however it does.
_LOCKS: list[IO[bytes]] = []


@cache
def cache_folder(name: str) -> Path | None:
    """Return a folder of the cache, which is kept as long as this process runs.

    Args:
        name: identifies the inputs of the contents.

    Returns:
        The folder, created if necessary; None, with a warning, if it cannot be written, or if
            others than the user and root may have written into it.

    """
    root = _place()
    if root is None:
        return None
    folder = root / name
    try:
        new = not folder.exists()
        folder.mkdir(mode=0o700, exist_ok=True)
        if reason := _untrusted_contents(folder):
            _warn_untrusted(f'{reason}; compiled at every start until {folder} is removed')
            return None
        _use(folder)
        if new:
            _remove_unused(root)
    except OSError as error:
        _warn(error.strerror or str(error))
        return None
    return folder


@contextlib.contextmanager
def writing() -> Iterator[None]:
    """Write into a folder of the cache; a full disk is logged once and is no error."""
    try:
        yield
    except OSError as error:
        _warn(error.strerror or str(error))


@cache
def _warn(reason: str) -> None:
    _LOGGER.warning('compiled code cannot be kept in %s: %s; it is compiled at every start until '
                    'there is room', _place(), reason)


@cache
def _warn_untrusted(reason: str) -> None:
    _LOGGER.warning('compiled code is not loaded: %s', reason)


def _writable_by_others(status: os.stat_result) -> bool:
    """Return whether more than the owner, or a group of the user alone, may write."""
    if status.st_mode & stat.S_IWOTH:
        return True
    if not status.st_mode & stat.S_IWGRP:
        return False
    try:
        user, group = pwd.getpwuid(os.getuid()), grp.getgrgid(status.st_gid)
    except KeyError:
        return True
    # With the usual umask of 002 each user has a private group.
    return group.gr_name != user.pw_name or not set(group.gr_mem) <= {user.pw_name}


def _untrusted(path: Path, status: os.stat_result, sticky: bool = False) -> str:
    """Return why others than the user and root may have written a file or folder, or ''.

    Args:
        path: for the reason.
        status: its status.
        sticky: trust a folder in which others can only add their own entries.

    """
    if status.st_uid not in (os.getuid(), 0):
        return f'{path} belongs to the user {status.st_uid}'
    if _writable_by_others(status) and not (sticky and status.st_mode & stat.S_ISVTX):
        return f'{path} can be written by other users'
    return ''


def _untrusted_place(folder: Path) -> str:
    """Return why others may have written into a folder, or could replace it, or ''."""
    if reason := _untrusted(folder, folder.stat()):
        return reason
    reasons = (_untrusted(parent, parent.stat(), sticky=True) for parent in folder.parents)
    return next(filter(None, reasons), '')


def _untrusted_contents(folder: Path) -> str:
    """Return why others may have written a folder in a trusted place or its contents, or ''."""
    status = folder.lstat()
    if not stat.S_ISDIR(status.st_mode):
        return f'{folder} is no folder'
    if reason := _untrusted(folder, status):
        return reason
    closed = not status.st_mode & (stat.S_IXGRP | stat.S_IXOTH)
    for root, folders, files in os.walk(folder):
        for name in (*folders, *files):
            path = Path(root, name)
            with contextlib.suppress(FileNotFoundError):    # Being written by another process.
                inner = path.lstat()
                if stat.S_ISLNK(inner.st_mode):
                    return f'{path} is a link'
                reason = _untrusted(path, inner)
                # Nobody else reaches the contents of a closed folder, whatever their modes.
                if reason and not (closed and inner.st_uid == os.getuid()):
                    return reason
    return ''


@cache
def _place() -> Path | None:
    """Return the parent of the folders, created if necessary.

    It is ``NUMBA_CACHE_DIR`` if set, otherwise beside the package, among the user's caches, or a
    temporary folder of the user, to which ``NUMBA_CACHE_DIR`` is then set for child processes. A
    folder into which others than the user and root may have written is skipped, with a warning.
    """
    caches = Path(os.environ.get('XDG_CACHE_HOME') or '~/.cache').expanduser()
    candidates = [Path(__file__).resolve().parents[1] / '__pycache__' / 'compiled',
                  caches / 'cpg_ros' / 'compiled']
    if os.environ.get('NUMBA_CACHE_DIR'):
        candidates.insert(0, Path(os.environ['NUMBA_CACHE_DIR']) / 'cpg_ros')
    for folder in candidates:
        with contextlib.suppress(OSError):
            folder.mkdir(mode=0o700, parents=True, exist_ok=True)
            folder = folder.resolve()
            if os.access(folder, os.W_OK):
                if not (reason := _untrusted_place(folder)):
                    return folder
                _warn_untrusted(reason)
    tried = f'compiled code cannot be kept in {" or ".join(map(str, candidates))}'
    with contextlib.suppress(OSError):
        temporary = _temporary()
        os.environ['NUMBA_CACHE_DIR'] = str(temporary)
        _LOGGER.warning('%s: kept in %s', tried, temporary)
        (temporary / 'cpg_ros').mkdir(mode=0o700, exist_ok=True)
        return temporary / 'cpg_ros'
    _LOGGER.warning('%s, nor in a temporary folder: it is compiled at every start', tried)
    return None


def _temporary() -> Path:
    """Return a temporary folder of the user alone, as its contents will be executed.

    Raises:
        OSError: there is none.

    """
    user = os.getuid()
    folder = Path(tempfile.gettempdir()) / f'cpg_ros-{user}'
    with contextlib.suppress(FileExistsError):
        folder.mkdir(mode=0o700)
    status = folder.lstat()
    if status.st_uid != user or status.st_mode != stat.S_IFDIR | 0o700:
        folder = Path(tempfile.mkdtemp(prefix='cpg_ros-'))
    if reason := _untrusted_place(folder.resolve()):
        raise OSError(reason)
    return folder


def _use(folder: Path) -> None:
    """Create a folder if necessary, and lock it against removal while this process runs."""
    while True:
        folder.mkdir(mode=0o700, exist_ok=True)
        try:
            lock = (folder / _LOCK_FILE).open('ab')
        except FileNotFoundError:
            continue    # Removed in between.
        # On file systems without locks nothing is removed.
        with contextlib.suppress(OSError):
            fcntl.flock(lock, fcntl.LOCK_SH)
        with contextlib.suppress(FileNotFoundError):
            if os.path.samestat(os.fstat(lock.fileno()), (folder / _LOCK_FILE).stat()):
                os.utime(lock.fileno())
                _LOCKS.append(lock)
                return
        lock.close()


def _remove_unused(folder: Path) -> None:
    """Remove all folders except the last used ones and those that a process has locked."""
    locks = sorted(folder.glob(f'*/{_LOCK_FILE}'), key=_last_used)
    for path in locks[:-MAX_FOLDERS]:
        # Folders stay that are in use, or whose users cannot be determined.
        with contextlib.suppress(OSError), path.open('rb') as lock:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
            # At once, or a process that starts now would find half of it.
            trash = path.parent.rename(folder / f'.{path.parent.name}.{os.getpid()}')
            shutil.rmtree(trash)


def _last_used(lock: Path) -> float:
    try:
        return lock.stat().st_mtime
    except FileNotFoundError:
        return 0.0

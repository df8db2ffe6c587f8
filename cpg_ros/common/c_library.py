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

"""C libraries that the system's compiler builds on first use, kept in the cache."""

from collections.abc import Callable, Mapping, Sequence
import ctypes
from importlib.util import find_spec
import os
from pathlib import Path
import shlex
import shutil
import subprocess
import sys
import tempfile

from cpg_ros.common.cache_folder import writing
from cpg_ros.common.errors import CpgError

OPTIONS = ('-std=c99', '-O3', '-shared', '-fPIC')
COMPILERS = ('cc', 'gcc', 'clang')


class NoCompiler(CpgError):
    """There is no working C compiler."""


def compiler() -> list[str]:
    """Return the command of the C compiler: ``CC``, a usual name, or the wheel ziglang.

    Raises:
        NoCompiler: there is none.

    """
    if given := os.environ.get('CC'):
        command = shlex.split(given)
        if shutil.which(command[0]) is not None:
            return command
        raise NoCompiler(f"the C compiler that CC names, '{given}', is not installed")
    for name in COMPILERS:
        if shutil.which(name) is not None:
            return [name]
    if find_spec('ziglang') is not None:
        return [sys.executable, '-m', 'ziglang', 'cc']
    raise NoCompiler(f'no C compiler ({", ".join(COMPILERS)}) is installed: apt install gcc, or '
                     'pip install ziglang, or name one in CC')


def _compile(sources: Mapping[str, str], library: Path, what: str, options: Sequence[str]
             ) -> None:
    """Write a library; arguments and errors as of load."""
    command = compiler()
    with tempfile.TemporaryDirectory(dir=library.parent) as folder:
        for file, text in sources.items():
            (Path(folder) / file).write_text(text)
        files = [file for file in sources if file.endswith('.c')]
        result = subprocess.run([*command, *OPTIONS, *options, *files, '-lm', '-o', 'library.so'],
                                cwd=folder, capture_output=True, text=True)
        if result.returncode:
            line = next((line for line in result.stderr.splitlines() if 'error' in line),
                        f'it ended with {result.returncode}')
            raise NoCompiler(f"the C compiler '{' '.join(command)}' cannot make {what}: {line}")
        os.replace(Path(folder) / 'library.so', library)


def load(folder: Path | None, name: str, sources: Callable[[], Mapping[str, str]], what: str,
         options: Sequence[str] = ()) -> ctypes.CDLL:
    """Load a library; compile it first if the cache does not have it.

    Args:
        folder: of the cache, see cache_folder; None if nothing can be kept.
        name: of the library; changes whenever the sources do.
        sources: returns its files, name -> text.
        what: description for the error.
        options: further ones of the compiler.

    Raises:
        NoCompiler: there is no compiler, it fails, or the library cannot be loaded.

    """
    try:
        return _load(folder, name, sources, what, options)
    except OSError as error:
        raise NoCompiler(f'{what} cannot be loaded: {error}') from error


def _load(folder: Path | None, name: str, sources: Callable[[], Mapping[str, str]], what: str,
          options: Sequence[str]) -> ctypes.CDLL:
    if folder is not None:
        library = folder / f'{name}.so'
        if not library.exists():
            with writing():
                _compile(sources(), library, what, options)
        if library.exists():
            return ctypes.CDLL(str(library))
    with tempfile.TemporaryDirectory() as temporary:
        library = Path(temporary) / f'{name}.so'
        _compile(sources(), library, what, options)
        return ctypes.CDLL(str(library))

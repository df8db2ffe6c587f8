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

"""Libraries that read files, in a process that a damaged file may crash, fill or block.

It runs as a module with a function that reads a file into arrays, the file, and the file to write.
"""

from collections.abc import Callable
from importlib import import_module
import os
from pathlib import Path
import resource
import signal
import subprocess
import sys
from tempfile import TemporaryDirectory
from typing import Any

from cpg_ros.common.errors import CpgError
import numpy as np

#: Limits of the process. MAX_MEMORY: address space, bytes; MAX_CPU_TIME: processor time, s;
#: MEMORY_PER_BYTE, TIME_PER_BYTE: additional ones for each byte of the file.
MAX_MEMORY, MEMORY_PER_BYTE = 2_000_000_000, 60
MAX_CPU_TIME, TIME_PER_BYTE = 5.0, 1e-6
EXIT_REJECTED = 3


class UnreadableFile(CpgError):
    """A library cannot read a file; the message gives the reason."""


def read_in_process(reader: Callable[[str], dict[str, Any]], path: Path) -> dict[str, np.ndarray]:
    """Read a file in a process with limits on memory and time.

    Args:
        reader: a module's function, from the file's path to arrays by name.
        path: of the file.

    Raises:
        UnreadableFile: the reader refuses the file, crashes, or exceeds a limit.
        OSError: there is no such file.

    """
    size = path.stat().st_size
    package = str(Path(__file__).resolve().parents[3])
    search_path = os.environ.get('PYTHONPATH', '')
    seconds = MAX_CPU_TIME + TIME_PER_BYTE * size
    with TemporaryDirectory(prefix='cpg_ros-') as folder:
        out = Path(folder, 'arrays.npz')
        command = [sys.executable, '-P', '-m', __name__, reader.__module__, reader.__name__,
                   os.path.abspath(path), str(out),
                   str(round(MAX_MEMORY + MEMORY_PER_BYTE * size)), str(round(seconds))]
        environment = os.environ | {'OPENBLAS_NUM_THREADS': '1', 'PYTHONPATH': os.pathsep.join(
            filter(None, (package, search_path)))}
        try:
            # A process that waits takes no time of the processor, but time.
            result = subprocess.run(
                command, env=environment, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL,
                stderr=subprocess.PIPE, timeout=6.0 * seconds)
        except subprocess.TimeoutExpired as error:
            raise UnreadableFile(f'not read within {6.0 * seconds:.0f} s') from error
        if result.returncode:
            raise UnreadableFile(_reason(result.returncode, result.stderr, seconds))
        with np.load(out, allow_pickle=False) as arrays:
            return dict(arrays)


def _reason(code: int, errors: bytes, seconds: float) -> str:
    """Return why the process ended."""
    if code in (-signal.SIGXCPU, -signal.SIGKILL):
        return f'not read within {seconds:.0f} s of processor time'
    if code < 0:
        return f'the library ended with {signal.Signals(-code).name}'
    lines = errors.decode(errors='replace').strip().splitlines()
    return lines[-1] if lines else f'the library ended with {code}'


def main(module: str, name: str, path: str, out: str, memory: str, seconds: str) -> int:
    """Read a file and write its arrays; return the exit code."""
    resource.setrlimit(resource.RLIMIT_AS, (int(memory), int(memory)))
    resource.setrlimit(resource.RLIMIT_CPU, (int(seconds), int(seconds) + 1))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    try:
        np.savez(out, **getattr(import_module(module), name)(path))
    except MemoryError:
        print('it takes more memory than a file of its size', file=sys.stderr)
        return EXIT_REJECTED
    # No library lists what damaged files make it raise.
    except Exception as error:
        print(' '.join(str(error).split()) or type(error).__name__, file=sys.stderr)
        return EXIT_REJECTED
    return 0


if __name__ == '__main__':
    sys.exit(main(*sys.argv[1:]))

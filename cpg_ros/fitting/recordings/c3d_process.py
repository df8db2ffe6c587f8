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

"""The library ezc3d in a process of its own, which a damaged file may crash, fill or hold up.

Run as a module with a C3D file and the file to write: its points, names and units as arrays.
"""

import json
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

#: Limits of the process. MEMORY: address space, bytes; TIME: processor time, s; MEMORY_PER_BYTE,
#: TIME_PER_BYTE: additional ones for each byte of the file.
MEMORY, MEMORY_PER_BYTE = 2_000_000_000, 60
TIME, TIME_PER_BYTE = 5.0, 1e-6
#: REFUSED: exit code for a file that the library rejects.
REFUSED = 3


class UnreadableC3D(CpgError):
    """The library cannot read the file; the message gives the reason."""


def read_apart(path: Path, size: int) -> tuple[dict[str, Any], np.ndarray, np.ndarray]:
    """Read a C3D file in a process with limits on memory and time.

    Args:
        path: of the file.
        size: of the file, bytes.

    Returns:
        The parameters of POINT, points, shape (4, points, frames), and residuals, shape
        (points, frames).

    Raises:
        UnreadableC3D: the library refuses the file, crashes, or exceeds a limit.

    """
    package = str(Path(__file__).resolve().parents[3])
    others = os.environ.get('PYTHONPATH', '')
    seconds = TIME + TIME_PER_BYTE * size
    with TemporaryDirectory(prefix='cpg_ros-') as folder:
        out = Path(folder, 'points.npz')
        command = [sys.executable, '-P', '-m', __name__, os.path.abspath(path), str(out),
                   str(round(MEMORY + MEMORY_PER_BYTE * size)), str(round(seconds))]
        environment = os.environ | {'OPENBLAS_NUM_THREADS': '1', 'PYTHONPATH': os.pathsep.join(
            filter(None, (package, others)))}
        try:
            # A process that waits takes no time of the processor, but time.
            ended = subprocess.run(
                command, env=environment, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL,
                stderr=subprocess.PIPE, timeout=6.0 * seconds)
        except subprocess.TimeoutExpired as error:
            raise UnreadableC3D(f'not read within {6.0 * seconds:.0f} s') from error
        if ended.returncode:
            raise UnreadableC3D(_reason(ended.returncode, ended.stderr, seconds))
        with np.load(out, allow_pickle=False) as arrays:
            return json.loads(str(arrays['point'])), arrays['points'], arrays['residuals']


def _reason(code: int, errors: bytes, seconds: float) -> str:
    """Return why the process ended."""
    if code in (-signal.SIGXCPU, -signal.SIGKILL):
        return f'not read within {seconds:.0f} s of processor time'
    if code < 0:
        return f'the library ezc3d ended with {signal.Signals(-code).name}'
    lines = errors.decode(errors='replace').strip().splitlines()
    return lines[-1] if lines else f'the library ezc3d ended with {code}'


def _point(parameters: Any, first: int) -> dict[str, Any]:
    """Return the values of the parameters of points and events that are used."""
    keys = ('RATE', 'LABELS', 'ANGLES', 'ANGLE_UNITS', 'UNITS')
    found: dict[str, Any] = {
        key: [value if isinstance(value, str) else float(value) for value in entry['value']]
        for key, entry in parameters['POINT'].items() if key.startswith(keys)}
    if 'EVENT' in parameters:
        known = {key: parameters['EVENT'][key]['value'] for key in ('LABELS', 'CONTEXTS', 'TIMES')
                 if key in parameters['EVENT']}
        minutes, seconds = np.asarray(known.pop('TIMES', np.zeros((2, 0)))).reshape(2, -1)
        found['EVENT'] = {**known, 'TIMES': (60.0 * minutes + seconds
                                             - first / found['RATE'][0]).tolist()}
    return found


def main(path: str, out: str, memory: str, seconds: str) -> int:
    """Read a file and write its arrays; return the exit code."""
    resource.setrlimit(resource.RLIMIT_AS, (int(memory), int(memory)))
    resource.setrlimit(resource.RLIMIT_CPU, (int(seconds), int(seconds) + 1))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
    try:
        import ezc3d
        file: Any = ezc3d.c3d(path)
        first = int(file['header']['points']['first_frame'])
        np.savez(out, point=json.dumps(_point(file['parameters'], first)),
                 points=np.asarray(file['data']['points'], float),
                 residuals=np.asarray(file['data']['meta_points']['residuals'], float)[0])
    except MemoryError:
        print('it takes more memory than a file of its size', file=sys.stderr)
        return REFUSED
    # The library does not list what damaged files make it raise.
    except Exception as error:
        print(' '.join(str(error).split()) or type(error).__name__, file=sys.stderr)
        return REFUSED
    return 0


if __name__ == '__main__':
    sys.exit(main(*sys.argv[1:]))

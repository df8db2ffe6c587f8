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

"""A long table read and its stride found: CPU time and the most memory that either takes.

Twelve joints at 500 Hz; an hour has 1.8 million rows.
"""

import argparse
from pathlib import Path
import resource
import tempfile
import time

from common import emit, log
from cpg_ros.gaits.leg_names import legs_of
from cpg_ros.gaits.stride import find_stride
from cpg_ros.networks.delayed import Delayed
from cpg_ros.recordings.csv_reader import read_csv
from hostile_recordings import LEGS
import numpy as np

RATE, FREQUENCY = 500.0, 1.7
#: Rows that are written out anew with other times: whole strides.
BLOCK = 50_000
TARGETS = {'most_mb': 500.0}


def write(path: Path, rows: int) -> None:
    """Write a trot with noise."""
    rng, turn = np.random.default_rng(0), 2.0 * np.pi * FREQUENCY * np.arange(BLOCK) / RATE
    columns = []
    for phase in (0.0, np.pi, np.pi, 0.0):
        columns += [0.05 * np.cos(turn + phase), 0.7 + 0.3 * np.cos(turn + phase),
                    -1.4 + 0.3 * np.sin(turn + phase)]
    angles = np.array(columns).T + 0.01 * rng.normal(size=(BLOCK, 12))
    texts = [','.join(['', *(f'{value:.6f}' for value in row)]) + '\n' for row in angles]
    with path.open('w') as file:
        names = [f'{leg}_{joint}' for leg in LEGS for joint in ('hip', 'thigh', 'calf')]
        file.write(','.join(['time', *names]) + '\n')
        for first in range(0, rows, BLOCK):
            file.writelines(f'{(first + k) / RATE:.3f}{text}' for k, text in enumerate(texts))


def most_mb() -> float:
    """Most memory that this process has had, MB."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--rows', type=int, default=1_800_000)
    rows = -(-parser.parse_args().rows // BLOCK) * BLOCK
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, 'long.csv')
        log(f'writing {rows} rows')
        write(path, rows)
        before, began = most_mb(), time.process_time()
        recording = read_csv(path, progress=False)
        read, reading = most_mb(), time.process_time() - began
    found = find_stride(recording, legs_of(recording.joints), Delayed)
    emit(benchmark='reading', rows=rows, kept=len(recording.times), before_mb=before,
         read_mb=read, most_mb=most_mb(), read_cpu_s=reading,
         cpu_s=time.process_time() - began, frequency=found.frequency, notes=recording.notes[:2],
         targets=TARGETS, passed=most_mb() <= TARGETS['most_mb']
         and abs(found.frequency / FREQUENCY - 1.0) < 1e-4)


if __name__ == '__main__':
    main()

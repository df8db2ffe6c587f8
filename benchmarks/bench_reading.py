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

"""Long recordings read and their stride found: CPU time and the most memory that either takes.

Twelve joints at 500 Hz: an hour as one topic and as a topic a leg, and a table of 5 million rows.
Each is read by a fresh process.
"""

import argparse
import json
from pathlib import Path
import re
import struct
import subprocess
import sys
import tempfile
import time

from common import emit, log
from cpg_ros.fitting.gaits.leg_names import legs_of
from cpg_ros.fitting.gaits.stride import find_stride
from cpg_ros.fitting.recordings.bag_reader import read_bag
from cpg_ros.fitting.recordings.bag_writer import BagWriter
from cpg_ros.fitting.recordings.cdr import JOINT_STATE
from cpg_ros.fitting.recordings.csv_reader import read_csv
from cpg_ros.fitting.recordings.rosbags_library import TYPESTORE
from cpg_ros.networks.library.delayed import Delayed
from hostile_recordings import LEGS
import numpy as np

RATE, FREQUENCY = 500.0, 1.7
JOINTS = [f'{leg}_{joint}' for leg in LEGS for joint in ('hip', 'thigh', 'calf')]
#: Rows that are written out anew with other times: whole strides.
BLOCK = 50_000
#: Header stamps begin here in a serialised JointState, s.
STAMPS, START = struct.Struct('<iI'), 1_700_000_000
TARGETS = {'most_mb': 500.0}


def made() -> np.ndarray:
    """Return angles of a trot with noise, shape (BLOCK, joints)."""
    rng, turn = np.random.default_rng(0), 2.0 * np.pi * FREQUENCY * np.arange(BLOCK) / RATE
    columns = []
    for phase in (0.0, np.pi, np.pi, 0.0):
        columns += [0.05 * np.cos(turn + phase), 0.7 + 0.3 * np.cos(turn + phase),
                    -1.4 + 0.3 * np.sin(turn + phase)]
    return np.array(columns).T + 0.01 * rng.normal(size=(BLOCK, len(JOINTS)))


def write_table(path: Path, rows: int) -> None:
    """Write a table."""
    texts = [','.join(['', *(f'{value:.6f}' for value in row)]) + '\n' for row in made()]
    with path.open('w') as file:
        file.write(','.join(['time', *JOINTS]) + '\n')
        for first in range(0, rows, BLOCK):
            file.writelines(f'{(first + k) / RATE:.3f}{text}' for k, text in enumerate(texts))


def write_bag(path: Path, rows: int, topics: int) -> None:
    """Write a bag with the joints on so many topics."""
    head, stamp, message = (TYPESTORE.types[name] for name in (
        'std_msgs/msg/Header', 'builtin_interfaces/msg/Time', JOINT_STATE))
    angles, fraction = made(), len(JOINTS) // topics
    writer, serialised = BagWriter(path), []
    for first in range(0, len(JOINTS), fraction):
        own = slice(first, first + fraction)
        connection = writer.connect(f'/part{first}/joint_states', JOINT_STATE, str)
        serialised.append((connection, [bytearray(TYPESTORE.serialize_cdr(message(
            head(stamp(0, 0), ''), JOINTS[own], row, np.zeros(0), np.zeros(0)), JOINT_STATE))
            for row in angles[:, own].copy()]))
    for row in range(rows):
        seconds, rest = divmod(row * int(1e9 / RATE), 10**9)
        when = (START + seconds) * 10**9 + rest
        for connection, messages in serialised:
            STAMPS.pack_into(messages[row % BLOCK], 4, START + seconds, rest)
            writer.write(connection, when, messages[row % BLOCK])
    writer.close()


def most_mb() -> float:
    """Most memory that this process has had, MB; not a parent's, as getrusage may say."""
    return int(re.search(r'VmHWM:\s*(\d+) kB', Path('/proc/self/status').read_text())[1]) / 1024.0


def measure(path: Path) -> None:
    """Read a recording and find its stride."""
    before, began = most_mb(), time.process_time()
    recording = (read_csv if path.suffix else read_bag)(path, progress=False)
    read, reading = most_mb(), time.process_time() - began
    found = find_stride(recording, legs_of(recording.joints), Delayed)
    print(json.dumps({
        'kept': len(recording.times), 'before_mb': before, 'read_mb': read, 'most_mb': most_mb(),
        'read_cpu_s': reading, 'cpu_s': time.process_time() - began,
        'frequency': found.frequency, 'notes': recording.notes[:2]}))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--rows', type=int, default=1_800_000, help='of each bag')
    parser.add_argument('--table-rows', type=int, default=5_000_000)
    parser.add_argument('--read', type=Path, help='read this recording, and nothing else')
    given = parser.parse_args()
    if given.read:
        measure(given.read)
        return
    results = {}
    for name, rows in (('topic', given.rows), ('topics', given.rows), ('table', given.table_rows)):
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder, 'long.csv' if name == 'table' else 'long')
            log(f'{name}: writing {rows} rows')
            if name == 'table':
                write_table(path, rows)
            else:
                write_bag(path, rows, 1 if name == 'topic' else len(LEGS))
            done = subprocess.run([sys.executable, Path(__file__).resolve(), '--read', path],
                                  stdout=subprocess.PIPE, check=True)
        results[name] = {'rows': rows, **json.loads(done.stdout)}
    emit(benchmark='reading', **results, targets=TARGETS,
         passed=all(one['most_mb'] <= TARGETS['most_mb']
                    and abs(one['frequency'] / FREQUENCY - 1.0) < 1e-4
                    for one in results.values()))


if __name__ == '__main__':
    main()

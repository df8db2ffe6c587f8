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

"""Joint states out of bags: ours against the library's own decoder, on the same files.

100,000 messages of 12 joints with positions and velocities, in both storages. Both sides open
the bag and end with stamps and positions in arrays; the numbers have to be the same. Memory is
what a fresh process takes more for reading a bag than for reading its first hundredth.
"""

from functools import partial
import json
from pathlib import Path
import re
import subprocess
import sys
import tempfile

from common import by_turns, emit, log
from cpg_ros.fitting.recordings.bag_reader import read_bag
from cpg_ros.fitting.recordings.cdr import JOINT_STATE
from cpg_ros.fitting.recordings.rosbags_library import TYPESTORE
import numpy as np
from rosbags.rosbag2 import Reader, StoragePlugin, Writer

MESSAGES, STEP = 100_000, 2_000_000
JOINTS = [f'{leg}_{joint}' for leg in ('lh', 'rh', 'lf', 'rf')
          for joint in ('hip', 'thigh', 'calf')]
START = 1_700_000_000_000_000_000
STORAGES = {'sqlite3': StoragePlugin.SQLITE3, 'mcap': StoragePlugin.MCAP}
TARGETS = {'sqlite3': 5.0, 'mcap': 4.0}
ROUNDS = 5


def serialised() -> list[tuple[int, memoryview]]:
    """Return receive times and messages of a walk."""
    rng = np.random.default_rng(0)
    time, header, message = (TYPESTORE.types[name] for name in (
        'builtin_interfaces/msg/Time', 'std_msgs/msg/Header', JOINT_STATE))
    made = []
    for stamp in range(START, START + STEP * MESSAGES, STEP):
        values = rng.normal(size=(2, len(JOINTS)))
        made.append((stamp, TYPESTORE.serialize_cdr(message(
            header(time(stamp // 10**9, stamp % 10**9), 'base'), JOINTS, *values, np.zeros(0)),
            JOINT_STATE)))
    return made


def write(path: Path, storage: str, messages: list[tuple[int, memoryview]]) -> Path:
    with Writer(path, version=9, storage_plugin=STORAGES[storage]) as writer:
        connection = writer.add_connection('/joint_states', JOINT_STATE, typestore=TYPESTORE)
        for received, message in messages:
            writer.write(connection, received, message)
    return path


def by_the_library(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """Return stamps in ns and positions."""
    stamps, positions = [], []
    with Reader(path) as reader:
        for connection, _, raw in reader.messages():
            message = TYPESTORE.deserialize_cdr(raw, connection.msgtype)
            stamps.append(message.header.stamp.sec * 10**9 + message.header.stamp.nanosec)
            positions.append(message.position)
    return np.array(stamps), np.array(positions)


def raw(path: Path) -> int:
    """Read the messages and do nothing with them: the least any decoder takes."""
    with Reader(path) as reader:
        return sum(1 for _ in reader.messages())


def memory(path: Path) -> float:
    """Return the most memory that a process takes to read this bag, MB."""
    script = Path(__file__).resolve()
    done = subprocess.run([sys.executable, script, str(path)], capture_output=True, check=True)
    return float(json.loads(done.stdout))


def main() -> None:
    messages = serialised()
    with tempfile.TemporaryDirectory() as folder:
        log('writing the bags')
        bags = {name: write(Path(folder) / name, name, messages) for name in STORAGES}
        short = {name: write(Path(folder) / f'short_{name}', name, messages[:MESSAGES // 100])
                 for name in STORAGES}
        del messages
        identical = {}
        for name, path in bags.items():
            ours, (stamps, positions) = read_bag(path, progress=False), by_the_library(path)
            identical[name] = bool(
                np.array_equal(ours.positions, positions)
                and np.array_equal(ours.times, (stamps - stamps[0]) / 1e9))
        spent = by_turns({f'{name} {who}': (partial(read, path), 1) for name, path in bags.items()
                          for who, read in (('ours', partial(read_bag, progress=False)),
                                            ('library', by_the_library), ('raw', raw))}, ROUNDS)
        sizes = {name: sum(file.stat().st_size for file in path.iterdir()) / 1e6
                 for name, path in bags.items()}
        taken = {name: memory(path) - memory(short[name]) for name, path in bags.items()}
    # Of the best and the median, whichever says less for ours.
    speedup = {name: min(spent[f'{name} library'][which] / spent[f'{name} ours'][which]
                         for which in ('best', 'median')) for name in STORAGES}
    fraction = {name: taken[name] / sizes[name] for name in STORAGES}
    emit(benchmark='decode', messages=MESSAGES, joints=len(JOINTS), ms=spent,
         speedup=speedup, identical=identical, bag_mb=sizes, memory_mb=taken,
         memory_share=fraction, targets=TARGETS,
         passed=all(identical.values()) and min(fraction.values()) > 0.0
         and max(fraction.values()) < 1.0
         and all(speedup[name] >= goal for name, goal in TARGETS.items()))


if __name__ == '__main__':
    if len(sys.argv) > 1:
        read_bag(sys.argv[1], progress=False)
        # Not getrusage: what that says of the largest size is inherited from the parent.
        status = Path('/proc/self/status').read_text()
        print(int(re.search(r'VmHWM:\s*(\d+) kB', status)[1]) / 1e3)
    else:
        main()

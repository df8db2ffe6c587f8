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

"""Folders of made-up recordings for bench_fleet, some damaged; and a job that counts itself."""

import os
from pathlib import Path
import sys
from typing import Any

import numpy as np

ROOT = Path(__file__).resolve().parent.parent
sys.path += [str(Path(__file__).parent), str(ROOT / 'test' / 'support')]

from bags import joint_state, write_bag  # noqa: E402
from cpg_ros.fitting.inversion.many_recordings import invert_recording, Task  # noqa: E402
from hostile_recordings import walked  # noqa: E402

#: File that every job adds a line to, wherever it runs.
COUNT = 'CPG_ROS_BENCH_COUNT'
#: Ways of damage, with a word of the reason that is right.
DAMAGE = {'empty': 'empty', 'cut': '', 'words': 'line 2', 'short': 'samples', 'still': ''}


def make(folder: Path, count: int, damaged: int, seconds: float = 8.0) -> dict[str, str]:
    """Make recordings, every fifth a bag; return the names of those damaged and how."""
    folder.mkdir(parents=True)
    every = count // damaged if damaged else count + 1
    spoiled = {}
    for number in range(count):
        made = walked(np.random.default_rng(number), seconds)
        way = (list(DAMAGE)[number // every % len(DAMAGE)]
               if damaged and number % every == 3 else '')
        name = f'{number:05d}'
        if way:
            spoiled[name] = way
            _spoil(folder / name, way, made)
        elif number % 5 == 0:
            stamps = (1e9 * made.t).astype(int) + 1_700_000_000_000_000_000
            write_bag(folder / name, [
                ('/joint_states', int(stamp), joint_state(int(stamp), made.names, row))
                for stamp, row in zip(stamps, made.x, strict=True)], 'mcap')
        else:
            (folder / f'{name}.csv').write_text(made.text())
    return spoiled


def _spoil(place: Path, way: str, made: Any) -> None:
    table = place.with_name(f'{place.name}.csv')
    if way == 'empty':
        table.write_text('')
    elif way == 'cut':
        place.mkdir()
        (place / 'bag_0.mcap').write_bytes(b'\x89MCAP0\r\n\x01\x07')
    elif way == 'words':
        table.write_text('time,lh_hip\nnow,here\n')
    elif way == 'short':
        table.write_text('\n'.join(made.text().splitlines()[:4]) + '\n')
    else:
        made.x[:] = made.x[0]
        table.write_text(made.text())


def counted(task: Task) -> dict[str, Any]:
    """invert_recording, and a line for it."""
    if COUNT in os.environ:
        with open(os.environ[COUNT], 'a') as file:
            file.write(f'{task.recording.name}\n')
    return invert_recording(task)

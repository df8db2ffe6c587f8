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

"""A running generator set to what a schedule says, when it says it."""

import asyncio
from pathlib import Path
import time

from cpg_ros.errors import InputError
from cpg_ros.inversion.gait_schedule import Entry, GaitSchedule, read_schedule
from cpg_ros.nodes.node_client import NodeClient
from cpg_ros.tools.command_line import note, say

#: How long a setting may take: a network may have to be compiled, s.
ANSWER = 60.0


async def play_schedule(path: Path, other: NodeClient, rate: float) -> str:
    """Set a generator's parameters at the times of a schedule; return what was done.

    Args:
        path: of the schedule.
        other: the generator.
        rate: seconds of the schedule per second.

    Raises:
        ScheduleError: the file cannot be used.
        InputError: the generator does not run the schedule's network.
        CallError: the generator does not answer, or refuses a value.

    """
    schedule = read_schedule(path)
    await _check(schedule, other, path)
    began = time.monotonic()
    for entry in schedule.entries:
        # Nothing else happens on this loop.
        await asyncio.sleep(max(began + entry.at / rate - time.monotonic(), 0.0))
        await other.set_parameters(entry.parameters, ANSWER)
        say(f'{entry.at:8.2f} s  {_words(entry)}')
    return f'{other.name} goes on with the last entry'


async def _check(schedule: GaitSchedule, other: NodeClient, path: Path) -> None:
    network, robot = await other.values(['network', 'robot'])
    start = (f'generator --ros-args -p network:={schedule.network} -p robot:={schedule.robot}')
    if network != schedule.network:
        raise InputError(f'{path}: is for the network {schedule.network}, and {other.name} runs '
                         f'{network}; start it with: {start}')
    if robot != schedule.robot:
        note('cpg', f'{other.name} moves the robot {robot}, so joints will not move as recorded; '
             f'they would with: {start}')


def _words(entry: Entry) -> str:
    return ', '.join(f'{name} {value:.4g}' if isinstance(value, float) else f'{name} {value}'
                     for name, value in entry.parameters.items())

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

"""What the columns of a table are: its time, angles of joints, and loads on feet."""

from dataclasses import dataclass
import re

from cpg_ros.recordings.foot_loads import FootLoads
import numpy as np

#: What a header may call its unit -> that in rad, or in s.
ANGLES = {'rad': 1.0, 'radian': 1.0, 'radians': 1.0,
          'deg': np.pi / 180.0, 'degree': np.pi / 180.0, 'degrees': np.pi / 180.0,
          '°': np.pi / 180.0}
TIMES = {'s': 1.0, 'sec': 1.0, 'secs': 1.0, 'second': 1.0, 'seconds': 1.0,
         'ms': 1e-3, 'msec': 1e-3, 'us': 1e-6, 'ns': 1e-9, 'nsec': 1e-9}
#: 'knee [deg]', 'Time(s)', and for times also 'time_ms'.
BRACKETED = re.compile(r'^(.*?)\s*[\[(]\s*([^\[\]()]*?)\s*[\])]$')
TIME = re.compile(r'^[_%#/\s]*(t|time|times|stamp|timestamp|time_?stamp)(?:[_ ]([a-z]+))?$', re.I)
#: Among other columns, those so called are the joints': 'JointPosFR_hip', as PlotJuggler has it
#: '/joint_states/lf_knee/position'.
POSITION = re.compile(r'^joint_?pos(?:ition)?s?[_./ ]*(.+)$|^/.*/position/([^/]+)$'
                      r'|^/.*/([^/]+)/position$', re.I)
#: Words of a load on a foot, and those of one of several axes of it.
LOAD = {'force', 'forces', 'contact', 'contacts', 'load', 'loads', 'grf', 'fz'}
AXIS = {'x', 'y', 'z', 'fx', 'fy', 'vx', 'vy', 'vz', 'px', 'py', 'pz'}
#: A contact may be written as a word.
TRUTH = {'true': 1.0, 'false': 0.0}


@dataclass(frozen=True)
class Column:
    """Where a number is, what its header says, which joint it is of, and its unit's size."""

    index: int
    header: str
    joint: str
    scale: float


def split(header: str) -> tuple[str, str | None]:
    """Return name and unit of a header."""
    match = BRACKETED.match(header)
    return (match[1], match[2]) if match else (header, None)


def number_in(cell: str) -> float | None:
    """Return the number in a cell, nan where it is empty, None where it is something else."""
    cell = cell.strip()
    if not cell:
        return float('nan')
    try:
        return float(cell)
    except ValueError:
        return None


def load_columns(headers: list[str]) -> list[Column]:
    """Return the columns of loads on feet, or of whether they touch the ground: two or more."""
    found = []
    for k, header in enumerate(headers):
        name, unit = split(header)
        words = {word.lower() for word in re.findall(r'[A-Z]?[a-z]+|[A-Z]+', name)}
        if (len(words) > 1 and words & LOAD and not words & AXIS
                and (unit is None or unit.lower() not in ANGLES)):
            found.append(Column(k, header, name, 1.0))
    return found if len(found) > 1 else []


class LoadColumns:
    """Those of a table that are loads on feet, and what they hold."""

    def __init__(self, columns: list[Column]) -> None:
        self.columns = columns
        self._seconds: list[np.ndarray] = []
        self._rows: list[np.ndarray] = []

    def add(self, seconds: np.ndarray, numbers: np.ndarray) -> None:
        """Take some lines of the table: times, s, and all its columns, shape (n, columns)."""
        if self.columns:
            self._seconds.append(seconds)
            self._rows.append(numbers[:, [column.index for column in self.columns]])

    def taken(self, start: float, length: float) -> FootLoads | None:
        """Return the loads from a time on, for some seconds; None if there are no columns."""
        if not self._rows:
            return None
        times = np.concatenate(self._seconds) - start
        rows = np.concatenate(self._rows)
        held = (times >= 0.0) & (times <= length) & np.isfinite(rows).all(axis=1)
        times, rows = times[held], rows[held]
        rising = np.append(True, np.diff(times) > 0.0)[:len(times)]
        return FootLoads(tuple(column.joint for column in self.columns), times[rising],
                         rows[rising])

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

"""Linear interpolation in tables: periodic ones over the stride, and ones over rising speeds."""

from cpg_ros.integration.jit import jit
import numpy as np


def periodic(values: np.ndarray, phase: np.ndarray) -> np.ndarray:
    """Interpolate values given at even phases of a cycle, from 0 on, at phases in cycles."""
    grid = np.arange(values.size + 1) / values.size
    return np.interp(phase % 1.0, grid, np.append(values, values[0]))


@jit
def between_phases(place, points):
    """Return the points of a cycle on either side of a place, and the share of the second.

    Args:
        place: in points, from 0 on.
        points: number of points in the cycle.

    """
    low = int(place) % points
    return low, (low + 1) % points, place - int(place)


@jit
def between_speeds(speeds, speed):
    """Return the rows of a table on either side of a speed, and the share of the second.

    Beyond the table, that of its nearest end.

    Args:
        speeds: of the rows, m/s, rising, shape (rows,).
        speed: m/s.

    """
    low = 0
    while low + 2 < speeds.shape[0] and speed > speeds[low + 1]:
        low += 1
    high = min(low + 1, speeds.shape[0] - 1)
    gap = speeds[high] - speeds[low]
    return low, high, min(max((speed - speeds[low]) / gap, 0.0), 1.0) if gap > 0.0 else 0.0

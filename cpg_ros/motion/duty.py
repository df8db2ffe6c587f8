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

"""The duty factor: how much of a stride a leg stands, whatever its network does.

A leg stands while its driving signal falls, from peak to trough, which is the network's own share
of the cycle. Another share D is made by reading the joints at another phase: the circle is mapped
onto itself by

    tan(pi (phase' - own)) = k tan(pi (phase - centre)),  k = tan(pi D0 / 2) / tan(pi D / 2),

a Moebius transformation, smooth and monotonic for every k > 0. The stance's beginning stays where
it was, an arc of the length D from there goes to that of the length D0, ``centre`` and ``own`` are
the middles of the two. What joints do over a cycle stays the same, only sooner or later. Where the
map is steepest, in the middle of the part that is shortened, it is for D0 = 1/2 at most 4 / pi
times as steep as it has to be.
"""

import math

from cpg_ros.dynamics.periodic import Orbit
from cpg_ros.errors import InputError
from cpg_ros.integration.jit import jit
import numpy as np

#: Smallest and largest duty factor that can be set.
LEAST, MOST = 0.3, 0.9


@jit
def retimed_phase(phase, k, centre, own):
    """Return the phase at which joints are read, and its first and second derivative by the phase.

    All in cycles; with k = 1 nothing changes.
    """
    angle = math.pi * (phase - centre)
    s, c = math.sin(angle), math.cos(angle)
    size = c * c + k * k * s * s
    return (own + math.atan2(k * s, c) / math.pi, k / size,
            2.0 * math.pi * k * (1.0 - k * k) * s * c / (size * size))


def at_even_phases(one: np.ndarray, points: int) -> tuple[np.ndarray, np.ndarray]:
    """Return what a map (k, centre, own) makes of even phases of a cycle, and its slope there."""
    rows = [retimed_phase(n / points, *one)[:2] for n in range(points)]
    phase, steep = np.array(rows).T
    return phase, steep


def stance(values: np.ndarray, crest: float) -> float:
    """Return the share of a cycle that a signal falls from its crest to its trough.

    Args:
        values: on even points of a cycle, shape (m,).
        crest: phase of the crest, cycles.

    """
    low = int(values.argmin())
    before, here, after = (float(values[(low + n) % values.size]) for n in (-1, 0, 1))
    bend = before - 2.0 * here + after
    trough = (low + (0.5 * (before - after) / bend if bend > 0.0 else 0.0)) / values.size
    return (trough - crest) % 1.0


class Duty:
    """The duty factors of legs, and the maps of phase that bring them about.

    Attributes:
        shares: of the stride that each leg stands, shape (legs,).

    """

    def __init__(self, orbit: Orbit, leg_cells: np.ndarray, begin: np.ndarray, own: np.ndarray,
                 shares: np.ndarray) -> None:
        """Work out the map of each leg.

        Args:
            orbit: the gait.
            leg_cells: the cell that gives each leg's phase, from 0, shape (legs,).
            begin: phase of that cell at which each leg begins to stand, cycles, shape (legs,).
            own: shares that legs stand by themselves, shape (legs,).
            shares: wanted shares, shape (legs,).

        Raises:
            InputError: a share is not from LEAST to MOST, or not one of a cycle.

        """
        for share in shares[shares != own]:
            if not LEAST <= share <= MOST:
                raise InputError(f'duty {share:g} is not from {LEAST:g} to {MOST:g}')
        self.shares = shares
        self._phases, self._leg_cells = orbit.phases, leg_cells
        k = np.tan(0.5 * math.pi * own) / np.tan(0.5 * math.pi * shares)
        self._maps = np.stack([np.where(shares == own, 1.0, k), begin + 0.5 * shares,
                               begin + 0.5 * own], axis=1)

    def of_cells(self, legs: np.ndarray, cells: np.ndarray) -> np.ndarray:
        """Return k, centre and own for cells by their own phases, shape (n, 3).

        Args:
            legs: index of the leg that each cell drives, shape (n,).
            cells: from 0, shape (n,).

        """
        found = self._maps[legs].copy()
        found[:, 1:] += (self._phases[cells] - self._phases[self._leg_cells[legs]])[:, None]
        return found

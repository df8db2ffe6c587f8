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

"""The polynomial by which a joint follows its cell: its weights, its value and its rate.

A joint is ``offset + sum_k w_k psi_k(x, y)`` with psi = x, y, x^2, x y, x^3, x^2 y, where x is the
cell's signal and y its derivative by phase in radians (docs/theory.md, section Readout).
"""

from collections.abc import Callable
import math
from typing import NamedTuple

from cpg_ros.integration.jit import part
from cpg_ros.motion.duty import at_even_phases
import numpy as np

TURN = 2.0 * math.pi


class DrivenJoints(NamedTuple):
    """The cells behind joints and legs.

    Attributes:
        cells: the cell behind each joint, from 0, shape (joints,).
        weights: readout weights of each joint, rad, shape (joints, 6).
        leg_cells: the cell that gives each leg's phase, from 0, shape (legs,).

    """

    cells: np.ndarray
    weights: np.ndarray
    leg_cells: np.ndarray


@part
def value(w, x, y):
    """Return a joint's deviation from its offset, rad; w are its weights."""
    return w[0] * x + w[1] * y + w[2] * x * x + w[3] * x * y + (w[4] * x + w[5] * y) * x * x


@part
def rate(w, x, y, dx, dy):
    """Return the derivative of a joint's angle from those of x and y, by whatever they are."""
    return ((w[0] + 2.0 * w[2] * x + w[3] * y + 3.0 * w[4] * x * x + 2.0 * w[5] * x * y) * dx
            + (w[1] + w[3] * x + w[5] * x * x) * dy)


def monomials(x: np.ndarray, y: np.ndarray, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Evaluate x, y, x^2, x y, x^3, x^2 y and their derivatives by phase in cycles.

    Args:
        x: readout signal, any shape.
        y: its derivative by phase in radians.
        z: its second derivative.

    Returns:
        Two arrays of shape (6, ...).

    """
    values = np.stack([x, y, x * x, x * y, x**3, x * x * y])
    slopes = TURN * np.stack([y, z, 2 * x * y, y * y + x * z, 3 * x * x * y,
                              2 * x * y * y + x * x * z])
    return values, slopes


def over_cycle(weights: np.ndarray, signals: Callable[[int, np.ndarray], tuple[np.ndarray, ...]],
               maps: np.ndarray | None, points: int) -> tuple[np.ndarray, np.ndarray]:
    """Tabulate joints over a cycle.

    Args:
        weights: of the readouts, rad, shape (joints, 6).
        signals: joint and phases of its cell, cycles, (m,) -> x, y and the derivative of y.
        maps: what the duty factor makes of the phase of each joint's cell, shape (joints, 3), see
            motion.duty; None for nothing.
        points: m, even over the cycle.

    Returns:
        Angles, rad, and their derivatives by phase, rad per cycle, shape (joints, m).

    """
    angles, rises = np.empty((2, len(weights), points))
    for joint, row in enumerate(weights):
        phase, steep = np.arange(points) / points, np.ones(points)
        if maps is not None and maps[joint, 0] != 1.0:
            phase, steep = at_even_phases(maps[joint], points)
        values, slopes = monomials(*signals(joint, phase))
        angles[joint], rises[joint] = row @ values, steep * (row @ slopes)
    return angles, rises

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

"""How steadily legs keep their phases: by how much each is early or late in every stride.

To first order a leg that is early by d cycles moves its joints by d times their slope. So d is
the least-squares share of the mean cycle's slope in what a stride's samples leave, all joints of
the leg together, as the cross-correlation that leg phases come from weighs them.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from cpg_ros.gaits.phase_average import blocks, PhaseAverage
import numpy as np
from scipy.special import stdtrit

#: Share of a whole stride's slope that a stride must have for its phase to be estimated.
ENOUGH = 0.5
#: Fewest strides from which a scatter is estimated.
STRIDES = 3


@dataclass(frozen=True)
class PhaseScatter:
    """How well the phase of a leg against the first one is known, and kept.

    Attributes:
        spread: standard deviation of single strides, cycles; nan if there are too few.
        error: standard error of the mean, cycles; nan as well.
        half_width: of its 95 % interval (Student), cycles; nan as well.
        strides: how many were used.

    """

    spread: float
    error: float
    half_width: float
    strides: int


def phase_scatter(phases: np.ndarray, x: np.ndarray, found: PhaseAverage,
                  legs: Mapping[str, Sequence[str]], names: Sequence[str]
                  ) -> dict[str, PhaseScatter]:
    """Find how the phases of the legs against the first one scatter from stride to stride.

    Args:
        phases: of the samples, cycles, rising, shape (n,).
        x: rad, nan where missing, shape (n, joints).
        found: the mean cycles of these samples.
        legs: leg -> its joints, the first leg first.
        names: of the joints, in the order of x.

    Returns:
        Leg -> scatter; zeros for the first leg, the reference of all.

    """
    theta = phases - found.zero
    stride = np.floor(theta - theta[0]).astype(int)
    count = int(stride[-1]) + 1
    order = np.arange(len(found.coefficients))[:, None]
    turned = replace(found, coefficients=2j * np.pi * order * found.coefficients)
    along, power = np.zeros((2, len(legs), count))
    for part in blocks(phases):
        there = np.isfinite(x[part])
        slopes = np.where(there, turned.mean(theta[part]).T, 0.0)
        left = np.where(there, x[part] - found.mean(theta[part]).T, 0.0)
        for row, joints in enumerate(legs.values()):
            columns = [names.index(name) for name in joints]
            for sums, one in ((along, left), (power, slopes)):
                sums[row] += np.bincount(
                    stride[part], np.sum(one[:, columns] * slopes[:, columns], axis=1), count)
    reliable = power > ENOUGH * np.median(power, axis=1, keepdims=True)
    early = np.full_like(along, np.nan)
    early[reliable] = along[reliable] / power[reliable]
    return {leg: _scatter(row - early[0]) for leg, row in zip(legs, early, strict=True)}


def _scatter(early: np.ndarray) -> PhaseScatter:
    reliable = early[np.isfinite(early)]
    if reliable.size < STRIDES:
        return PhaseScatter(np.nan, np.nan, np.nan, reliable.size)
    spread = float(reliable.std(ddof=1))
    error = spread / np.sqrt(reliable.size)
    return PhaseScatter(spread, error, float(stdtrit(reliable.size - 1, 0.975)) * error,
                        reliable.size)

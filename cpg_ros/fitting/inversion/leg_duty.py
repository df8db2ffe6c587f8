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

"""Duty factors in a fit: the generator's retiming of the legs, and its derivatives.

The generator reads joints at a phase that the gait's duty factor maps from the cell's
(motion.duty). The map depends on the duty factor, and on the phases of the cell's maximum and
minimum, which depend on the network's parameters.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
import math
from typing import NamedTuple

from cpg_ros.fitting.inversion.fit_data import Signals, TWO_PI
from cpg_ros.motion.robot import NUM_HARMONICS, Robot
from cpg_ros.networks.network import Network
import numpy as np

#: GAIT_DUTY: name of the gait's duty among the free numbers; networks may have a duty, too.
GAIT_DUTY = 'gait_duty'
#: GRID_SIZE: even phases among which a trough is searched for.
GRID_SIZE, NEWTON_ITERATIONS = 1024, 4


@dataclass(frozen=True)
class GaitReadout:
    """The generator's readout of a gait, without the weights of the joints.

    Attributes:
        leading: cell -> the cell that gives its leg's phase, both from 1; other cells map to
            themselves.
        duty: fraction of the stride that legs stand; None for that of the network's cells.
        stance: touchdown as a phase of the leading cell after its peak, and duty factor, of the
            cells, cycles; None if a leg stands while the cell falls.
        harmonics: number of harmonics of a Morris-Lecar cell's waveform that joints follow.
        weights: joint -> its weights of x and y in the robot file, which tell stance from swing if
            the recording does not.

    """

    leading: Mapping[int, int] = field(default_factory=dict)
    duty: float | None = None
    stance: tuple[float, float] | None = None
    harmonics: int = NUM_HARMONICS
    weights: Mapping[str, np.ndarray] = field(default_factory=dict)

    @classmethod
    def of(cls, network: type[Network], gait: str, preset: str = '', robot: Robot | None = None
           ) -> 'GaitReadout':
        """Return the readout of a robot file's gait or preset, or of a robot without a file."""
        assignment = next(iter(network.legs)) if robot is None else robot.assignment
        leading = {cell: cells[0] for cells in network.legs[assignment].values()
                   for cell in cells}
        if robot is None:
            return cls(leading)
        motion = robot.motion(preset or gait, gait)
        weights = {joint.name: row[:2] for joint, row in zip(robot.joints, robot.weights(motion),
                                                             strict=True)}
        return cls(leading, motion.duty, motion.stance, robot.harmonics, weights)

    def agreement(self, names: Sequence[str], weights: np.ndarray) -> float:
        """Return the agreement of weights with the robot file's, -1 to 1; 0 without a file.

        Args:
            names: of joints.
            weights: of x and y, shape (2, joints).

        """
        targets = np.array([self.weights.get(name, np.zeros(2)) for name in names]).T
        size = float(np.linalg.norm(targets) * np.linalg.norm(weights))
        return float(np.sum(targets * weights)) / size if size > 0.0 else 0.0


class OwnStance(NamedTuple):
    """Stance of a leg by its leading cell, and its derivatives by the network's parameters.

    Attributes:
        begin: phase of the cell, cycles.
        fraction: of the stride.
        d_begin, d_fraction: shape (parameters,).

    """

    begin: float
    fraction: float
    d_begin: np.ndarray
    d_fraction: np.ndarray


def own_stance(signals: Signals, wave: int, peaks_at_0: bool, stance: tuple[float, float] | None
               ) -> OwnStance:
    """Return the stance of a leg without a duty, as motion.joint_readout.standing does.

    Args:
        signals: the gait's signals.
        wave: of the leading cell.
        peaks_at_0: whether the cell peaks at phase 0 for all parameters.
        stance: as of GaitReadout.

    """
    terms, slopes = signals.terms[wave], signals.slopes[wave]
    values = np.fft.irfft(np.append(terms[:1] * 2.0, terms[1:]), GRID_SIZE) * (0.5 * GRID_SIZE)
    crest, d_crest = 0.0, np.zeros(slopes.shape[1])
    if not peaks_at_0:
        crest, d_crest = _extremum(terms, slopes, int(values.argmax()) / GRID_SIZE)
    if stance is not None:
        return OwnStance(crest + stance[0], stance[1], d_crest, np.zeros_like(d_crest))
    trough, d_trough = _extremum(terms, slopes, int(values.argmin()) / GRID_SIZE)
    return OwnStance(crest, (trough - crest) % 1.0, d_crest, d_trough - d_crest)


def _extremum(terms: np.ndarray, slopes: np.ndarray, phase: float) -> tuple[float, np.ndarray]:
    """Return the phase of an extremum near a phase, cycles, and its derivatives."""
    k = np.arange(terms.size)
    bend, waves = 0.0, np.ones_like(terms)
    limit = 1.0 / GRID_SIZE
    for _ in range(NEWTON_ITERATIONS):
        waves = np.exp(TWO_PI * 1j * phase * k)
        slope, bend = float((1j * k * terms @ waves).real), float((-k * k * terms @ waves).real)
        phase -= float(np.clip(slope / bend / TWO_PI, -limit, limit)) if bend else 0.0
    return phase % 1.0, -((1j * k * waves) @ slopes).real / (bend * TWO_PI if bend else np.inf)


def retimed(theta: np.ndarray, duty: float, stance: OwnStance, ahead: np.ndarray,
            members: np.ndarray, of_duty: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the phases at which the joints of a cell are read, and their derivatives.

    Args:
        theta: phases of cells, cycles, any shape.
        duty: fraction of the stride that the leg should stand.
        stance: its own stance.
        ahead: phases of the cells before those of their legs' leading cells, cycles, likewise.
        members: derivatives of the parameters by the free numbers, (parameters, numbers).
        of_duty: derivatives of the duty factor by the free numbers, shape (numbers,).

    Returns:
        Phases, their derivatives by the free numbers, (..., numbers), and by theta.

    """
    d_begin, d_fraction = stance.d_begin @ members, stance.d_fraction @ members
    k = math.tan(0.5 * math.pi * stance.fraction) / math.tan(0.5 * math.pi * duty)
    d_k = k * math.pi * (d_fraction / math.sin(math.pi * stance.fraction)
                         - of_duty / math.sin(math.pi * duty))
    angle = math.pi * (theta - (stance.begin + 0.5 * duty + ahead))
    s, c = np.sin(angle), np.cos(angle)
    size = c * c + k * k * s * s
    steep = k / size
    phases = stance.begin + 0.5 * stance.fraction + ahead + np.arctan2(k * s, c) / math.pi
    derivative = (np.multiply.outer(s * c / size / math.pi, d_k)
                  - np.multiply.outer(steep, d_begin + 0.5 * of_duty) + d_begin + 0.5 * d_fraction)
    return phases, derivative, steep

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

"""The readout of a network's joints: of the waveform or of the phase, as the network states."""

from cpg_ros.dynamics.periodic import Orbit
from cpg_ros.motion.duty import stance
from cpg_ros.motion.phase_readout import evaluate, phase_map, PhaseReadout
from cpg_ros.motion.readout import WaveReadout
import numpy as np

#: Phases at which troughs are looked for, cycles.
GRID = np.arange(1024) / 1024


def joint_readout(orbit: Orbit, cells: np.ndarray, weights: np.ndarray, leg_cells: np.ndarray,
                  harmonics: int, maps: np.ndarray | None = None) -> WaveReadout | PhaseReadout:
    """Return what reads joints and legs off the states of a gait.

    Args:
        orbit: the gait.
        cells: the cell behind each joint, from 0, shape (joints,).
        weights: in rad, shape (joints, 6).
        leg_cells: the cell that gives each leg's phase, from 0, shape (legs,).
        harmonics: of a waveform that joints follow by its phase.
        maps: what the duty factor makes of the phase of each joint's cell, shape (joints, 3).

    Raises:
        NoPhase: the phase does not follow from a waveform.

    """
    if orbit.network.readout == 'waveform':
        return WaveReadout(orbit, cells, weights, leg_cells, maps)
    return PhaseReadout(orbit, cells, weights, leg_cells, harmonics, maps)


def standing(orbit: Orbit, leg_cells: np.ndarray, harmonics: int
             ) -> tuple[np.ndarray, np.ndarray]:
    """Return when each leg begins to stand by itself, and for which share of the stride.

    A leg stands while the signal of its cell falls. Phases are those of the cell, cycles; two
    arrays of shape (legs,).
    """
    begin, share = np.empty((2, len(leg_cells)))
    for leg, cell in enumerate(leg_cells):
        if orbit.network.readout == 'waveform':
            begin[leg], share[leg] = 0.0, stance(orbit.waveform(GRID), 0.0)
            continue
        known, wave = phase_map(orbit, harmonics), orbit.waves[cell]
        begin[leg] = known.crests[wave]
        share[leg] = stance(evaluate(known.terms[wave], GRID), float(begin[leg]))
    return begin, share

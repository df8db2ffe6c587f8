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
from cpg_ros.motion.phase_readout import PhaseReadout
from cpg_ros.motion.readout import WaveReadout
import numpy as np


def joint_readout(orbit: Orbit, cells: np.ndarray, weights: np.ndarray, leg_cells: np.ndarray,
                  harmonics: int) -> WaveReadout | PhaseReadout:
    """Return what reads joints and legs off the states of a gait.

    Args:
        orbit: the gait.
        cells: the cell behind each joint, from 0, shape (joints,).
        weights: in rad, shape (joints, 6).
        leg_cells: the cell that gives each leg's phase, from 0, shape (legs,).
        harmonics: of a waveform that joints follow by its phase.

    Raises:
        NoPhase: a waveform does not tell the phase.

    """
    if orbit.network.readout == 'waveform':
        return WaveReadout(orbit, cells, weights, leg_cells)
    return PhaseReadout(orbit, cells, weights, leg_cells, harmonics)

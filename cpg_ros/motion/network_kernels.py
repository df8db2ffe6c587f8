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

"""Make every kernel of the real-time path ready, compiling those not yet on disk."""

from cpg_ros.integration.simulate import simulate
from cpg_ros.integration.stepper import Stepper
from cpg_ros.motion.joint_polynomial import DrivenJoints
from cpg_ros.motion.phase_readout import GaitCells, observe_phases, PhaseMap
from cpg_ros.motion.readout import confine, observe
from cpg_ros.motion.retimed_waveform import read_retimed, Retiming, Waveform
from cpg_ros.motion.strides import approach, lengthen, scale
from cpg_ros.networks.registry import find_network
import numpy as np


def precompile(name: str) -> None:
    """Run each kernel that a network needs once, on the types the generator uses.

    Args:
        name: as find_network takes it, and errors as of that.

    """
    preset = next(iter(find_network(name).presets().values()))
    network = preset.network
    stepper = Stepper(network, np.zeros(network.components), gain=1.0,
                      symmetry=network.symmetry(preset.gait))
    stepper.advance(2.0 * network.step)
    some, table, cells = np.zeros(1), np.zeros(4), np.zeros(1, dtype=int)
    joints, one = DrivenJoints(cells, np.zeros((1, 6)), cells), np.ones((1, 3))
    if network.readout == 'waveform':
        wave = Waveform(1.0, 1.0, np.zeros(8), table, table)
        observe(stepper.now, wave, joints, some, some, some)
        read_retimed(stepper.now, wave, joints, Retiming(np.zeros((4, 2)), np.ones((4, 4)), one),
                     some, some)
    else:
        simulate(network, np.zeros(network.components), network.step, network.step)
        known = PhaseMap(np.ones((1, 4)), np.ones((1, 4)), np.ones((1, 4, 4)),
                         np.zeros((1, 2, 2)), some)
        observe_phases(stepper.now, 1.0, GaitCells(cells, np.zeros(1), one, known), joints,
                       np.zeros((10, 1)), some, some, some)
    confine(some, some, np.zeros((3, 1)), 1.0, some, some, np.zeros(1, dtype=bool))
    approach(some, some, 0.1, some, some)
    lengthen(some, cells, some, np.zeros((4, 1)))
    scale(1.0, 1.0, some, cells, some, np.zeros((4, 1)), some, some)

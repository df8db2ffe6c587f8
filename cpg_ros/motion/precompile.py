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

from collections.abc import Callable

from cpg_ros.integration.simulate import simulate
from cpg_ros.integration.stepper import Stepper
from cpg_ros.motion.phase_readout import observe_phases
from cpg_ros.motion.readout import confine, observe
from cpg_ros.motion.retimed_waveform import read_retimed
from cpg_ros.motion.strides import approach, lengthen, scale
from cpg_ros.networks.registry import find_network
from numba.core import event
import numpy as np


class _Notice(event.Listener):
    """Calls a function when something is compiled; what is loaded from disk is not."""

    def __init__(self, compiling: Callable[[], None]) -> None:
        self._compiling = compiling

    def on_start(self, event: event.Event) -> None:
        self._compiling()

    def on_end(self, event: event.Event) -> None:
        """Whatever follows has been announced."""


def precompile(name: str, compiling: Callable[[], None] = lambda: None) -> None:
    """Run each kernel that a network needs once, on the types the generator uses.

    Args:
        name: as find_network takes it, and errors as of that.
        compiling: called for each function that is not on disk yet, before it is compiled.

    """
    with event.install_listener('numba:compile', _Notice(compiling)):
        _run_all(name)


def _run_all(name: str) -> None:
    preset = next(iter(find_network(name).presets().values()))
    network = preset.network
    stepper = Stepper(network, np.zeros(network.components), gain=1.0,
                      symmetry=network.symmetry(preset.gait))
    stepper.advance(2.0 * network.step)
    joints, table, cells = np.zeros(1), np.zeros(4), np.zeros(1, dtype=int)
    weights, one = np.zeros((1, 6)), np.ones((1, 3))
    if network.readout == 'waveform':
        observe(stepper.now, 1.0, 1.0, cells, weights, np.zeros(8), cells, table, table, joints,
                joints, joints)
        read_retimed(stepper.now, 1.0, 1.0, cells, weights, np.zeros((4, 2)), np.ones((4, 4)), one,
                     joints, joints)
    else:
        simulate(network, np.zeros(network.components), network.step, network.step)
        observe_phases(stepper.now, 1.0, cells, np.zeros(1), np.ones((1, 4)), np.ones((1, 4)),
                       np.ones((1, 4, 4)), np.zeros((1, 2, 2)), joints, cells, weights, cells,
                       one, np.zeros((10, 1)), joints, joints, joints)
    confine(joints, joints, joints, joints, joints, 1.0, joints, joints, np.zeros(1, dtype=bool))
    approach(joints, joints, 0.1, joints, joints)
    lengthen(joints, cells, joints, joints, joints, joints, joints)
    scale(1.0, 1.0, joints, cells, joints, joints, joints, joints, joints, joints)

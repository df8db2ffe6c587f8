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

"""Which gait a network settles in, measured on a simulation of all its cells, free of any lock."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction

from cpg_ros.gaits.recognition import recognise, Recognition
from cpg_ros.integration.simulate import simulate, Trajectory
from cpg_ros.networks.network import Network, Preset
from cpg_ros.networks.symmetry import Group, Symmetry, Z4_Z2
import numpy as np

#: Share of a simulation, from its end, on which the rhythm is measured.
SETTLED = 0.15
#: Samples a cycle needs to tell its waveforms; more only take time.
SAMPLES = 4000
#: Standard deviation of a disturbed start, in the units of the cells.
DISTURBANCE = 0.01


def primary_gaits(variables: int) -> dict[str, Symmetry]:
    """Gaits of Buono & Golubitsky's Table 5; + where x_3 leads x_1 by a quarter, - where it lags.

    Args:
        variables: of each cell.

    """
    shifts = {'pronk': (0, 0), 'pace': (0, 1), 'bound': (2, 0), 'trot': (2, 1),
              'jump+': (1, 0), 'jump-': (3, 0), 'walk+': (1, 1), 'walk-': (3, 1)}
    return {name: Symmetry.of(Z4_Z2, {'omega': Fraction(j, 4), 'kappa': Fraction(k, 2)},
                              variables) for name, (j, k) in shifts.items()}


def disturbed_start(preset: Preset) -> np.ndarray:
    """Return a state near a preset's orbit, every variable disturbed, shape (components,)."""
    start = np.array(preset.start)
    return start + DISTURBANCE * np.random.default_rng(0).standard_normal(start.size)


@dataclass(frozen=True)
class Rhythm:
    """A simulation and what its end was recognised as.

    Attributes:
        run: from the start on.
        found: phases, period, symmetries and gait.

    """

    run: Trajectory
    found: Recognition

    @property
    def gait(self) -> str:
        """Name of the gait, its sense included; 'none' if no named one is near."""
        return self.found.name or 'none'

    @property
    def kind(self) -> str:
        """Name of the gait whichever way its wave runs."""
        return self.gait.rstrip('+-')


def rhythm(network: Network, start: Sequence[float] | np.ndarray, t_end: float, group: Group,
           gaits: Mapping[str, Symmetry]) -> Rhythm:
    """Simulate from a start and recognise the gait that the network ends in.

    Args:
        network: parameters.
        start: a state; with a delay, also the whole history.
        t_end: model time to simulate.
        group: of the network.
        gaits: to choose from.

    Raises:
        InputError: it comes to rest, or is not periodic.

    """
    run = simulate(network, np.asarray(start, dtype=float), t_end, network.step, progress=False)
    first = int((1.0 - SETTLED) * run.t.size)
    every = max(1, (run.t.size - first) // SAMPLES)
    found = recognise(run.t[first::every], run.x[first::every, :network.cells], group, gaits)
    return Rhythm(run, found)

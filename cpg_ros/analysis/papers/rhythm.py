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

from cpg_ros.dynamics.integration.simulate import simulate, Trajectory
from cpg_ros.fitting.gaits.recognition import recognise, Recognition
from cpg_ros.networks.library.biped import Biped
from cpg_ros.networks.library.quadruped import Quadruped
from cpg_ros.networks.network import Network, Preset
from cpg_ros.networks.symmetry import Group, Symmetry, Z4_Z2
import numpy as np

# Constants of a Morris-Lecar cell, read off the compiled rates of a network in closed form.

#: Where m is 0 or 1 to rounding, and where m and n bend.
FAR, NEAR = np.array([6.0, 8.0]), np.array([-0.05, 0.0, 0.05, 0.1, 0.2])


def _rates(network: Quadruped | Biped, v: np.ndarray, w: float) -> np.ndarray:
    """V' and w' of a cell at states (v, w) with all cells alike, shape (m, 2)."""
    cells = network.cells
    states = np.concatenate([np.repeat(v[:, None], cells, 1), np.full((v.size, cells), w)], 1)
    run = simulate(network, states, network.step, network.step, progress=False)
    return run.slopes[:, 0, ::cells]


def cell_constants(network: Quadruped | Biped, current: float) -> dict[str, float]:
    """Read the constants off the rates.

    Args:
        network: in which cells that are alike do not feel one another.
        current: into each cell, which cannot be distinguished from gL vL.

    Returns:
        gCa, vCa, gK, vK, gL, vL, v1 to v4, phi; and tau_far, which is tau at v3 + 10 v4 over
        its smallest value.

    """
    v = np.concatenate([-FAR, FAR, NEAR])
    closed, opened = _rates(network, v, 0.0), _rates(network, v, 1.0)
    slope, offset = np.polyfit(v, (opened - closed)[:, 0], 1)
    g_k, v_k = -slope, offset / -slope
    low_slope, low = np.polyfit(v[:2], closed[:2, 0], 1)
    high_slope, high = np.polyfit(v[2:4], closed[2:4, 0], 1)
    g_l, g_ca = -low_slope, low_slope - high_slope
    v_l, v_ca = (low - current) / g_l, (high - low) / g_ca
    m = (closed[4:, 0] - (low + low_slope * NEAR)) / (-g_ca * (NEAR - v_ca))
    v1, v2 = _bend(m)
    speed = (closed - opened)[4:, 1]
    v3, v4 = _bend(closed[4:, 1] / speed)

    def tau_phi(at: float) -> float:
        place = np.array([at])
        return float((_rates(network, place, 0.0) - _rates(network, place, 1.0))[0, 1])

    return {'gCa': float(g_ca), 'vCa': float(v_ca), 'gK': float(g_k), 'vK': float(v_k),
            'gL': float(g_l), 'vL': float(v_l), 'v1': v1, 'v2': v2, 'v3': v3, 'v4': v4,
            'phi': tau_phi(v3), 'tau_far': tau_phi(v3 + 10.0 * v4) / tau_phi(v3)}


def _bend(fraction: np.ndarray) -> tuple[float, float]:
    """Middle and width of ``(1 + tanh((v - middle)/width))/2`` from its values at NEAR."""
    slope, offset = np.polyfit(NEAR, np.arctanh(2.0 * fraction - 1.0), 1)
    return float(-offset / slope), float(1.0 / slope)


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

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

"""A recorded gait inverted as Liu & Zhang (2024) do it: eight joints taken for the eight cells.

Twenty instants of a cycle; each joint's angle about its mean, in rad, is held against its cell as
it is, without a readout; the objective is half the sum of squares (section 4, Tables 1 and 2).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from cpg_ros.dynamics.orbit import Orbit, solve_orbit
from cpg_ros.errors import InputError
from cpg_ros.inversion.cycle_fit import cycle_samples, CycleFit, fit_cycle
from cpg_ros.inversion.fit_data import MeanCycle
from cpg_ros.networks.delayed import CELLS, Delayed
from cpg_ros.networks.network import Network
from cpg_ros.robots.robot import Robot
from cpg_ros.short_repr import ShortRepr
import numpy as np
from scipy.optimize import minimize_scalar

#: Instants of a cycle, and phases between recording and orbit that are tried.
POINTS, SHIFTS = 20, 60


@dataclass(frozen=True, eq=False, repr=False)
class PaperFit(ShortRepr):
    """A fit from one start.

    Attributes:
        start: values of the free parameters to begin with.
        fit: what came of it.
        joints: names, in the order of the cells.

    """

    start: dict[str, float]
    fit: CycleFit
    joints: tuple[str, ...]

    @property
    def end(self) -> dict[str, float]:
        """The numerical solution."""
        return dict(zip(self.start, self.fit.values.tolist(), strict=True))

    @property
    def errors(self) -> dict[str, tuple[float, float]]:
        """Range of the synchronisation error of each joint, rad."""
        return {name: (float(column.min()), float(column.max()))
                for name, column in zip(self.joints, self.fit.errors.T, strict=True)}


def refuse_others(robot: Robot | None, network: str) -> None:
    """Refuse robots and networks (by name, '' for the robot's) that are not those of the paper.

    Raises:
        ValueError: the network is another one, or not each of its cells has one joint.

    """
    if (robot is None or Delayed.name not in robot.networks or network not in ('', Delayed.name)
            or sorted(robot.cells) != list(range(CELLS))):
        raise InputError('--paper: the paper has one joint for each of the eight cells of the '
                         f'{Delayed.name} network: a --robot file has to say which, such as goat')


def paper_fits(cycle: MeanCycle, cells: Mapping[str, int], network: Network, gait: str,
               free: Sequence[str], starts: Sequence[Mapping[str, float]] = ({},)
               ) -> list[PaperFit]:
    """Fit parameters to eight joints, once from each start.

    Args:
        cycle: the recording's.
        cells: joint -> its cell, from 1; each cell has one joint.
        network: the other parameters.
        gait: that was recorded.
        free: names of the parameters to fit.
        starts: free parameter -> value to start from; {} starts from the network's own values.

    Raises:
        InputError: another network, a cell with no joint or several, or what fit_cycle cannot
            use.
        NoOrbit: a start has no such gait.

    """
    if not isinstance(network, Delayed):
        raise InputError(f'--paper: the paper has the {Delayed.name} network, not the '
                         f'{network.name}')
    by_cell = sorted(cells, key=lambda name: cells[name])
    if [cells[name] for name in by_cell] != list(range(1, CELLS + 1)):
        raise InputError('the paper takes one joint for each of the eight cells: a robot file '
                         'has to say which, such as the shipped goat')
    rows = [list(cycle.joints).index(name) for name in by_cell]
    theta = np.arange(POINTS) / POINTS
    samples = np.array([np.interp(theta, cycle.theta, cycle.mean[row] - cycle.mean[row].mean(),
                                  period=1.0) for row in rows]).T
    for name in (name for start in starts for name in start):
        if name not in free:
            raise InputError(f"start: '{name}' is not free")
    begins = [replace(network, **start) for start in starts]
    theta = theta + _shift(solve_orbit(begins[0], gait), theta, samples)
    found = []
    for begin in begins:
        values = begin.as_dict()
        found.append(PaperFit({name: values[name] for name in free},
                              fit_cycle(samples, theta, begin, gait, free),
                              tuple(by_cell)))
    return found


def _shift(orbit: Orbit, theta: np.ndarray, samples: np.ndarray) -> float:
    """Phase of an orbit, cycles, at which its cells come nearest to samples."""
    def gap(shift: float) -> float:
        return float(np.sum((cycle_samples(orbit, theta + shift)[0] - samples)**2))

    near = min(np.arange(SHIFTS) / SHIFTS, key=gap)
    return float(minimize_scalar(gap, method='bounded', options={'xatol': 1e-9},
                                 bounds=(near - 1.0 / SHIFTS, near + 1.0 / SHIFTS)).x)

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

"""What is fitted: joints over one cycle, and the cells that drive them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

from cpg_ros.errors import InputError
from cpg_ros.networks.network import Network
from cpg_ros.robots.robot import Robot
from cpg_ros.short_repr import ShortRepr
import numpy as np

#: A mean cycle is never known better than to this share of the joint's range.
KNOWN = 1e-4


class MeanCycle(Protocol):
    """The mean cycle of a recording."""

    @property
    def joints(self) -> Sequence[str]:
        """Names."""

    @property
    def theta(self) -> np.ndarray:
        """Even grid over a cycle, shape (m,)."""

    @property
    def mean(self) -> np.ndarray:
        """Joints, rad, shape (joints, m)."""

    @property
    def error(self) -> np.ndarray:
        """Standard errors of the mean, rad, shape (joints, m)."""

    @property
    def frequency(self) -> float:
        """Strides per second, Hz."""

    @property
    def frequency_error(self) -> float:
        """Its standard error, Hz."""


@dataclass(frozen=True, eq=False, repr=False)
class Joints(ShortRepr):
    """Joints over one cycle.

    Attributes:
        names: of the joints.
        theta: cycles, shape (m,).
        data: rad, shape (m, joints).
        cells: the cell behind each joint, from 0, shape (joints,).
        stated: standard error of each joint's mean, over the whole cycle, rad, shape (joints,).

    """

    names: tuple[str, ...]
    theta: np.ndarray
    data: np.ndarray
    cells: np.ndarray
    stated: np.ndarray


def cells_of(source: Robot | Mapping[str, Sequence[str]], network: type[Network],
             assignment: str = '') -> dict[str, int]:
    """Return joint -> cell from 1: of a robot file, or the first cell of each joint's leg.

    Args:
        source: a robot, or leg -> names of its joints.
        network: whose legs they are.
        assignment: of cells to legs, the usual one by default.

    Raises:
        InputError: the network has no such leg or assignment, or does not drive this robot.

    """
    if isinstance(source, Robot):
        if network.name not in source.networks:
            raise InputError(f'robot {source.name} is not for the network {network.name}')
        return {joint.name: joint.cell for joint in source.joints}
    assignment = assignment or next(iter(network.legs))
    if assignment not in network.legs:
        raise InputError(f"assignment '{assignment}' is not one of {', '.join(network.legs)}")
    legs = network.legs[assignment]
    for leg in source:
        if leg not in legs:
            raise InputError(f"the network {network.name} has no leg '{leg}': it has "
                             f'{", ".join(legs)}')
    return {joint: legs[leg][0] for leg, joints in source.items() for joint in joints}


def joints_of(cycle: MeanCycle, cells: Mapping[str, int], network: Network
              ) -> Joints:
    """Return the joints that cells drive.

    Args:
        cycle: the recording's.
        cells: joint -> its cell, from 1.
        network: whose cells.

    Raises:
        InputError: a value is not finite, or a joint or cell is unknown.
        ValueError: shapes do not fit.

    """
    names = list(cells)
    theta = np.asarray(cycle.theta, dtype=float)
    mean, error = (np.asarray(array, dtype=float) for array in (cycle.mean, cycle.error))
    recorded = list(cycle.joints)
    if mean.shape != (len(recorded), theta.size) or error.shape != mean.shape:
        raise ValueError(f'mean has the shape {mean.shape} and error {error.shape}; '
                         f'{len(recorded)} joints on {theta.size} instants need '
                         f'({len(recorded)}, {theta.size})')
    if not names:
        raise InputError('no joint is assigned to a cell')
    if theta.size < 1 or np.abs((theta - theta[0]) - np.arange(theta.size) / theta.size
                                ).max() > 1e-9:
        raise ValueError('theta must be an even grid over one cycle')
    for name in names:
        if name not in recorded:
            raise InputError(f"joint '{name}' is not in the recording")
        if not 1 <= cells[name] <= network.cells:
            raise InputError(f"joint '{name}' has the cell {cells[name]}; there are "
                             f'{network.cells}')
        row = recorded.index(name)
        if not (np.isfinite(mean[row]).all() and np.isfinite(error[row]).all()
                and (error[row] >= 0.0).all()):
            raise InputError(f"joint '{name}' has a mean or error that is not finite")
    rows = [recorded.index(name) for name in names]
    stated = np.sqrt(np.mean(error[rows]**2, axis=1))
    spans = np.ptp(mean[rows], axis=1)
    floor = KNOWN * np.where(spans > 0.0, spans, max(float(spans.max()), 1e-12))
    return Joints(tuple(names), theta, mean[rows].T.copy(),
                  np.array([cells[name] - 1 for name in names]), np.maximum(stated, floor))

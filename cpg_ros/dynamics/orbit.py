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

"""Periodic orbits of a network in a gait, for all methods that solve for them."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
import math

from cpg_ros.common.errors import InputError, ShortRepr
from cpg_ros.dynamics.arclength import NoOrbit
from cpg_ros.dynamics.isotypic import power
from cpg_ros.networks.equations import equations_of
from cpg_ros.networks.network import asymmetry, MAX_ASYMMETRY, Network, other_gait, stated_gait
from cpg_ros.networks.symmetry import Symmetry
import numpy as np

#: Of the range that deflation keeps free about a known period, relative to it.
DEFLATION_WIDTH = 0.1
#: The factor of deflation has a pole.
MAX_DEFLATION = 3.0


def deflation_factor(period: float, step: float, periods: Sequence[float]) -> float:
    """Return the factor of Newton's step that keeps it away from known orbits.

    Args:
        period: the current one, in any unit of time.
        step: Newton's step of the period, in the same unit.
        periods: of the known orbits, in the same unit.

    """
    slope = 0.0
    for other in periods:
        x = period / other - 1.0 or 1e-12
        slope -= 2.0 * DEFLATION_WIDTH**2 / (x * (x * x + DEFLATION_WIDTH**2)) / other
    factor = 1.0 / (1.0 - slope * step or 1e-12)
    return max(-MAX_DEFLATION, min(MAX_DEFLATION, factor))


#: States, shape (m, components), as a function of times in cycles, shape (m,).
Path = Callable[[np.ndarray], np.ndarray]
#: Waveforms over theta in cycles, of a wave and a variable: ``waveform(theta, wave, variable)``.
Waveforms = Callable[[np.ndarray, int, int], np.ndarray]
#: Reason why an orbit has no phase response.
NOT_ISOLATED = ('the orbit is not isolated, so its phase has no response: a disturbance other '
                'than along it does not decay, either')
#: Grid on which extremes are searched before they are refined.
POINTS = 1024
#: MIN_SIGNAL_POINTS: at which signals are compared; PARTS: numbers of equal parts of a cycle that
#: an orbit must not repeat.
MIN_SIGNAL_POINTS, PARTS = 60, np.array([2, 3, 5, 7, 11, 13, 17, 19])
#: Difference of two equal signals, over their range.
SIGNAL_TOLERANCE = 1e-4


@dataclass(frozen=True, eq=False, repr=False)
class Orbit(ShortRepr, ABC):
    """A gait of a network: waveforms, period, and phase of each cell.

    Called with times it returns states, so it serves as a history for simulations. Cell i's
    variable q is ``u_{w,q}(t/T + phi_i)``, w its wave, phi_i its phase; at phase zero the first
    variable of cell 1 peaks.

    Attributes:
        network: parameters.
        symmetry: of the gait; gives waves and phases of the cells.
        period: T in model time.

    """

    network: Network
    symmetry: Symmetry
    period: float

    @cached_property
    def residual(self) -> float:
        """Largest residual of all equations, between the nodes where they are solved."""
        states, past = self(self.between), self(self.between - self.network.delay)
        gaps = self.derivative(self.between) - self.network.rates(states, past)
        return float(np.abs(gaps).max())

    @cached_property
    def error(self) -> float:
        """Estimated error of a state over its variable's range, or of the period over itself.

        It is the largest change on a mesh twice as fine.

        Raises:
            NoOrbit: there is no solution on that mesh.

        """
        finer, theta = self.refined(), self.between / self.period
        states = finer(theta * finer.period)
        sizes = np.ptp(states, axis=0).reshape(self.network.variables, -1).max(axis=1)
        # A variable that stands still has no range.
        sizes = np.maximum(sizes, SIGNAL_TOLERANCE * np.abs(states).max())
        gaps = np.abs(states - self(self.between)).max(axis=0) / sizes.repeat(self.network.cells)
        return float(max(gaps.max(), abs(finer.period / self.period - 1.0)))

    @abstractmethod
    def refined(self) -> 'Orbit':
        """Solve for the same orbit on a mesh twice as fine; NoOrbit if that fails."""

    @property
    @abstractmethod
    def between(self) -> np.ndarray:
        """Times between the nodes at which the equations are solved, model time."""

    @property
    @abstractmethod
    def d_period(self) -> np.ndarray:
        """Derivatives of the period by the network's parameters, shape (parameters,)."""

    @abstractmethod
    def waveform(self, theta: np.ndarray, order: int = 0, wave: int = 0, variable: int = 0
                 ) -> np.ndarray:
        """Return a waveform, or its derivative in theta of order 1 or 2, at theta in cycles."""

    @abstractmethod
    def d_waveform(self, theta: np.ndarray, wave: int = 0, variable: int = 0) -> np.ndarray:
        """Return the derivatives by the parameters, shape theta.shape + (parameters,)."""

    def _summary(self) -> str:
        return (f'{self.gait} of {self.network.name}: period {self.period:.7g}, '
                f'residual {self.residual:.0e}')

    @property
    @abstractmethod
    def samples(self) -> int:
        """Number of evenly spaced points that resolve a waveform."""

    @property
    def gait(self) -> str:
        """Name of the gait that the parameters state, or else that has this symmetry."""
        network = self.network
        return stated_gait(network) or next(
            (gait for reverse in (1, -1) for gait in network.gaits()
             if network.symmetry(gait) == power(self.symmetry, reverse)), 'unnamed orbit')

    @property
    def phases(self) -> np.ndarray:
        """Phase of each cell in cycles, shape (cells,)."""
        return self.symmetry.phases

    @cached_property
    def leads(self) -> np.ndarray:
        """Lead of each cell on cell 1 in cycles, from 0 to 1, shape (cells,).

        Between different waveforms it is that of the first harmonics of the first variable.
        """
        count = int(self.waves.max()) + 1
        if count == 1:
            return self.phases
        theta = np.arange(POINTS) / POINTS
        first = [np.exp(-2j * np.pi * theta) @ self.waveform(theta, 0, wave)
                 for wave in range(count)]
        ahead = np.angle(first) / (2.0 * np.pi)
        # Rounding must not turn 0 into 1.
        return np.asarray(np.round(self.phases + (ahead - ahead[0])[self.waves], 9) % 1.0)

    @property
    def leg_phases(self) -> dict[str, float]:
        """Leg -> lead of its first cell on cell 1, cycles, from 0 to 1."""
        legs = next(iter(self.network.legs.values()))
        return {leg: float(self.leads[cells[0] - 1]) for leg, cells in legs.items()}

    @property
    def waves(self) -> np.ndarray:
        """Waveform of each cell, from 0, shape (cells,)."""
        return self.symmetry.waves

    @cached_property
    def levels(self) -> np.ndarray:
        """Middle and half the range of each waveform, shape (waves, variables, 2)."""
        ranges = np.empty((int(self.waves.max()) + 1, self.network.variables, 2))
        theta = np.arange(POINTS) / POINTS
        for wave, variable in np.ndindex(ranges.shape[:2]):
            values = self.waveform(theta, 0, wave, variable)
            ends = []
            for extremum in (theta[values.argmin()], theta[values.argmax()]):
                for _ in range(3):
                    slope, bend = (float(self.waveform(np.array([extremum]), order, wave,
                                                       variable)[0]) for order in (1, 2))
                    if bend:
                        extremum -= float(np.clip(slope / bend, -1.0 / POINTS, 1.0 / POINTS))
                ends.append(float(self.waveform(np.array([extremum]), 0, wave, variable)[0]))
            low, high = min(ends[0], values.min()), max(ends[1], values.max())
            ranges[wave, variable] = 0.5 * (high + low), 0.5 * (high - low)
        return ranges

    @property
    def peak(self) -> float:
        """Largest value of cell 1."""
        return float(self.levels[0, 0].sum())

    def of_cells(self, times: np.ndarray, waveform: Waveforms) -> np.ndarray:
        """Return a waveform at the phases of all cells, shape times.shape + (components,)."""
        theta = np.asarray(times, dtype=float)[..., None] / self.period + self.phases
        out = np.empty((*theta.shape[:-1], self.network.components))
        for wave in range(int(self.waves.max()) + 1):
            cells = np.flatnonzero(self.waves == wave)
            for variable in range(self.network.variables):
                out[..., cells + variable * self.network.cells] = waveform(
                    theta[..., cells], wave, variable)
        return out

    def _states(self, times: np.ndarray, order: int) -> np.ndarray:
        return self.of_cells(times, lambda theta, wave, variable: self.waveform(
            theta, order, wave, variable))

    def __call__(self, times: np.ndarray) -> np.ndarray:
        """Return all states at model times, cell 1 peaking at 0; times.shape + (components,)."""
        return self._states(times, 0)

    def cycle(self, points: int) -> np.ndarray:
        """Return states at even times of a cycle from cell 1's peak, (points, components)."""
        return self(np.arange(points) / points * self.period)

    def derivative(self, times: np.ndarray) -> np.ndarray:
        """Return slopes of all states, per model time; shape times.shape + (components,)."""
        return self._states(times, 1) / self.period


def check_values(network: Network, gait: str) -> None:
    """Check that a network may have a gait.

    Raises:
        InputError: a parameter is not finite, or the delay is not positive.
        NoOrbit: weights differ that the gait's symmetry makes equal, or the parameters state the
            phases of another gait.

    """
    for name, value in network.as_dict().items():
        if not np.isfinite(value):
            raise InputError(f'{name} is {value}, not a finite number')
    if network.delay_parameter and network.delay <= 0.0:
        raise InputError(f'{network.delay_parameter} is {network.delay}, it must be positive')
    broken = network.broken(network.symmetry(gait))
    if broken:
        raise NoOrbit(f'no {gait} with these weights: its symmetry needs {broken} to be equal')
    if (equations_of(type(network)).by_cell
            and asymmetry(network, network.symmetry(gait)) > MAX_ASYMMETRY):
        raise NoOrbit(f'no {gait} with these weights: the equations do not have its symmetry')
    if other := other_gait(network, gait):
        raise NoOrbit(other)


def extra_symmetry(orbit: Orbit) -> str:
    """Name a symmetry that an orbit has beyond its gait's, or ''.

    The equations of a gait also hold for orbits with more symmetry, such as a walk in place of a
    skip, and for several revolutions of an orbit.
    """
    # A multiple of the denominator of every possible shift.
    points = math.lcm(orbit.symmetry.group.exponent, MIN_SIGNAL_POINTS)
    theta, cells = np.arange(points) / points, orbit.network.cells
    x = orbit(theta * orbit.period)[:, :cells]
    # A single time excludes nearly all of them.
    again = np.abs(orbit(orbit.period / PARTS)[:, :cells] - x[0]).max(axis=1)
    for parts in PARTS[again < SIGNAL_TOLERANCE * np.ptp(x)]:
        later = orbit((theta + 1.0 / parts) * orbit.period)[:, :cells]
        if np.abs(later - x).max() < SIGNAL_TOLERANCE * np.ptp(x):
            return f'it repeats {parts} times'
    return signal_symmetry(orbit.symmetry, x, SIGNAL_TOLERANCE)


def signal_symmetry(symmetry: Symmetry, x: np.ndarray, same: float) -> str:
    """Name a symmetry that a cycle has beyond another one, or ''.

    Args:
        symmetry: of the cycle.
        x: first variable of the cells at even times of a cycle, shape (points, cells), points a
            multiple of the group's exponent.
        same: largest difference of equal signals, over the range of all.

    """
    most = same * np.ptp(x)
    names, lates, cells = _beyond(symmetry, len(x))
    # A single time excludes nearly all of them.
    for k in np.flatnonzero(np.abs(x[0, cells] - x[lates]).max(axis=1) < most):
        if np.abs(x[:, cells[k]] - np.roll(x, -lates[k], axis=0)).max() < most:
            return names[k]
    return ''


@lru_cache(maxsize=64)
def _beyond(symmetry: Symmetry, points: int) -> tuple[list[str], np.ndarray, np.ndarray]:
    """List the symmetries that a cycle could have beyond another one.

    Returns:
        Their names; their shifts in points of a cycle; and the permutations, shape (n, cells).

    """
    shifts, extra = dict(symmetry.shifts), []
    for name, element in symmetry.group.elements.items():
        order = symmetry.group.order(name)
        shift = round(order * shifts[name]) if name in shifts else None
        extra += [(f'{name} shifts it by {k}/{order} of a cycle', points * k // order, element)
                  for k in range(order) if k != shift]
    return ([name for name, _, _ in extra], np.array([late for _, late, _ in extra], dtype=int),
            np.array([element for *_, element in extra],
                     dtype=int).reshape(len(extra), symmetry.group.cells))

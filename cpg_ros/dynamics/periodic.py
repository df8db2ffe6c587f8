"""Periodic orbits of a network in a gait, whatever solves them."""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from cpg_ros.errors import CpgError
from cpg_ros.networks.network import Network

#: Points of a cycle among which extremes are looked for before they are refined.
POINTS = 1024


class NoOrbit(CpgError):
    """The parameter set has no such gait; the message says what stands against it."""


@dataclass(frozen=True, eq=False)
class Orbit(ABC):
    """A gait of a network: its waveforms, its period, and where each cell is in them.

    Called with times it gives the states, so it serves as a history for the simulation. Cell i's
    variable q is ``u_{w,q}(t/T + phi_i)``, w its wave, phi_i its phase; phase zero is where the
    first variable of cell 1 peaks.

    Attributes:
        network: the parameters it solves.
        symmetry: of the gait; gives waves and phases of the cells.
        period: T in model time.
        residual: largest residual of the equations, between the nodes where they are solved.
        d_period: derivatives of the period by the network's parameters, shape (parameters,).

    """

    network: Network
    symmetry: Any
    period: float
    residual: float
    d_period: np.ndarray

    @abstractmethod
    def waveform(self, theta: np.ndarray, order: int = 0, wave: int = 0, variable: int = 0
                 ) -> np.ndarray:
        """A waveform, or its derivative in theta of order 1 or 2, at theta in cycles."""

    @property
    def phases(self) -> np.ndarray:
        """Phase of each cell in cycles, shape (cells,)."""
        return self.symmetry.phases

    @property
    def waves(self) -> np.ndarray:
        """Number of each cell's waveform, from 0, shape (cells,)."""
        return self.symmetry.waves

    @cached_property
    def levels(self) -> np.ndarray:
        """Middle and half the range of each waveform, shape (waves, variables, 2)."""
        found = np.empty((int(self.waves.max()) + 1, self.network.variables, 2))
        theta = np.arange(POINTS) / POINTS
        for wave, variable in np.ndindex(found.shape[:2]):
            values = self.waveform(theta, 0, wave, variable)
            ends = []
            for place in (theta[values.argmin()], theta[values.argmax()]):
                for _ in range(3):
                    slope, bend = (float(self.waveform(np.array([place]), order, wave,
                                                       variable)[0]) for order in (1, 2))
                    if bend:
                        place -= float(np.clip(slope / bend, -1.0 / POINTS, 1.0 / POINTS))
                ends.append(float(self.waveform(np.array([place]), 0, wave, variable)[0]))
            low, high = min(ends[0], values.min()), max(ends[1], values.max())
            found[wave, variable] = 0.5 * (high + low), 0.5 * (high - low)
        return found

    @property
    def peak(self) -> float:
        """The largest value of cell 1."""
        return float(self.levels[0, 0].sum())

    def _states(self, times: np.ndarray, order: int) -> np.ndarray:
        theta = np.asarray(times, dtype=float)[..., None] / self.period + self.phases
        out = np.empty((*theta.shape[:-1], self.network.components))
        for wave in range(int(self.waves.max()) + 1):
            cells = np.flatnonzero(self.waves == wave)
            for variable in range(self.network.variables):
                out[..., cells + variable * self.network.cells] = self.waveform(
                    theta[..., cells], order, wave, variable)
        return out

    def __call__(self, times: np.ndarray) -> np.ndarray:
        """All states at model times, cell 1 peaking at 0; shape times.shape + (components,)."""
        return self._states(times, 0)

    def derivative(self, times: np.ndarray) -> np.ndarray:
        """Slopes of all states, per model time; shape times.shape + (components,)."""
        return self._states(times, 1) / self.period

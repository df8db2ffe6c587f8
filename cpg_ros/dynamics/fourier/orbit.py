"""Orbits as trigonometric polynomials: the gaits of networks with a delay."""

from dataclasses import dataclass, field

import numpy as np

from cpg_ros.dynamics.fourier import collocation
from cpg_ros.dynamics.periodic import Orbit


@dataclass(frozen=True, eq=False)
class FourierOrbit(Orbit):
    """An orbit by its waveforms on evenly spaced nodes.

    Attributes:
        values: waveforms at the nodes theta = m / n, shape (waves, variables, n); that of
            cell 1's first variable peaks at the first one.
        d_values: derivatives of the nodal values by the parameters, at fixed theta, shape
            (waves, variables, n, parameters).

    """

    values: np.ndarray = field(repr=False)
    d_values: np.ndarray = field(repr=False)

    @property
    def peak(self) -> float:
        """The largest value of cell 1."""
        return float(self.values[0, 0, 0])

    @property
    def levels(self) -> np.ndarray:
        """Middle and half the range of each waveform, shape (waves, variables, 2)."""
        if self.symmetry.odd and self.values.shape[:2] == (1, 1):
            # The symmetry x -> -x puts the middle at 0.
            return np.array([[[0.0, self.peak]]])
        return super().levels

    @property
    def samples(self) -> int:
        """Even points of a cycle that tell all there is: the nodes."""
        return int(self.values.shape[-1])

    def waveform(self, theta: np.ndarray, order: int = 0, wave: int = 0, variable: int = 0
                 ) -> np.ndarray:
        """A waveform, or its derivative in theta of the given order, at theta in cycles."""
        return collocation.evaluate(self.values[wave, variable], theta, order)

    def d_waveform(self, theta: np.ndarray, wave: int = 0, variable: int = 0) -> np.ndarray:
        """Derivatives of a waveform by the parameters, shape theta.shape + (parameters,)."""
        return np.stack([collocation.evaluate(column, theta)
                         for column in self.d_values[wave, variable].T], -1)

    def _states(self, times: np.ndarray, order: int) -> np.ndarray:
        theta = np.asarray(times, dtype=float) / self.period
        if self.values.shape[:2] == (1, 1):
            return collocation.evaluate(self.values[0, 0], theta, order, self.phases)
        return super()._states(times, order)

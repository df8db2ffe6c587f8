"""Orbits as trigonometric polynomials: the gaits of networks with a delay."""

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from cpg_ros.dynamics.arclength import Curve
from cpg_ros.dynamics.fourier import collocation
from cpg_ros.dynamics.periodic import Orbit
from cpg_ros.networks.parameter_line import ParameterLine


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

    def curve(self, line: ParameterLine, scales: tuple[float, float]) -> tuple[Curve, np.ndarray]:
        """The gait's orbits along a line of parameters, and the place of this one among them."""
        from cpg_ros.dynamics.fourier.curve import FourierCurve
        value = line.value(self.network)
        return (FourierCurve(self.network, self.symmetry, line, scales),
                np.array([*self.values.ravel(), self.period, value]))

    @cached_property
    def _variation(self) -> tuple[Any, np.ndarray]:
        from cpg_ros.dynamics.fourier.floquet import variation
        return variation(self)

    @property
    def multipliers_within(self) -> np.ndarray:
        """Floquet multipliers within the gait's class, 1 among them."""
        return self._variation[1]

    def multipliers_transverse(self, gain: float = 0.0) -> np.ndarray:
        """Floquet multipliers transverse to the gait's class, with a symmetry lock."""
        found: np.ndarray = self._variation[0].transverse(gain)
        return found

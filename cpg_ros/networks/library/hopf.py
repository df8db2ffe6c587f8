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

"""Coupled Hopf oscillators, one per leg, with different frequencies in stance and swing.

Righetti & Ijspeert (ICRA 2008), without feedback:

    x_i' = alpha (mu - r_i^2) x_i - omega_i y_i, y_i' = beta (mu - r_i^2) y_i + omega_i x_i + sum_j
        k_ij y_j, omega_i = omega_stance / (exp(-b y_i) + 1) + omega_swing / (exp(b y_i) + 1).

The leg is in stance while x falls, for y > 0. With ``omega_stance = pi nu / duty`` and
``omega_swing = pi nu / (1 - duty)``, an uncoupled oscillator has, for large b, the period 1/nu and
the duty factor duty. The weights k_ij select the gait.
"""

from dataclasses import dataclass
from functools import cache
import math
from typing import Any, ClassVar

from cpg_ros.networks.definition import Cell, Number, Range, tanh
from cpg_ros.networks.leg_numbers import for_legs
from cpg_ros.networks.library.families import LegPairs
from cpg_ros.networks.network import Preset
import numpy as np

TWO_PI = 2.0 * math.pi


@dataclass(frozen=True)
class HopfOscillators(LegPairs):
    """Hopf oscillators for any even number of legs; rates per model time, nu in cycles."""

    alpha: float
    beta: float
    mu: float
    b: float
    nu: float
    duty: float

    states: ClassVar[tuple[str, ...]] = ('x', 'y')
    readout: ClassVar = 'phase'
    step: ClassVar[float] = 0.001
    own_ranges: ClassVar[dict[str, Range]] = {
        'alpha': Range(0.1, 100.0, 'how fast x returns to its amplitude [1/model time]'),
        'beta': Range(0.1, 100.0, 'how fast y returns to its amplitude [1/model time]'),
        'mu': Range(-10.0, 10.0, 'square of the amplitude of an uncoupled oscillator'),
        'b': Range(0.0, 100.0, 'how sharply stance changes to swing'),
        'nu': Range(0.1, 10.0, 'frequency of an uncoupled oscillator [cycles/model time]'),
        'duty': Range(0.1, 0.95, 'duty factor: fraction of the stride in stance')}
    usual: ClassVar[dict[str, float]] = {
        'alpha': 5.0, 'beta': 50.0, 'mu': 1.0, 'b': 20.0, 'nu': 1.0, 'duty': 0.6}
    free: ClassVar[tuple[str, ...]] = ('duty',)
    line: ClassVar[str] = 'mu'
    span: ClassVar[tuple[float, float] | None] = (-2.0, 2.0)
    typical_cycle: ClassVar[tuple[tuple[float, float, float], ...]] = (
        (0.0, 1.0, 0.0), (0.0, 1.0, 0.25))

    @classmethod
    def equations(cls, cell: Cell, p: Any) -> tuple[Number, ...]:
        """Return the rates of x and y, as in the module; logistic functions as tanh."""
        x, y = cell.now()
        stance = 0.5 + 0.5 * tanh(0.5 * p.b * y)
        omega = math.pi * p.nu * (stance / p.duty + (1.0 - stance) / (1.0 - p.duty))
        left = p.mu - x**2 - y**2
        dx, dy = p.alpha * left * x - omega * y, p.beta * left * y + omega * x
        for kind, sources in cls.inputs().items():
            _, y_j = cell.now(sources)
            dy = dy + getattr(p, kind) * y_j
        return dx, dy

    def on_orbit(self, gait: str) -> tuple[np.ndarray, float] | None:
        """Return a state near the gait's orbit, and the period of an uncoupled oscillator."""
        if self.mu <= 0.0:
            return None
        phase = np.array([float(shift) for shift in self.phases(gait)])
        # Stance is half a turn, and so is swing.
        angle = np.interp(phase, [0.0, self.duty, 1.0], [0.0, 0.5 * TWO_PI, TWO_PI])
        size = math.sqrt(self.mu)
        return np.concatenate([size * np.cos(angle), size * np.sin(angle)]), 1.0 / self.nu

    def at_rest(self) -> np.ndarray:
        """Return 0, at which all oscillations bifurcate."""
        return np.zeros(2)

    @classmethod
    @cache
    def presets(cls) -> dict[str, Preset]:
        """Return a preset for each gait: alpha, beta and mu of the paper, duty 0.6."""
        return {gait: Preset(gait, cls(**cls.usual, **cls.weights(gait))) for gait in cls.gaits()}


@for_legs(4)
class Hopf(HopfOscillators):
    """Hopf oscillators for four legs."""

    name: ClassVar[str] = 'hopf'

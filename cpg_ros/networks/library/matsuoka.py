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

"""Matsuoka oscillators: two neurons per leg, flexor and extensor, that inhibit each other.

Matsuoka (Biol. Cybern. 52, 1985 and 56, 1987); for legs Taga, Yamaguchi & Shimizu (Biol. Cybern.
65, 1991):

    tau u_i' = -u_i - beta v_i - a y_e(i) + c + sum_j k_ij (y_j - y_e(j)), tau_v v_i' = -v_i + y_i,
        y_i = max(0, u_i),

where u is the potential and v the fatigue of a neuron, e(i) is the antagonist of neuron i, and j
runs over the neurons of the same kind in other legs. The output of a leg is the difference of its
neurons. Two uncoupled neurons oscillate for ``1 + tau/tau_v < a < 1 + beta``, almost sinusoidally,
at the frequency ``omega = sqrt(((tau + tau_v) beta - tau a) / (tau a)) / tau_v`` (Matsuoka, Biol.
Cybern. 104, 2011).
"""

from dataclasses import dataclass
from functools import cache
from typing import Any, ClassVar

from cpg_ros.networks.definition import Cell, leg_count, Number, positive, Range
from cpg_ros.networks.leg_numbers import for_legs
from cpg_ros.networks.library.families import LegPairs
from cpg_ros.networks.network import Preset
import numpy as np


@dataclass(frozen=True)
class MatsuokaOscillators(LegPairs):
    """Matsuoka oscillators for any even number of legs; time constants in model time."""

    tau: float
    tau_v: float
    beta: float
    a: float
    c: float

    states: ClassVar[tuple[str, ...]] = ('u', 'v')
    each: ClassVar[int] = 2
    kinks: ClassVar[tuple[str, ...]] = ('u',)
    most: ClassVar[float] = 2.0
    readout: ClassVar = 'phase'
    step: ClassVar[float] = 0.001
    own_ranges: ClassVar[dict[str, Range]] = {
        'tau': Range(0.005, 1.0, 'time constant of the potential [model time]'),
        'tau_v': Range(0.01, 10.0, 'time constant of the fatigue [model time]'),
        'beta': Range(0.0, 20.0, 'how strongly fatigue inhibits a neuron'),
        'a': Range(0.0, 20.0, 'how strongly flexor and extensor inhibit each other'),
        'c': Range(0.0, 10.0, 'constant input to every neuron')}
    usual: ClassVar[dict[str, float]] = {
        'tau': 0.15, 'tau_v': 0.6, 'beta': 2.5, 'a': 2.0, 'c': 1.0}
    looked_for: ClassVar[float] = 0.1
    free: ClassVar[tuple[str, ...]] = ('beta', 'a')
    line: ClassVar[str] = 'a'
    span: ClassVar[tuple[float, float] | None] = (0.0, 4.0)
    typical_cycle: ClassVar[tuple[tuple[float, float, float], ...]] = (
        (0.0, 0.5, 0.0), (0.2, 0.1, 0.85))

    @classmethod
    def equations(cls, cell: Cell, p: Any) -> tuple[Number, ...]:
        """Return the rates of u and v, as in the module."""
        def antagonist(i: int) -> int:
            return (i + cls.cells // 2) % cls.cells

        u, v = cell.now()
        u_e, _ = cell.now(antagonist)
        drive: Number = p.c - p.a * positive(u_e)
        for kind, sources in cls.inputs().items():
            u_j, _ = cell.now(sources)
            u_f, _ = cell.now(tuple(antagonist(j) for j in sources))
            drive = drive + getattr(p, kind) * (positive(u_j) - positive(u_f))
        return (drive - u - p.beta * v) / p.tau, (positive(u) - v) / p.tau_v

    @property
    def omega(self) -> float:
        """Approximate angular frequency of a leg's two neurons alone (Matsuoka 2011)."""
        square = ((self.tau + self.tau_v) * self.beta - self.tau * self.a) / (self.tau * self.a)
        return float(np.sqrt(square) / self.tau_v) if square > 0.0 else 0.0

    def on_orbit(self, gait: str) -> tuple[np.ndarray, float] | None:
        """Return a state near the gait's orbit, and the period of two neurons alone."""
        if not self.omega:
            return None
        phase = np.array([float(shift) for shift in self.phases(gait)])
        theta = 2.0 * np.pi * np.concatenate([phase, phase + 0.5])
        delay = np.arctan(self.omega * self.tau_v)
        half = 0.3 * self.c
        return np.concatenate([half * np.cos(theta),
                               half * (0.3 + 0.2 * np.cos(theta - delay))]), (
            2.0 * np.pi / self.omega)

    def at_rest(self) -> np.ndarray:
        """Return u = v = c / (1 + beta + a), where the inputs between legs cancel."""
        return np.full(2, self.c / (1.0 + self.beta + self.a))

    @classmethod
    @cache
    def presets(cls) -> dict[str, Preset]:
        """Return a preset for each gait, with fatigue and weights close to those of Taga et al."""
        size = 0.15 / max(leg_count(cls) - 1, 1)
        return {gait: Preset(gait, cls(**cls.usual, **cls.weights(gait, size, 1.0)))
                for gait in cls.gaits()}


@for_legs(4)
class Matsuoka(MatsuokaOscillators):
    """Matsuoka oscillators for four legs."""

    name: ClassVar[str] = 'matsuoka'

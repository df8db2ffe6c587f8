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

"""Amplitude-controlled phase oscillators, one per leg: any footfall pattern is a gait.

Ijspeert, Crespi, Ryczko & Cabelguen (Science 315, 2007), supporting text; with all weights equal,
this is the rhythm generator of CPG-RL (Bellegarda & Ijspeert 2022):

    theta_i' = 2 pi nu + sum_j w r_j sin(theta_j - theta_i - phi_ij), r_i'' = a (a/4 (R - r_i) -
        r_i').

Every oscillator receives input from every other one. ``phi_ij = 2 pi (offset_j - offset_i)``,
where leg i leads by offset_i cycles. All sines vanish on the gait: the period is exactly 1/nu, the
amplitude R, and the phases are the offsets. With n legs, a small disturbance of the phases decays
at the rate n w R. The amplitude is critically damped and converges at the rate a/2.

A cell has the variables x = r cos(theta), y = r sin(theta) and s = r', so nothing jumps by 2 pi.
"""

from dataclasses import dataclass
from functools import cache
import math
from typing import Any, ClassVar

from cpg_ros.networks.definition import Cell, cos, Number, Range, sin, sqrt
from cpg_ros.networks.leg_numbers import for_legs, leg_names, leg_positions
from cpg_ros.networks.library.families import ring_gaits
from cpg_ros.networks.network import known, Network, Preset, stated_gait
from cpg_ros.networks.symmetry import Group, Symmetry
import numpy as np

TWO_PI = 2.0 * math.pi
#: Keeps the angle of an oscillator at rest from being undefined: r is at least 1e-9.
MIN_SQUARED_RADIUS = 1e-18


@cache
def _alone(cells: int) -> Symmetry:
    """Return the trivial symmetry: the parameters state every cell's phase."""
    return Symmetry.of(Group(cells, ()), {}, variables=3)


@dataclass(frozen=True)
class PhaseOscillators(Network):
    """Phase oscillators for any even number of legs; nu in cycles, a and w per model time."""

    nu: float
    r: float
    a: float
    w: float

    #: Gait -> cycles of a stride at which the legs touch down, in their order.
    footfalls: ClassVar[dict[str, tuple[float, ...]]]
    own_ranges: ClassVar[dict[str, Range]] = {
        'nu': Range(0.1, 10.0, 'intrinsic frequency of every oscillator [cycles/model time]'),
        'r': Range(0.01, 10.0, 'amplitude R to which every oscillator converges'),
        'a': Range(1.0, 200.0, 'how fast amplitudes converge [1/model time]'),
        'w': Range(0.0, 50.0, 'weight of every other oscillator [1/model time]')}
    states: ClassVar[tuple[str, ...]] = ('x', 'y', 's')
    readout: ClassVar = 'phase'
    step: ClassVar[float] = 0.0025
    couplings: ClassVar[tuple[str, ...]] = ('w',)
    unnamed: ClassVar[str] = 'unnamed'
    rests: ClassVar[bool] = False
    #: The phases are given, and a readout does not depend on the other parameters.
    free: ClassVar[tuple[str, ...]] = ()
    line: ClassVar[str] = 'w'
    span: ClassVar[tuple[float, float] | None] = (0.0, 5.0)

    @classmethod
    def fitted(cls, legs: int) -> dict[str, Any]:
        """Return the network's attributes for this many legs; InputError for an odd number."""
        names = leg_names(legs)
        offsets = tuple(f'offset_{leg}' for leg in names)
        gaits: dict[str, tuple[float, ...]] = {'walk': (0.0, 0.5), 'hop': (0.0, 0.0)}
        if legs > 2:
            # Leg by leg from behind, left before right; phases of the modes (j, k) of two rings.
            gaits = {gait: tuple(-(i // 2 * j / legs + i % 2 * k / 2.0) % 1.0
                                 for i in range(legs))
                     for gait, (j, k) in ring_gaits(legs).items()}
        # Between the two waves that come to the legs of a side one after the other.
        between = (0.0, 0.25) if legs == 2 else tuple(
            (0.5 * (i % 2) + 1.5 * (i // 2) / legs) % 1.0 for i in range(legs))
        return {
            **leg_positions(legs), 'cells': legs,
            'offsets': dict(zip(names, offsets, strict=True)),
            'legs': {'implicit': {leg: (n + 1,) for n, leg in enumerate(names)}},
            # Offsets of the cell n further round.
            'own_of_cells': {f'offset{n}': offsets[n:] + offsets[:n] for n in range(legs)},
            'ranges': {**cls.own_ranges, **{
                f'offset_{leg}': Range(-1.0, 1.0, f'cycles by which the leg {leg} is ahead')
                for leg in names}},
            'footfalls': {**gaits, 'unnamed': between}, 'usual_gait': next(iter(gaits)),
            'fields': offsets}

    @classmethod
    def equations(cls, cell: Cell, p: Any) -> tuple[Number, ...]:
        """Return the rates of x, y and s, as in the module."""
        x, y, s = cell.now()
        r = sqrt(x**2 + y**2 + MIN_SQUARED_RADIUS)
        speed: Number = TWO_PI * p.nu
        for n in range(1, cls.cells):
            x_j, y_j, _ = cell.now(lambda i, n=n: i + n)
            phi = TWO_PI * (getattr(p, f'offset{n}') - p.offset0)
            # r_j sin(theta_j - phi) and r_j cos(theta_j - phi).
            sine, cosine = y_j * cos(phi) - x_j * sin(phi), x_j * cos(phi) + y_j * sin(phi)
            speed = speed + p.w * (sine * x - cosine * y) / r
        return (s * x / r - speed * y, s * y / r + speed * x, p.a * (p.a / 4.0 * (p.r - r) - s))

    @classmethod
    def gaits(cls) -> tuple[str, ...]:
        """Return the names of the footfall patterns."""
        return tuple(cls.footfalls)

    def symmetry(self, gait: str) -> Symmetry:
        """Return the trivial symmetry, with the gait's phases (from the offsets if they state it).

        Raises:
            ValueError: there is no gait of this name.

        """
        known(gait, self.gaits())
        stating = self if stated_gait(self) == gait else self.presets()[gait].network
        return _alone(self.cells).with_leads(stating.leads)

    def on_orbit(self, gait: str) -> tuple[np.ndarray, float]:
        """Return the gait's state where the first leg's oscillator peaks, and the period."""
        angle = TWO_PI * np.array(self.leads)
        return np.concatenate([self.r * np.cos(angle), self.r * np.sin(angle),
                               np.zeros(self.cells)]), 1.0 / self.nu

    @classmethod
    @cache
    def presets(cls) -> dict[str, Preset]:
        """Return a preset for each footfall pattern, with a = 20 (Ijspeert et al.) and w = 1."""
        return {gait: Preset(gait, cls(1.0, 1.0, 20.0, 1.0, *(-fall % 1.0 for fall in falls)))
                for gait, falls in cls.footfalls.items()}


@for_legs(4)
class Phase(PhaseOscillators):
    """Phase oscillators for four legs."""

    name: ClassVar[str] = 'phase'
    usual_gait: ClassVar[str] = 'trot'
    #: Footfalls of LH RH LF RF. The symmetrical gaits are ordered by how far a fore foot is behind
    #: the hind foot on its side (Hildebrand, Science 150, 1965): 0 pace, 1/8 amble, 1/4 walk in
    #: lateral and 3/4 in diagonal sequence, 1/2 trot. Of the others, the canter has three beats,
    #: and the gallops have a tenth of a cycle between the feet of a pair (Alexander, Int. J.
    #: Robotics Research 3(2), 1984, as in Collins & Stewart 1993); right lead, except in
    #: the left canter.
    footfalls: ClassVar[dict[str, tuple[float, ...]]] = {
        'walk': (0.0, 0.5, 0.25, 0.75),
        'diagonal_walk': (0.0, 0.5, 0.75, 0.25),
        'amble': (0.0, 0.5, 0.125, 0.625),
        'trot': (0.0, 0.5, 0.5, 0.0),
        'pace': (0.0, 0.5, 0.0, 0.5),
        'canter_left': (1 / 3, 0.0, 2 / 3, 1 / 3),
        'canter_right': (0.0, 1 / 3, 1 / 3, 2 / 3),
        'transverse_gallop': (0.0, 0.1, 0.5, 0.6),
        'rotary_gallop': (0.1, 0.0, 0.5, 0.6),
        'bound': (0.0, 0.0, 0.5, 0.5),
        'half_bound': (0.0, 0.0, 0.4, 0.6),
        'pronk': (0.0, 0.0, 0.0, 0.0),
        'unnamed': (0.0, 0.5, 0.375, 0.875)}

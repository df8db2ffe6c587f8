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

"""The delayed network: eight tanh cells in two rings (Liu & Zhang 2024, eq. 1.1).

``x_i' = a x_i + b tanh(x_i) + d tanh(x_{i-2}) + c tanh(x_{s(i)}(t - tau))``, i = 1..8 with
indices cyclic, s swapping 1-2, 3-4, 5-6, 7-8. Time is in model units. The network is
equivariant under Z4 (i -> i + 2), Z2 (s) and x -> -x. For 2n legs it has 4n cells, and Z2n for
Z4; the equation is the same.
"""

from dataclasses import dataclass
from functools import cache
import math
from typing import Any, ClassVar

from cpg_ros.networks.definition import Cell, leg_count, Number, Range, tanh
from cpg_ros.networks.leg_numbers import leg_positions
from cpg_ros.networks.library.families import (
    across,
    behind,
    ring_gaits,
    ring_places,
    ring_symmetry,
)
from cpg_ros.networks.network import known, LeastCoupling, Network, Preset
from cpg_ros.networks.symmetry import Symmetry

CELLS = 8
#: STEP: step in real time, model time: 500 steps a cycle, error of a waveform about 1e-9.
STEP = 0.0025
#: Longest delay that may be set at run time, in model time.
MAX_DELAY = 5.0


@dataclass(frozen=True)
class Delayed(Network):
    """Parameters of the delayed network; a, b, c, d in 1/model time, tau in model time."""

    a: float
    b: float
    c: float
    d: float
    tau: float

    name: ClassVar[str] = 'delayed'
    cells: ClassVar[int] = CELLS
    states: ClassVar[tuple[str, ...]] = ('x',)
    readout: ClassVar = 'waveform'
    delay_parameter: ClassVar[str] = 'tau'
    longest_delay: ClassVar[float] = MAX_DELAY
    needed: ClassVar[dict[str, str]] = {
        'c': 'left and right legs would not be coupled, and no delay would matter'}
    step: ClassVar[float] = STEP
    ranges: ClassVar[dict[str, Range]] = {
        'a': Range(-20.0, 20.0, 'linear rate of each cell [1/model time]'),
        'b': Range(-20.0, 20.0, 'weight of each cell on itself [1/model time]'),
        'c': Range(-20.0, 20.0, "weight of the opposite leg's cell, delayed [1/model time]"),
        'd': Range(-20.0, 20.0, 'weight of the preceding cell on the same side [1/model time]'),
        'tau': Range(STEP, MAX_DELAY, 'delay between opposite legs [model time]')}
    couplings: ClassVar[tuple[str, ...]] = ('c', 'd')
    legs: ClassVar[dict[str, dict[str, tuple[int, ...]]]] = {
        'implicit': {'lh': (1, 7), 'rh': (2, 8), 'lf': (3, 5), 'rf': (4, 6)}}
    sides: ClassVar[dict[str, str]] = leg_positions(4)['sides']
    girdles: ClassVar[dict[str, str]] = leg_positions(4)['girdles']
    usual_gait: ClassVar[str] = 'trot'
    usual_robot: ClassVar[str] = 'quadruped'
    free: ClassVar[tuple[str, ...]] = ('c', 'tau')
    line: ClassVar[str] = 'tau'

    @staticmethod
    def equations(cell: Cell, p: Any) -> tuple[Number, ...]:
        """Eq. 1.1; see the module."""
        (x,), (y,), (z,) = cell.now(), cell.now(behind), cell.past(across)
        return (p.a * x + p.b * tanh(x) + p.d * tanh(y) + p.c * tanh(z),)

    @classmethod
    def gaits(cls) -> tuple[str, ...]:
        """Return the names of the primary gaits."""
        return tuple(cls.modes())

    @classmethod
    def modes(cls) -> dict[str, tuple[int, int]]:
        """Return gait -> (j, k)."""
        return ring_gaits(leg_count(cls))

    @classmethod
    def fitted(cls, legs: int) -> dict[str, Any]:
        """Return the attributes of two rings for this many legs; InputError for an odd number."""
        return {**ring_places(legs), 'usual_gait': next(iter(ring_gaits(legs)))}

    @classmethod
    def presets(cls) -> dict[str, Preset]:
        """Return PRESETS, or of other numbers of legs a set for each gait by the same rule."""
        return PRESETS if cls.family is None else _presets(cls)

    def symmetry(self, gait: str) -> Symmetry:
        """Return the gait's symmetry.

        On four legs the sign of d sets the direction of the wave in walk and jump: forward (j = 1,
        LF leads LH) for d < 0, backward (j = 3, LH leads LF) otherwise.

        Raises:
            ValueError: the gait is not one of the primary ones.

        """
        j, k = self.modes()[known(gait, self.gaits())]
        if self.family is None and j == 1 and self.d >= 0.0:
            j = 3
        return ring_symmetry(leg_count(type(self)), (j, k), variables=1, odd=True)

    def validate_gait(self, gait: str) -> str:
        """Return why c rules a gait out: its sign, or that no delay makes it oscillate; or ''."""
        j, k = self.modes()[gait]
        if 2 * j % leg_count(type(self)) == 0 and self.c * (-1) ** k >= 0.0:
            sign = 'positive' if k else 'negative'
            return f'c {self.c:g} gives no {gait}: c must be {sign}'
        text, value, least = self.least_coupling(gait)
        if value <= least:
            return f'{text} {value:g} gives no {gait} at any delay: it must be above {least:.4f}'
        return ''

    def least_coupling(self, gait: str) -> LeastCoupling:
        """Roots of ``lambda = A + B exp(-lambda tau)`` cross where |B| > |Re A|."""
        shift = self.modes()[gait][0] / leg_count(type(self))
        minimum = abs(self.a + self.b + self.d * round(math.cos(2.0 * math.pi * shift), 15))
        return LeastCoupling('|c|', abs(self.c), minimum)

    def sufficient_gain(self, rate: float) -> float:
        """Return a symmetry gain at which every gait is attracting, 1/model time.

        A disturbance z transverse to the gait's class obeys z' = (a - g) z + (b + d R) D(t) z + c
        S D(t - tau) z(t - tau), with permutations R, S and 0 < D <= 1 (slopes of tanh). It decays
        at least as exp(-rate t) once ``g >= a + |b| + |d| + |c| exp(rate tau) + rate``, in any
        state of the network, also during a change of gait.

        Args:
            rate: guaranteed decay, 1/model time.

        """
        return max(0.0, self.a + abs(self.b) + abs(self.d)
                   + abs(self.c) * math.exp(rate * self.tau) + rate)


@cache
def _presets(network: type[Delayed]) -> dict[str, Preset]:
    """Return a preset for each gait of any number of legs; the signs of c and d select it.

    d makes the wanted one of the two waves the faster (Im A > 0), which attracts; a gives all
    waves the same Re A, up to rounding.
    """
    presets = {}
    for gait, (j, k) in network.modes().items():
        angle = 2.0 * math.pi * j / leg_count(network)
        d = -1.0 if j > 0 else 1.0
        a = round(-3.5 - d * math.cos(angle), 1)
        if 2 * j % leg_count(network) == 0:
            a, d = -4.5, 2.0 * d
        presets[gait] = Preset(gait, network(a, 1.0, 6.5 if k else -6.5, d, 0.4))
    return presets


# Ours share one time scale: trot, pace, bound and pronk have one waveform (T = 1.2783), walk
# and jump another (T = 1.0905). c > 0 puts the legs of a pair half a cycle apart (k = 1), c < 0
# together (k = 0); the sign of d selects j, and for walk and jump the sense of the wave.
PRESETS = {
    'walk': Preset('walk', Delayed(-4.5, 1.0, 6.5, 2.0, 0.4)),
    'trot': Preset('trot', Delayed(-4.5, 1.0, 6.5, -2.0, 0.4)),
    'pace': Preset('pace', Delayed(-4.5, 1.0, 6.5, 2.0, 0.4)),
    'bound': Preset('bound', Delayed(-4.5, 1.0, -6.5, -2.0, 0.4)),
    'jump': Preset('jump', Delayed(-4.5, 1.0, -6.5, 2.0, 0.4)),
    'pronk': Preset('pronk', Delayed(-4.5, 1.0, -6.5, 2.0, 0.4)),
    # The trot's orbit, for robots with a motion of its own for it.
    'run': Preset('trot', Delayed(-4.5, 1.0, 6.5, -2.0, 0.4)),
    'liu2024_walk': Preset('walk', Delayed(-4.5, 1.0, 6.5, -2.0, 0.4)),
    'liu2024_trot': Preset('trot', Delayed(-4.5, 1.0, 6.5, -2.0, 0.4)),
    'liu2024_pace': Preset('pace', Delayed(-3.0, 0.1, 4.0, 1.0, 0.7)),
    'goat_trot': Preset('trot', Delayed(-2.0, 1.0, 6.43, -2.0, 0.25)),
    'goat_slope_walk': Preset('walk', Delayed(-2.0, 1.0, 6.5, -2.0, 0.245)),
}

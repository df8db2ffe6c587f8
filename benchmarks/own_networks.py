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

"""Networks that are none of the package's, for benchmarks.

FitzHugh-Nagumo and Wilson-Cowan cells, relaxation oscillators, unlike cells, and chemical ones.
One of Hodgkin-Huxley cells stands in the tutorial about networks of one's own.
"""

from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from functools import cache
from pathlib import Path
import re
import tempfile
from typing import ClassVar

from common import ROOT
from cpg_ros.networks.definition import Range, tanh
from cpg_ros.networks.network import Network, Preset
from cpg_ros.networks.registry import find_network
from cpg_ros.networks.symmetry import Group, Symmetry

RING = Group(4, (('turn', (1, 2, 3, 0)),))
OTHER = (1, 0)
PAIR = Group(2, (('side', OTHER),))
SHIFTS = {'hop': Fraction(0), 'walk': Fraction(1, 2)}


@dataclass(frozen=True)
class FhnRing(Network):
    """v' = v - v^3/3 - w + i + k (v_before - v), w' = eps (v + a - b w), in a ring of four."""

    i: float = 0.5
    k: float = -0.2
    eps: float = 0.08
    a: float = 0.7
    b: float = 0.8

    name = 'fhn_ring'
    cells = 4
    states = ('v', 'w')
    readout = 'phase'
    step = 0.05
    ranges: ClassVar = {'i': Range(-1.0, 3.0, 'current'), 'k': Range(-2.0, 2.0, 'coupling'),
              'eps': Range(0.0, 1.0, 'rate of w'), 'a': Range(-2.0, 2.0, ''),
              'b': Range(0.0, 2.0, '')}
    couplings = ('k',)
    legs: ClassVar = {'first': {f'leg{n}': (n,) for n in range(1, 5)}}
    usual_gait = 'walk'
    free = ('i', 'k')
    line = 'i'
    span = (-0.5, 0.7)

    @staticmethod
    def equations(cell, p):
        """Return the rates."""
        v, w = cell.now()
        before, _ = cell.now(lambda number: number - 1)
        return (v - v**3 / 3.0 - w + p.i + p.k * (before - v), p.eps * (v + p.a - p.b * w))

    @classmethod
    def gaits(cls):
        """Return all alike, and those with legs a quarter, half and three quarters apart."""
        return 'pronk', 'walk', 'two_by_two', 'backward_walk'

    def symmetry(self, gait):
        """Return by what fraction of a cycle a leg follows the one before it."""
        return Symmetry.of(RING, {'turn': Fraction(self.gaits().index(gait), 4)})

    @classmethod
    def presets(cls):
        """Return the walk's."""
        return {'walk': Preset('walk', cls())}


class Pair(Network):
    """What networks of two legs have in common, of one cell each unless they say otherwise."""

    cells = 2
    readout = 'phase'
    legs: ClassVar = {'ankle': {'left': (1,), 'right': (2,)}}
    usual_gait = 'walk'

    @classmethod
    def gaits(cls):
        """Return both legs alike, and half a cycle apart."""
        return tuple(SHIFTS)

    def symmetry(self, gait):
        """Return by what fraction of a cycle one leg follows the other."""
        return Symmetry.of(PAIR, {'side': SHIFTS[gait]})

    @classmethod
    def presets(cls):
        """Return the same set for both gaits."""
        return {gait: Preset(gait, cls()) for gait in SHIFTS}


@dataclass(frozen=True)
class WilsonCowan(Pair):
    """Two half-centres of excitatory and inhibitory populations (Wilson & Cowan 1972).

    ``e' = -e + S(a e - b u - k u_other + p)``, ``tau u' = -u + S(c e - d u + q)``, S logistic.
    """

    a: float = 10.0
    b: float = 10.0
    c: float = 10.0
    d: float = 2.0
    p: float = 1.0
    q: float = -3.0
    k: float = 1.0
    tau: float = 1.0

    name = 'wilson_cowan'
    states = ('e', 'u')
    step = 0.02
    ranges: ClassVar = {'tau': Range(0.1, 10.0, ''), **{
        name: Range(-50.0, 50.0, '') for name in ('a', 'b', 'c', 'd', 'p', 'q', 'k')}}
    couplings = ('k',)
    sides: ClassVar = {'left': 'left', 'right': 'right'}
    free = ('p', 'k')
    line = 'p'
    span = (-5.0, 5.0)

    @staticmethod
    def equations(cell, p):
        """Return the rates."""
        def logistic(x):
            return 0.5 + 0.5 * tanh(0.5 * x)
        e, u = cell.now()
        _, u_other = cell.now(OTHER)
        return (-e + logistic(p.a * e - p.b * u - p.k * u_other + p.p),
                (-u + logistic(p.c * e - p.d * u + p.q)) / p.tau)

    @classmethod
    def presets(cls):
        """Return the walk's."""
        return {'walk': Preset('walk', cls())}


@dataclass(frozen=True)
class VanDerPol(Pair):
    """Two relaxation oscillators: x'' = mu (1 - x^2) x' - x + k (x_other - x)."""

    mu: float = 4.0
    k: float = -0.1

    name = 'van_der_pol'
    states = ('x', 'y')
    step = 0.005
    ranges: ClassVar = {'mu': Range(0.0, 20.0, ''), 'k': Range(-1.0, 1.0, 'coupling')}
    couplings = ('k',)
    free = ('mu', 'k')
    line = 'mu'
    span = (-1.0, 5.0)

    @staticmethod
    def equations(cell, p):
        """Return the rates."""
        x, y = cell.now()
        other, _ = cell.now(OTHER)
        return y, p.mu * (1.0 - x**2) * y - x + p.k * (other - x)


@dataclass(frozen=True)
class UnlikePairs(Pair):
    """Flexors and extensors that differ: FitzHugh-Nagumo cells, two of each, in two legs.

    v' = v - v^3/3 - w + i + k (v_other_leg - v) - m v_antagonist, w' = eps (v + 0.7 - 0.8 w).
    """

    k: float = -0.2
    i: float = 0.5
    m: float = 0.2
    eps_flexor: float = 0.08
    eps_extensor: float = 0.12

    name = 'unlike_pairs'
    cells = 4
    states = ('v', 'w')
    step = 0.05
    ranges: ClassVar = {name: Range(-2.0, 2.0, '') for name in (
        'k', 'i', 'm', 'eps_flexor', 'eps_extensor')}
    own_of_cells: ClassVar = {'eps': ('eps_flexor',) * 2 + ('eps_extensor',) * 2}
    couplings = ('k', 'm')
    legs: ClassVar = {'ankle': {'left': (1, 3), 'right': (2, 4)}}
    free = ('i', 'k')
    line = 'i'
    span = (-0.5, 0.7)

    @staticmethod
    def equations(cell, p):
        """Return the rates."""
        v, w = cell.now()
        other, _ = cell.now((1, 0, 3, 2))
        antagonist, _ = cell.now((2, 3, 0, 1))
        return (v - v**3 / 3.0 - w + p.i + p.k * (other - v) - p.m * antagonist,
                p.eps * (v + 0.7 - 0.8 * w))

    def symmetry(self, gait):
        """Return by what fraction of a cycle one leg follows the other."""
        return Symmetry.of(Group(4, (('side', (1, 0, 3, 2)),)), {'side': SHIFTS[gait]})


@dataclass(frozen=True)
class Brusselators(Pair):
    """A ring of three: x' = a - (b + 1) x + x^2 y + k (x_before - x), y' = b x - x^2 y."""

    k: float = 0.1
    a: float = 1.0
    b: float = 2.5

    name = 'brusselators'
    cells = 3
    states = ('x', 'y')
    step = 0.01
    ranges: ClassVar = {'k': Range(-2.0, 2.0, 'coupling'), 'a': Range(0.0, 5.0, ''),
                        'b': Range(0.0, 10.0, '')}
    legs: ClassVar = {'first': {f'leg{n}': (n,) for n in range(1, 4)}}
    couplings = ('k',)
    usual_gait = 'wave'
    free = ('a', 'b')
    line = 'b'
    span = (1.0, 4.0)

    @staticmethod
    def equations(cell, p):
        """Return the rates."""
        x, y = cell.now()
        before, _ = cell.now(lambda number: number - 1)
        return p.a - (p.b + 1.0) * x + x**2 * y + p.k * (before - x), p.b * x - x**2 * y

    @classmethod
    def gaits(cls):
        """Return all alike, and a third of a cycle apart."""
        return 'hop', 'wave'

    def symmetry(self, gait):
        """Return by what fraction of a cycle a leg follows the one before it."""
        return Symmetry.of(Group(3, (('turn', (1, 2, 0)),)),
                           {'turn': Fraction(self.gaits().index(gait), 3)})

    @classmethod
    def presets(cls):
        """Return the same set for both gaits."""
        return {gait: Preset(gait, cls()) for gait in ('hop', 'wave')}


def tutorial_file(folder: str, name: str) -> str:
    """Write a file of the tutorial about networks of one's own; return its path."""
    page = (ROOT / 'docs' / 'tutorials' / 'own_network.md').read_text()
    path = Path(folder) / name
    path.write_text(re.search(rf':name: {re.escape(name)}\n\n(.*?)```', page, re.DOTALL)[1])
    return str(path)


@cache
def half_centre() -> Callable[..., Network]:
    """Return the tutorial's network of Hodgkin-Huxley cells."""
    with tempfile.TemporaryDirectory() as folder:
        return find_network(tutorial_file(folder, 'half_centre.py'))

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

"""Networks that are none of the package's, for benchmarks: FitzHugh-Nagumo and Wilson-Cowan cells.

A third one, of Hodgkin-Huxley cells, stands in the tutorial about networks of one's own.
"""

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


@dataclass(frozen=True)
class WilsonCowan(Network):
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
    cells = 2
    states = ('e', 'u')
    readout = 'phase'
    step = 0.02
    ranges: ClassVar = {'tau': Range(0.1, 10.0, ''), **{
        name: Range(-50.0, 50.0, '') for name in ('a', 'b', 'c', 'd', 'p', 'q', 'k')}}
    couplings = ('k',)
    legs: ClassVar = {'ankle': {'left': (1,), 'right': (2,)}}
    sides: ClassVar = {'left': 'left', 'right': 'right'}
    usual_gait = 'walk'
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
    def gaits(cls):
        """Return both legs alike, and half a cycle apart."""
        return tuple(SHIFTS)

    def symmetry(self, gait):
        """Return by what fraction of a cycle one leg follows the other."""
        return Symmetry.of(PAIR, {'side': SHIFTS[gait]})

    @classmethod
    def presets(cls):
        """Return the walk's."""
        return {'walk': Preset('walk', cls())}


def tutorial_file(folder: str, name: str) -> str:
    """Write a file of the tutorial about networks of one's own; return its path."""
    page = (ROOT / 'docs' / 'tutorials' / 'own_network.md').read_text()
    path = Path(folder) / name
    path.write_text(re.search(rf':name: {re.escape(name)}\n\n(.*?)```', page, re.DOTALL)[1])
    return str(path)


@cache
def half_centre() -> type[Network]:
    """Return the tutorial's network of Hodgkin-Huxley cells."""
    with tempfile.TemporaryDirectory() as folder:
        return find_network(tutorial_file(folder, 'half_centre.py'))

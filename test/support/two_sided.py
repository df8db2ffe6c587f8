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

"""What networks of two equal legs have in common."""

from fractions import Fraction

from cpg_ros.networks.definition import Range
from cpg_ros.networks.network import known, Network, Preset
from cpg_ros.networks.symmetry import Group, Symmetry

OTHER = (1, 0)
Z2 = Group(2, (('side', OTHER),))
SHIFTS = {'hop': Fraction(0), 'walk': Fraction(1, 2)}
WIDE = Range(-50.0, 50.0, '')


class TwoSided(Network):
    """Two cells of two variables, each of which hears the other."""

    cells = 2
    states = ('x', 'y')
    readout = 'phase'
    step = 0.01
    legs = {'ankle': {'left': (1,), 'right': (2,)}}
    span = (-1.0, 3.0)

    @classmethod
    def gaits(cls):
        return tuple(SHIFTS)

    def symmetry(self, gait):
        return Symmetry.of(Z2, {'side': SHIFTS[known(gait, self.gaits())]})

    @classmethod
    def presets(cls):
        return {gait: Preset(gait, cls()) for gait in SHIFTS}

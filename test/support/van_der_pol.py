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

"""A pair of van der Pol oscillators, in any units of its variables and of time."""

from dataclasses import dataclass

from cpg_ros.networks.definition import Range
from cpg_ros.networks.network import Preset
from two_sided import OTHER, TwoSided


def van_der_pol(size, time):
    """Return the class of a pair of oscillators x'' = (mu - x^2) x' - x + k (x_other - x)."""
    @dataclass(frozen=True)
    class Pair(TwoSided):
        mu: float
        k: float

        name = f'van_der_pol_{size:g}_{time:g}'.translate(str.maketrans('-.+', '___'))
        step = 0.01 * time
        ranges = {'mu': Range(-10.0, 10.0, 'parameter'), 'k': Range(-5.0, 5.0, 'weight')}
        couplings = ('k',)
        usual_gait = 'walk'
        free = ('mu', 'k')
        line = 'mu'

        @staticmethod
        def equations(cell, p):
            x, y = (value / size for value in cell.now())
            other, _ = (value / size for value in cell.now(OTHER))
            return (size / time * y,
                    size / time * ((p.mu - x**2) * y - x + p.k * (other - x)))

        @classmethod
        def presets(cls):
            return {gait: Preset(gait, cls(1.5, k))
                    for gait, k in (('walk', -0.1), ('hop', 0.1))}

    return Pair

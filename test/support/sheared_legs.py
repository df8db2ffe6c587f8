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

"""Two legs whose orbits and phase responses have closed forms, with and without a delay.

Stuart-Landau oscillators with shear,
``z' = (mu + i omega) z - (1 + i shear) |z|^2 z + k z_other``, z = x + i y,
the other leg heard a delay ago or at once. On the walk ``z = r exp(i pace t)`` with
``r^2 = mu - k cos(pace tau)`` and ``pace = omega - shear r^2 + k sin(pace tau)``.
"""

from dataclasses import dataclass

from cpg_ros.dynamics.solve_orbit import solve_from_path
from cpg_ros.networks.definition import Range
from cpg_ros.networks.network import Preset
import numpy as np
from scipy.optimize import brentq
from two_sided import OTHER, TwoSided


@dataclass(frozen=True)
class ShearedLegs(TwoSided):
    """The other leg is heard at once."""

    mu: float = 1.0
    omega: float = 6.0
    shear: float = 0.7
    k: float = -0.5

    name = 'sheared_legs'
    step = 0.005
    ranges = {name: Range(-10.0, 10.0, '') for name in ('mu', 'omega', 'shear', 'k')}
    couplings = ('k',)
    sides = {'left': 'left', 'right': 'right'}
    usual_gait = 'walk'
    free = ('mu', 'k')
    line = 'mu'

    @staticmethod
    def heard(cell):
        return cell.now(OTHER)

    @classmethod
    def equations(cls, cell, p):
        x, y = cell.now()
        x_other, y_other = cls.heard(cell)
        square = x ** 2 + y ** 2
        turn = p.omega - p.shear * square
        return ((p.mu - square) * x - turn * y + p.k * x_other,
                (p.mu - square) * y + turn * x + p.k * y_other)

    @classmethod
    def presets(cls):
        return {'walk': Preset('walk', cls())}


@dataclass(frozen=True)
class LateShearedLegs(ShearedLegs):
    """It is heard a delay ago."""

    tau: float = 0.3

    name = 'late_sheared_legs'
    delay_parameter = 'tau'
    longest_delay = 2.0
    ranges = {**ShearedLegs.ranges, 'tau': Range(0.01, 2.0, 'delay [model time]')}
    line = 'tau'

    @staticmethod
    def heard(cell):
        return cell.past(OTHER)


def closed_walk(network):
    """Pace and radius of the walk."""
    def square(pace):
        return network.mu - network.k * np.cos(pace * network.delay)

    pace = brentq(lambda w: w - network.omega + network.shear * square(w)
                  - network.k * np.sin(w * network.delay), 0.1, 20.0, xtol=1e-14)
    return pace, np.sqrt(square(pace))


def solved_walk(network):
    """Return the walk's orbit, from a guess that is somewhat off."""
    pace, radius = closed_walk(network)

    def path(theta):
        turn = 2.0 * np.pi * theta[:, None]
        return 1.05 * radius * np.hstack([np.cos(turn), -np.cos(turn), np.sin(turn),
                                          -np.sin(turn)])
    return solve_from_path(network, network.symmetry('walk'), path, 2.1 * np.pi / pace)


def closed_response(network, times):
    """Phase response of the left leg, cycles per unit, shape (times, 2).

    In the frame that turns with the orbit the variational equation has constant coefficients,
    and the response is their left null vector, turned: two by two.
    """
    pace, radius = closed_walk(network)
    angle = pace * network.delay
    own = network.mu + 1j * (network.omega - pace) - 2.0 * (1.0 + 1j * network.shear) * radius**2
    mirrored = -(1.0 + 1j * network.shear) * radius**2
    late = -network.k * np.exp(-1j * angle)
    columns = [np.array([(own * z + mirrored * np.conj(z)).real,
                         (own * z + mirrored * np.conj(z)).imag]) for z in (1.0, 1j)]
    delayed = np.array([[late.real, -late.imag], [late.imag, late.real]])
    left = np.linalg.svd((np.array(columns).T + delayed).T)[2][-1]
    along = (np.eye(2) + network.delay * delayed) @ np.array([0.0, pace * radius])
    # Two legs share what the walk does.
    left = 0.5 * left * pace / (2.0 * np.pi * (left @ along))
    cos, sin = np.cos(pace * times), np.sin(pace * times)
    return np.stack([cos * left[0] - sin * left[1], sin * left[0] + cos * left[1]], axis=-1)



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

"""Two legs in which a second rhythm begins beside the first, with a normal form in closed form.

``w' = (1 + i omega - |w|^2 + (kappa + i gamma) |z|^2) w + k (w_other - w)``, the gait, and
``z' = (growth + i nu + (alpha + i beta) |z|^2 + e (|w|^2 - 1)) z + h z_other``, w = x + i y,
z = p + i q, z_other heard at once or a delay ago.
On the hop ``|w|^2 = 1 + kappa |z|^2``, and z of both legs alike obeys ``z' = (growth + i nu) z
+ h z(t - tau) + (alpha + i beta + e kappa) |z|^2 z``.
"""

from dataclasses import dataclass

from cpg_ros.networks.network import Preset
import numpy as np
from two_sided import OTHER, TwoSided, WIDE


@dataclass(frozen=True)
class TwoRhythms(TwoSided):
    """z of the other leg is heard at once."""

    growth: float = -0.1
    omega: float = 6.0
    nu: float = 2.3
    alpha: float = 0.4
    beta: float = 0.3
    kappa: float = 0.5
    gamma: float = 0.7
    e: float = -1.5
    h: float = 0.6
    k: float = 0.4

    name = 'two_rhythms'
    states = ('x', 'y', 'p', 'q')
    variables = 4
    ranges = dict.fromkeys(('growth', 'omega', 'nu', 'alpha', 'beta', 'kappa', 'gamma', 'e', 'h',
                            'k'), WIDE)
    couplings = ('h', 'k')
    usual_gait = 'hop'
    free = ('growth', 'k')
    line = 'growth'

    @staticmethod
    def heard(cell):
        return cell.now(OTHER)

    @classmethod
    def equations(cls, cell, p):
        x, y, u, v = cell.now()
        x_other, y_other, *_ = cell.now(OTHER)
        *_, u_other, v_other = cls.heard(cell)
        rho, size = x ** 2 + y ** 2, u ** 2 + v ** 2
        rise, turn = 1.0 - rho + p.kappa * size, p.omega + p.gamma * size
        grow = p.growth + p.alpha * size + p.e * (rho - 1.0)
        spin = p.nu + p.beta * size
        return (rise * x - turn * y + p.k * (x_other - x),
                rise * y + turn * x + p.k * (y_other - y),
                grow * u - spin * v + p.h * u_other,
                grow * v + spin * u + p.h * v_other)

    @classmethod
    def presets(cls):
        return {gait: Preset(gait, cls()) for gait in ('hop', 'walk')}

    def begins(self):
        """Return the growth at which z of both legs begins, and its pace there."""
        from scipy.optimize import brentq
        tau = self.delay
        pace = brentq(lambda w: w - self.nu + self.h * np.sin(w * tau), self.nu - abs(self.h),
                      self.nu + abs(self.h))
        return -self.h * np.cos(pace * tau), pace

    def cubic(self):
        """Return c of z' = c z |z|^2 with |z| half of that of p + i q, beside s' of the gait."""
        pace = self.begins()[1]
        own = ((self.alpha + 1j * self.beta + self.e * self.kappa)
               / (1.0 + self.h * self.delay * np.exp(-1j * pace * self.delay)))
        return 4.0 * (own - 1j * pace * self.gamma / self.omega)

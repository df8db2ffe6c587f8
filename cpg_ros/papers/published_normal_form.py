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

"""The normal form as Liu & Zhang (2024) print it, section 2; erratum 1."""

import cmath

from cpg_ros.dynamics.hopf_point import HopfPoint
from cpg_ros.dynamics.normal_form import NormalForm


def published_normal_form(point: HopfPoint) -> NormalForm:
    """Return what the printed formulas give at a Hopf point of the delayed network.

    ``D = 1/(8 (-1 + c e))``, ``k1 = 8 D (-a - b - d + c e)``, ``k2 = -8 tau D (-b + c e - d)``
    with e = exp(i omega tau), whatever the mode.
    """
    a, b, c, d, tau = point.network.as_dict().values()
    past = c * cmath.exp(1j * point.omega * tau)
    eight = 1.0 / (-1.0 + past)
    return NormalForm(eight * (-a - b - d + past), -tau * eight * (-b + past - d))

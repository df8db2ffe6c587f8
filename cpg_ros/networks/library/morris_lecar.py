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

"""The Morris-Lecar cell: membrane potential v and the fraction w of open potassium channels.

``v' = -gCa m(v)(v - vCa) - gK w (v - vK) - gL (v - vL) + i``, ``w' = phi tau(v) (n(v) - w)``, ``m
= (1 + tanh((v - v1)/v2))/2``, ``n = (1 + tanh((v - v3)/v4))/2`` and ``tau = (base + cosh((v -
v3)/(2 v4)))/(base + 1)``: base 0 in Buono & Golubitsky 2001, section 6, base 1 in Rashidi et al.
2016, eq. 2. All quantities are dimensionless.
"""

from dataclasses import dataclass

from cpg_ros.networks.definition import cosh, Number, tanh, Term


@dataclass(frozen=True)
class MorrisLecar:
    """Constants of a cell; i and phi are parameters of the network."""

    g_ca: float
    v_ca: float
    g_k: float
    v_k: float
    g_l: float
    v_l: float
    v1: float
    v2: float
    v3: float
    v4: float
    base: float

    def rates(self, v: Term, w: Term, i: Number, phi: Number) -> tuple[Term, Term]:
        """Return v' and w' of an uncoupled cell."""
        m = 0.5 * (1.0 + tanh((v - self.v1) / self.v2))
        n = 0.5 * (1.0 + tanh((v - self.v3) / self.v4))
        tau = (self.base + cosh((v - self.v3) / (2.0 * self.v4))) / (self.base + 1.0)
        return (-self.g_ca * m * (v - self.v_ca) - self.g_k * w * (v - self.v_k)
                - self.g_l * (v - self.v_l) + i, phi * tau * (n - w))

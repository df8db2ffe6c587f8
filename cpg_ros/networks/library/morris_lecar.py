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
2016, eq. 2. All quantities are dimensionless. Cells are coupled by ``v_j - s v``: linear synaptic
coupling for s = 0, diffusive coupling for s = 1 (Buono & Golubitsky, section 4).
"""

from typing import Any

from cpg_ros.networks.definition import cosh, Range, tanh, Term

#: Constant -> its range and meaning.
RANGES = {
    'g_ca': Range(0.0, 20.0, 'conductance of calcium'),
    'v_ca': Range(-5.0, 5.0, 'potential of calcium'),
    'g_k': Range(0.0, 20.0, 'conductance of potassium'),
    'v_k': Range(-5.0, 5.0, 'potential of potassium'),
    'g_l': Range(0.0, 20.0, 'conductance of the leak'),
    'v_l': Range(-5.0, 5.0, 'potential of the leak'),
    'v1': Range(-5.0, 5.0, 'v at which half of the calcium channels are open'),
    'v2': Range(0.01, 5.0, 'width of their opening'),
    'v3': Range(-5.0, 5.0, 'v at which half of the potassium channels open'),
    'v4': Range(0.01, 5.0, 'width of their opening'),
    'base': Range(0.0, 10.0, 'least part of the rate of the potassium channels'),
    'diffusion': Range(0.0, 1.0, '0 for synaptic coupling, 1 for diffusive coupling'),
    'current': Range(-5.0, 5.0, 'current into each cell'),
    'phi': Range(0.01, 5.0, 'rate of w')}


def constants(**values: float) -> dict[str, tuple[float, Range]]:
    """Return a network's ``constants`` from their values."""
    return {name: (value, RANGES[name]) for name, value in values.items()}


def rates(v: Term, w: Term, p: Any) -> tuple[Term, Term]:
    """Return v' and w' of an uncoupled cell."""
    m = 0.5 * (1.0 + tanh((v - p.v1) / p.v2))
    n = 0.5 * (1.0 + tanh((v - p.v3) / p.v4))
    tau = (p.base + cosh((v - p.v3) / (2.0 * p.v4))) / (p.base + 1.0)
    return (-p.g_ca * m * (v - p.v_ca) - p.g_k * w * (v - p.v_k) - p.g_l * (v - p.v_l)
            + p.current, p.phi * tau * (n - w))


def excess(own: Term, other: Term, p: Any) -> Term:
    """Return ``s x - x_j``, minus what couples a variable of a cell to that of another one."""
    if p.diffusion == 0.0:
        return -other
    return (own if p.diffusion == 1.0 else p.diffusion * own) - other

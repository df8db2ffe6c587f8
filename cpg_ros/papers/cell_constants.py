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

"""Constants of a Morris-Lecar cell, read off the compiled rates of a network in closed form.

v' is linear in w, and in v where m is 0 or 1; w' is linear in w, and its zero n is a tanh. So
every constant follows from rates at a few states, whatever the code was given.
"""

from cpg_ros.integration.simulate import simulate
from cpg_ros.networks.biped import Biped
from cpg_ros.networks.quadruped import Quadruped
import numpy as np

#: Where m is 0 or 1 to rounding, and where m and n bend.
FAR, NEAR = np.array([6.0, 8.0]), np.array([-0.05, 0.0, 0.05, 0.1, 0.2])


def _rates(network: Quadruped | Biped, v: np.ndarray, w: float) -> np.ndarray:
    """V' and w' of a cell at states (v, w) with all cells alike, shape (m, 2)."""
    cells = network.cells
    states = np.concatenate([np.repeat(v[:, None], cells, 1), np.full((v.size, cells), w)], 1)
    run = simulate(network, states, network.step, network.step, progress=False)
    return run.slopes[:, 0, ::cells]


def cell_constants(network: Quadruped | Biped, current: float) -> dict[str, float]:
    """Read the constants off the rates.

    Args:
        network: in which cells that are alike do not feel one another.
        current: into each cell, which cannot be distinguished from gL vL.

    Returns:
        gCa, vCa, gK, vK, gL, vL, v1 to v4, phi; and tau_far, which is tau at v3 + 10 v4 over
        its smallest value.

    """
    v = np.concatenate([-FAR, FAR, NEAR])
    closed, opened = _rates(network, v, 0.0), _rates(network, v, 1.0)
    slope, offset = np.polyfit(v, (opened - closed)[:, 0], 1)
    g_k, v_k = -slope, offset / -slope
    low_slope, low = np.polyfit(v[:2], closed[:2, 0], 1)
    high_slope, high = np.polyfit(v[2:4], closed[2:4, 0], 1)
    g_l, g_ca = -low_slope, low_slope - high_slope
    v_l, v_ca = (low - current) / g_l, (high - low) / g_ca
    m = (closed[4:, 0] - (low + low_slope * NEAR)) / (-g_ca * (NEAR - v_ca))
    v1, v2 = _bend(m)
    speed = (closed - opened)[4:, 1]
    v3, v4 = _bend(closed[4:, 1] / speed)

    def tau_phi(at: float) -> float:
        place = np.array([at])
        return float((_rates(network, place, 0.0) - _rates(network, place, 1.0))[0, 1])

    return {'gCa': float(g_ca), 'vCa': float(v_ca), 'gK': float(g_k), 'vK': float(v_k),
            'gL': float(g_l), 'vL': float(v_l), 'v1': v1, 'v2': v2, 'v3': v3, 'v4': v4,
            'phi': tau_phi(v3), 'tau_far': tau_phi(v3 + 10.0 * v4) / tau_phi(v3)}


def _bend(share: np.ndarray) -> tuple[float, float]:
    """Middle and width of ``(1 + tanh((v - middle)/width))/2`` from its values at NEAR."""
    slope, offset = np.polyfit(NEAR, np.arctanh(2.0 * share - 1.0), 1)
    return float(-offset / slope), float(1.0 / slope)

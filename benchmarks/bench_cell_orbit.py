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

"""Orbits of the Morris-Lecar gaits: ours against scipy's solve_bvp on the same reduced problem.

What a live change of parameters needs: every parameter is 2 % off the preset's. Both start from
the preset's orbit and solve for one cell of each class over 1/m of the period, with the period as
unknown; solve_bvp gets the same Jacobian and a tolerance of 1e-9 within 100,000 nodes. Ours also
gives the derivatives by every parameter; its time includes them and the search for the mesh.
"""

from dataclasses import replace
import statistics
import time
import warnings

from common import emit, log
from cpg_ros.dynamics.floquet import multipliers
from cpg_ros.dynamics.mesh.orbit import Reduced
from cpg_ros.dynamics.mesh.solve import beside, from_preset
from cpg_ros.networks.network import Network
from cpg_ros.networks.registry import PRESETS
import numpy as np
from scipy.integrate import solve_bvp

REPEATS = 5
TOLERANCE = 1e-9
TARGETS = {'ratio_median': 1.0}


def by_scipy(network: Network, gait: str, path, period: float) -> tuple[float, float]:
    """Seconds and period of solve_bvp; NaN where it does not converge."""
    reduced = Reduced(network, network.symmetry(gait))
    m, d = reduced.symmetry.order, len(reduced.kept)
    places = np.linspace(0.0, 1.0, 201)

    def rates(s, y, length):
        return length[0] * reduced.rates(y.T).T

    def jacobian(s, y, length):
        return (length[0] * reduced.linearised(y.T)[1].transpose(1, 2, 0),
                reduced.rates(y.T).T[:, None, :])

    def ends(left, right, length):
        return np.append(right - left[reduced.permutation], reduced.rates(left)[0])

    began = time.perf_counter()
    with warnings.catch_warnings():
        warnings.simplefilter('ignore')
        found = solve_bvp(rates, ends, places, path(places / m)[:, reduced.kept].T,
                          p=[period / m], fun_jac=jacobian, tol=TOLERANCE,
                          max_nodes=100_000)
    seconds = time.perf_counter() - began
    assert found.y.shape[0] == d
    return seconds, m * float(found.p[0]) if found.success else np.nan


def main() -> None:
    rows = {}
    for network in ('quadruped', 'biped'):
        for name, preset in PRESETS[network].items():
            log(f'{network} {name}')
            known, times = from_preset(preset), []
            path = lambda theta, known=known: known(theta * known.period)  # noqa: E731
            changed = replace(preset.network, **{
                key: 1.02 * value for key, value in preset.network.as_dict().items()})
            for _ in range(REPEATS + 1):
                began = time.perf_counter()
                orbit = beside(changed, known)
                times.append(time.perf_counter() - began)
            began = time.perf_counter()
            found = multipliers(orbit)
            judged = time.perf_counter() - began
            peer, period = by_scipy(changed, preset.gait, path, known.period)
            ours = statistics.median(times[1:])
            rows[f'{network} {name}'] = {
                'ours_ms': 1e3 * ours, 'residual': orbit.residual, 'period': orbit.period,
                'intervals': orbit.mesh.size - 1, 'multipliers_ms': 1e3 * judged,
                'leading_multiplier': found.leading, 'trivial_error': abs(found.trivial - 1.0),
                'scipy_ms': 1e3 * peer, 'period_difference': abs(period / orbit.period - 1.0),
                'ratio': peer / ours}
    ratio = statistics.median(row['ratio'] for row in rows.values())
    emit(benchmark='cell_orbit', ratio_median=ratio,
         ours_ms_median=statistics.median(row['ours_ms'] for row in rows.values()),
         scipy_ms_median=statistics.median(row['scipy_ms'] for row in rows.values()),
         tolerance_scipy=TOLERANCE, orbits=rows, targets=TARGETS,
         passed=ratio >= TARGETS['ratio_median'])


if __name__ == '__main__':
    main()

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

"""Branches of 40 orbits: ours by pseudo-arclength against natural continuation with scipy.

The peers get the values that ours has found, in its order, and start each solve from the orbit
before: scipy.optimize.root on the same Fourier collocation equations with the same Jacobian for
the delayed network, solve_bvp on the same reduced problem with the same Jacobian and a tolerance
of 1e-9 for the others. Neither could pass a fold. Ours also gives the derivatives by every
parameter, resolves each orbit to 1e-11, and chooses the values; its time includes all that.
"""

import statistics
import time
import warnings

from common import emit, log
from cpg_ros.dynamics.continuation import Branch, continue_orbit
from cpg_ros.dynamics.fourier.orbit import equations, resample
from cpg_ros.dynamics.mesh.orbit import Reduced
from cpg_ros.dynamics.solve_orbit import solve_preset
from cpg_ros.networks.network import ParameterLine
from cpg_ros.networks.registry import NETWORKS, PRESETS
import numpy as np
from scipy.integrate import solve_bvp
from scipy.optimize import root

POINTS = 40
#: solve_bvp gets this many of them; it may take seconds for one.
FEWER = 10
TOLERANCE = 1e-9
#: Network, preset, line, end of the range: without folds, for the peers' sake.
BRANCHES = [('delayed', 'trot', 'tau', 5.0), ('delayed', 'walk', 'c', 20.0),
            ('quadruped', 'pace', 'gamma=delta', -5.0),
            ('biped', 'two_legged_hop', 'current', 0.1)]
TARGETS = {'ratio_median': 1.0}


def by_root(branch: Branch) -> list[float]:
    """Periods by scipy.optimize.root, NaN from where it fails on."""
    orbit, periods = branch.points[0].orbit, []
    waves, period = orbit.values.reshape(-1, orbit.values.shape[-1]), orbit.period
    for point in branch.points[1:]:
        rows, n = len(waves), point.orbit.values.shape[-1]  # nodes as ours has them
        waves = np.array([resample(wave, n) for wave in waves])
        network, mode = point.orbit.network, point.orbit.symmetry

        def residual(z, network=network, mode=mode, rows=rows):
            return equations(network, mode, z[:-1].reshape(rows, -1), z[-1])[:2]

        result = root(residual, np.append(waves, period), jac=True, tol=1e-12)
        waves, period = result.x[:-1].reshape(rows, -1), result.x[-1]
        periods.append(float(period) if result.success else np.nan)
    return periods


def by_bvp(branch: Branch) -> list[float]:
    """Periods by solve_bvp, NaN where it does not converge."""
    orbit, periods = branch.points[0].orbit, []
    m = orbit.symmetry.order
    mesh = np.linspace(0.0, 1.0, 201)
    kept = Reduced(orbit.network, orbit.symmetry).kept
    states, length = orbit(mesh * orbit.period / m)[:, kept].T, orbit.period / m
    for point in branch.points[1:FEWER + 1]:
        reduced = Reduced(point.orbit.network, orbit.symmetry)

        def rates(s, y, p, reduced=reduced):
            return p[0] * reduced.rates(y.T).T

        def jacobian(s, y, p, reduced=reduced):
            return (p[0] * reduced.linearised(y.T)[1].transpose(1, 2, 0),
                    reduced.rates(y.T).T[:, None, :])

        def ends(left, right, p, reduced=reduced):
            return np.append(right - left[reduced.permutation], reduced.rates(left)[0])

        with warnings.catch_warnings():
            warnings.simplefilter('ignore')
            found = solve_bvp(rates, ends, mesh, states, p=[length], fun_jac=jacobian,
                              tol=TOLERANCE, max_nodes=100_000)
        periods.append(m * float(found.p[0]) if found.success else np.nan)
        if found.success:
            # A mesh that only grows would be no fair one.
            states, length = found.sol(mesh), float(found.p[0])
    return periods


def main() -> None:
    rows = {}
    for name, preset, text, end in BRANCHES:
        log(f'{name} {preset} along {text}')
        orbit = solve_preset(PRESETS[name][preset])
        line = ParameterLine.parse(text, NETWORKS[name])
        value = line.value(orbit.network)
        low, high = min(value, end), max(value, end)
        # Towards the end of the range: the branch's other half has no points.
        limit, times = {'most': POINTS - 1, 'longest_step': 0.1}, []
        for _ in range(3):
            began = time.perf_counter()
            branch = continue_orbit(orbit, line, low, high, **limit)
            times.append(time.perf_counter() - began)
        if end < value:
            branch = Branch(branch.along, branch.points[::-1], (), branch.ends[::-1])
        by = by_root if name == 'delayed' else by_bvp
        began = time.perf_counter()
        periods = np.array(by(branch))
        peer = 1e3 * (time.perf_counter() - began) / periods.size
        ours = 1e3 * statistics.median(times) / (len(branch.points) - 1)
        apart = np.abs(periods / branch.periods[1:periods.size + 1] - 1.0)
        assert not branch.folds
        rows[f'{name} {preset} {text}'] = {
            'points': len(branch.points), 'value': float(branch.values[-1]), 'ours_ms': ours,
            'scipy_ms': peer, 'ratio': peer / ours, 'scipy_failed': int(np.isnan(apart).sum()),
            'period_difference': float(np.nanmax(apart)),
            'residual': max(point.orbit.residual for point in branch.points)}
    ratio = statistics.median(row['ratio'] for row in rows.values())
    emit(benchmark='continuation', ratio_median=ratio,
         ours_ms_median=statistics.median(row['ours_ms'] for row in rows.values()),
         scipy_ms_median=statistics.median(row['scipy_ms'] for row in rows.values()),
         tolerance_scipy=TOLERANCE, branches=rows, targets=TARGETS,
         passed=ratio >= TARGETS['ratio_median'])


if __name__ == '__main__':
    main()

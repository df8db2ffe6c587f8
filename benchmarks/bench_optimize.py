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

"""The search for weights: its batched simulation against scipy's solve_ivp, and whole searches.

The sets are those of a first generation for the biped's walk that oscillate in the end, each run
from the same start for the same time as in the search. solve_ivp is RK45 with rtol 1e-6 and its
usual atol, one network after the other, with the right-hand side compiled by numba, which is the
faster of the two ways to write it; the plain one in numpy is timed as well. Errors are those of
the states in the end, against DOP853 with rtol 1e-11. The step of ours is the search's own, so
its error must not be the larger one. Compilation counts for neither.
"""

import math
import os
import time

from common import by_turns, emit, log
from cpg_ros.analysis.nsga2 import optimise
from cpg_ros.analysis.objectives import search_space
from cpg_ros.dynamics.integration.simulate import Trajectory
from cpg_ros.dynamics.settling import last_cycle, population_run, SPAN, start_states, STEP_RATIO
from cpg_ros.networks.library.biped import Biped, CELLS, PARTNERS, PRIMARY
from numba import njit
import numpy as np
from scipy.integrate import solve_ivp

GAIT, SETS, ROUNDS = 'walk', 16, 3
TARGETS = {'speedup_per_network': 20.0, 'search_s': 60.0}
PLACES = np.array(list(PARTNERS.values()))
G_CA, V_CA, G_K, V_K, G_L, V_L, V1, V2, V3, V4 = (
    Biped.constants[name][0]
    for name in ('g_ca', 'v_ca', 'g_k', 'v_k', 'g_l', 'v_l', 'v1', 'v2', 'v3', 'v4'))


@njit
def rates(t, x, current, phi, weights, places):
    """Right-hand side of the biped, as one writes it for numba; weights have shape (3, 4)."""
    out = np.empty_like(x)
    for i in range(4):
        v, u = x[i], x[i + 4]
        m = 0.5 * (1.0 + math.tanh((v - V1) / V2))
        n = 0.5 * (1.0 + math.tanh((v - V3) / V4))
        tau = 0.5 * (1.0 + math.cosh((v - V3) / (2.0 * V4)))
        rate = current - G_CA * m * (v - V_CA) - G_K * u * (v - V_K) - G_L * (v - V_L)
        for k in range(3):
            rate -= weights[k, i] * (v - x[places[k, i]])
        out[i], out[i + 4] = rate, phi * tau * (n - u)
    return out


def sets() -> tuple[list[Biped], np.ndarray]:
    """Networks of a first generation that oscillate in the end, and their starts."""
    space = search_space('biped', GAIT, {}, {})
    low, high = (np.array([getattr(one, end) for one in space.free]) for end in ('low', 'high'))
    rng = np.random.default_rng(0)
    networks = [space.build(values) for values in rng.uniform(low, high, (8 * SETS, low.size))]
    starts = start_states(networks, GAIT, 0)
    runs = population_run(networks, starts)
    good = [k for k, (x, slopes) in enumerate(zip(runs.x, runs.slopes, strict=True))
            if np.isfinite(x).all() and last_cycle(Trajectory(runs.t, x, slopes), CELLS)][:SETS]
    assert len(good) == SETS, f'only {len(good)} sets oscillate'
    return [networks[k] for k in good], starts[good]


def main() -> None:
    log('compiling, and choosing sets')
    networks, starts = sets()

    def compiled(k: int, **options):
        network = networks[k]
        return solve_ivp(rates, (0.0, SPAN), starts[k], args=(
            network.current, network.phi, network.coefficients[1:, :CELLS], PLACES), **options)

    def plain(k: int):
        return solve_ivp(lambda t, x: networks[k].rates(x), (0.0, SPAN), starts[k], rtol=1e-6)

    both = compiled(0, rtol=1e-6).y[:, -1], plain(0).y[:, -1]
    assert np.allclose(*both, atol=1e-3), 'the two right-hand sides differ'
    log('reference')
    ends = np.array([compiled(k, method='DOP853', rtol=1e-11, atol=1e-12).y[:, -1]
                     for k in range(SETS)])
    ours = np.abs(population_run(networks, starts).x[:, -1] - ends).max(axis=1)
    peers = np.abs(np.array([compiled(k, rtol=1e-6).y[:, -1] for k in range(SETS)])
                   - ends).max(axis=1)
    spent = by_turns({
        'ours': (lambda: population_run(networks, starts), 5),
        'ivp': (lambda: [compiled(k, rtol=1e-6) for k in range(SETS)], 1),
        'ivp_numpy': (lambda: [plain(k) for k in range(2)], 1)}, ROUNDS)
    ours_ms, ivp_ms = ([spent[name][key] / SETS for key in ('best', 'median')]
                       for name in ('ours', 'ivp'))
    ivp_numpy_ms = [spent['ivp_numpy'][key] / 2 for key in ('best', 'median')]

    searches = {}
    for gait in PRIMARY:
        log(f'searching for the {gait}')
        began = time.perf_counter()
        front = optimise('biped', gait, progress=False)
        searches[gait] = {'seconds': time.perf_counter() - began,
                          'largest_phase_error_deg': float(front.best.errors.max()),
                          'leading_multiplier': front.best.leading}
    speedup = ivp_ms[0] / ours_ms[0]
    emit(benchmark='optimize', ours_ms_per_network=ours_ms, ivp_ms_per_network=ivp_ms,
         ivp_numpy_ms_per_network=ivp_numpy_ms, speedup_per_network=speedup,
         error_ours=[float(np.median(ours)), float(ours.max())],
         error_ivp=[float(np.median(peers)), float(peers.max())],
         step_ours=STEP_RATIO * Biped.step, span=SPAN, networks=SETS, searches=searches,
         cores=os.cpu_count(), targets=TARGETS,
         passed=(speedup >= TARGETS['speedup_per_network']
                 and bool(np.median(ours) <= np.median(peers)) and ours.max() <= peers.max()
                 and all(one['seconds'] <= TARGETS['search_s'] for one in searches.values())))


if __name__ == '__main__':
    main()

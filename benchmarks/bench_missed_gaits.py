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

"""Gaits that simulation finds and the solver does not: random sets from twelve starts each.

Simulation is the whole network without a lock, for 1500 units of model time; what it does in the
end is compared with every gait's shifts. A gait that it settles on must be found by solve_orbit,
with its period. The seed is a new one each time, unless it is given: bench_missed_gaits.py SEED.
"""

import sys
import time

from common import emit, log
from cpg_ros.dynamics.orbit import NoOrbit, solve_orbit
from cpg_ros.dynamics.periodic import added_symmetry
from cpg_ros.integration.simulate import simulate, Trajectory
from cpg_ros.networks.biped import Biped
from cpg_ros.networks.network import Network
from cpg_ros.networks.quadruped import Quadruped
from cpg_ros.search.settled_cycle import last_cycle
import numpy as np

SETS, STARTS, SPAN = 40, 12, 1500.0
#: A cycle has a shift where signals differ by less than this share of their range.
SAME = 0.01
TARGETS = {'missed': 0}


def random_sets(rng: np.random.Generator) -> list[Network]:
    """As the papers' couplings are distributed, about."""
    return [Quadruped(*rng.uniform(-0.7, 0.7, 4), *rng.uniform(-0.2, 0.2, 2))
            for _ in range(SETS)] + [
        Biped.symmetric(rng.uniform(0.2, 0.32), rng.uniform(0.15, 0.4), *rng.uniform(-1, 1, 3))
        for _ in range(SETS)]


def settles_on(network: Network, rng: np.random.Generator) -> dict[str, float]:
    """Gaits that the network does in the end, and their periods."""
    low, high = (-0.6, 0.9) if network.name == 'quadruped' else (-0.4, 0.5)
    starts = rng.uniform(low, high, (STARTS, network.components))
    run = simulate(network, starts, SPAN, 2.0 * network.step, every=5, progress=False)
    found = {}
    for x, slopes in zip(run.x, run.slopes, strict=True):
        if not np.isfinite(x).all():
            continue
        cycle = last_cycle(Trajectory(run.t, x, slopes), network.cells)
        if cycle is None:
            continue
        signals = cycle.signals[:, :network.cells]
        later = np.ptp(run.x[:, -int(3 * cycle.period / run.t[1]):, 0])
        for gait in network.gaits():
            symmetry = network.symmetry(gait)
            gaps = [np.abs(signals[:, list(symmetry.group.elements[name])] - np.roll(
                signals, -round(float(shift) * len(signals)), axis=0)).max()
                for name, shift in symmetry.shifts]
            if (later > 0.05 and max(gaps) < SAME * np.ptp(signals)
                    and not added_symmetry(symmetry, signals, SAME)):
                found[gait] = cycle.period
    return found


def main() -> None:
    seed = int(sys.argv[1]) if len(sys.argv) > 1 else int(np.random.SeedSequence().entropy % 10**9)
    rng = np.random.default_rng(seed)
    missed, seen, spent = [], 0, 0.0
    for count, network in enumerate(random_sets(rng)):
        for gait, period in settles_on(network, rng).items():
            seen += 1
            began = time.process_time()
            try:
                orbit = solve_orbit(network, gait)
                reason = ('' if abs(orbit.period / period - 1.0) < 1e-2
                          else f'period {orbit.period:.4f}')
            except NoOrbit as error:
                reason = str(error)[:60]
            spent += time.process_time() - began
            if reason:
                missed.append({'network': network.name, 'gait': gait, 'period': period,
                               'params': network.as_dict(), 'reason': reason})
                log(f'missed: {missed[-1]}')
        if count % 10 == 9:
            log(f'{count + 1} sets, {seen} gaits')
    emit(benchmark='missed_gaits', seed=seed, sets=2 * SETS, gaits=seen,
         missed=sum(not one['reason'].startswith('period') for one in missed),
         other_orbits=sum(one['reason'].startswith('period') for one in missed),
         solve_cpu_s_mean=spent / max(seen, 1), misses=missed, targets=TARGETS,
         passed=not any(not one['reason'].startswith('period') for one in missed))


if __name__ == '__main__':
    main()

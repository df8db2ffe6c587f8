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
end is compared with every gait's shifts. A gait that it settles on must be among the ones of
coexisting_orbits, with its period, and be stable. The seed is a new one each time, unless it is
given.
"""

import argparse
import time

from common import emit, log
from cpg_ros.dynamics.coexisting_orbits import coexisting_orbits
from cpg_ros.dynamics.floquet import multipliers
from cpg_ros.dynamics.orbit import NoOrbit
from cpg_ros.dynamics.periodic import added_symmetry
from cpg_ros.integration.simulate import simulate, Trajectory
from cpg_ros.networks.biped import Biped
from cpg_ros.networks.network import Network
from cpg_ros.networks.quadruped import Quadruped
from cpg_ros.search.settled_cycle import last_cycle
import numpy as np

SETS, STARTS, SPAN = 40, 12, 1500.0
#: From where to where the states are that a run starts from.
STATES = {'quadruped': (-0.6, 0.9), 'biped': (-0.4, 0.5)}
#: A cycle has a shift where signals differ by less than this share of their range.
SAME = 0.01
TARGETS = {'missed': 0, 'other_orbits': 0}


def random_set(name: str, rng: np.random.Generator) -> Network:
    """As the papers' couplings are distributed, about."""
    if name == 'quadruped':
        return Quadruped(*rng.uniform(-0.7, 0.7, 4), *rng.uniform(-0.2, 0.2, 2))
    return Biped.symmetric(rng.uniform(0.2, 0.32), rng.uniform(0.15, 0.4), *rng.uniform(-1, 1, 3))


def settles_on(network: Network, rng: np.random.Generator) -> dict[str, float]:
    """Gaits that the network does in the end, and their periods."""
    starts = rng.uniform(*STATES[network.name], (STARTS, network.components))
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
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--seed', type=int,
                        default=int(np.random.SeedSequence().entropy % 10**9))
    parser.add_argument('--sets', type=int, default=SETS, help='of each network')
    parser.add_argument('--networks', nargs='+', choices=list(STATES), default=list(STATES))
    chosen = parser.parse_args()
    seed, rng = chosen.seed, np.random.default_rng(chosen.seed)
    sets = [random_set(name, rng) for name in chosen.networks for _ in range(chosen.sets)]
    missed, seen, spent = [], 0, 0.0
    for count, network in enumerate(sets):
        for gait, period in settles_on(network, rng).items():
            seen += 1
            began = time.process_time()
            try:
                orbits = coexisting_orbits(network, gait, everything=False).orbits
                ours = [one for one in orbits if abs(one.period / period - 1.0) < 1e-2]
                reason = ('' if any(multipliers(one).attracts for one in ours) else
                          'not stable' if ours else f'period {orbits[0].period:.4f}')
            except NoOrbit as error:
                reason = str(error)[:60]
            spent += time.process_time() - began
            if reason:
                missed.append({'network': network.name, 'gait': gait, 'period': period,
                               'params': network.as_dict(), 'reason': reason})
                log(f'missed: {missed[-1]}')
        if count % 10 == 9:
            log(f'{count + 1} sets, {seen} gaits')
    emit(benchmark='missed_gaits', seed=seed, sets=len(sets), gaits=seen,
         missed=sum(not one['reason'].startswith('period') for one in missed),
         other_orbits=sum(one['reason'].startswith('period') for one in missed),
         solve_cpu_s_mean=spent / max(seen, 1), misses=missed, targets=TARGETS,
         passed=seen > 0 and not missed)


if __name__ == '__main__':
    main()

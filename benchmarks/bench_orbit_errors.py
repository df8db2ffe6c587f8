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

"""Residual and error of orbits, as the package states them, beside those from a finer mesh.

Random sets about all presets of all networks: parameters differ from the preset's by up to a
fifth. The residual is compared with that at 16 times as many places. The error is that of the
states over their ranges, or of the period, against a solution on a mesh four times as fine; the
package estimates it by one twice as fine. What both put below the floor of rounding is counted as
equal.
"""

import argparse
import time

from common import emit, log
from cpg_ros.dynamics.arclength import NoOrbit
from cpg_ros.dynamics.orbit import Orbit
from cpg_ros.dynamics.solve_orbit import solve_orbit, solve_preset
from cpg_ros.networks.network import Network
from cpg_ros.networks.registry import PRESETS
import numpy as np

#: Orbits; largest relative change of a parameter; factor between what is compared.
ORBITS, CHANGE, FACTOR = 200, 0.2, 10.0
#: Rounding errors: of states over their ranges; of rates over the largest.
FLOOR, RATES = 1e-13, 1e-14
#: Places between two of those where the package computes the residual.
DENSER = 16
TARGETS = {'beyond': 0}


def drawn(network: Network, rng: np.random.Generator) -> Network:
    """Return a network with each parameter, or group of weights, scaled."""
    members = {name for group in network.groups.values() for name in group}
    values = network.as_dict()
    changes: dict[str, float] = {}
    for name in (*network.groups, *(name for name in values if name not in members)):
        factor = rng.uniform(1.0 - CHANGE, 1.0 + CHANGE)
        if name not in network.offsets.values():
            changes |= {one: factor * values[one] for one in network.members(name)}
    return network.replace(**changes)


def residual(orbit: Orbit) -> float:
    """Largest residual at many places."""
    ends = np.sort(orbit.between)
    times = (ends[:-1, None] + np.diff(ends)[:, None] * np.arange(DENSER) / DENSER).ravel()
    states, past = orbit(times), orbit(times - orbit.network.delay)
    return float(np.abs(orbit.derivative(times) - orbit.network.rates(states, past)).max())


def error(orbit: Orbit) -> float:
    """Largest difference to a solution on a mesh four times as fine."""
    exact = orbit.refined().refined()
    theta = np.arange(4001) / 4001
    states, found = exact(theta * exact.period), orbit(theta * orbit.period)
    sizes = np.ptp(states, axis=0).reshape(orbit.network.variables, -1).max(axis=1)
    # The rate of an amplitude that is constant has no range.
    sizes = np.maximum(sizes, 1e-4 * np.abs(states).max())
    gap = (np.abs(states - found).max(axis=0) / sizes.repeat(orbit.network.cells)).max()
    return float(max(gap, abs(exact.period / orbit.period - 1.0)))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--seed', type=int,
                        default=int(np.random.SeedSequence().entropy % 10**9))
    parser.add_argument('--orbits', type=int, default=ORBITS)
    args = parser.parse_args()
    rng = np.random.default_rng(args.seed)
    presets = [preset for family in PRESETS.values() for preset in family.values()]
    ratios: dict[str, list[float]] = {'residual': [], 'error': []}
    beyond, floor, worst, none, spent = [], 0, 0.0, 0, 0.0
    while len(ratios['error']) < args.orbits:
        preset = presets[rng.integers(len(presets))]
        network = drawn(preset.network, rng)
        try:
            orbit = solve_orbit(network, preset.gait, solve_preset(preset))
        except NoOrbit:
            none += 1
            continue
        size = float(np.abs(network.rates(orbit(orbit.between))).max())
        began = time.process_time()
        stated = orbit.error
        spent += time.process_time() - began
        for name, values, least in (('residual', (orbit.residual, residual(orbit)), RATES * size),
                                    ('error', (stated, error(orbit)), FLOOR)):
            ratio = np.divide(*np.maximum(values, least))
            floor += max(values) <= least
            ratios[name].append(float(ratio))
            if not 1.0 / FACTOR <= ratio <= FACTOR:
                beyond.append({'of': name, 'network': network.name, 'gait': preset.gait,
                               'stated': values[0], 'found': values[1]})
                log(f'beyond: {beyond[-1]}')
        worst = max(worst, stated)
    emit(benchmark='orbit_errors', seed=args.seed, orbits=len(ratios['error']), no_orbit=none,
         beyond=len(beyond), at_the_floor=floor, largest_error=worst,
         **{f'{name}_ratio_{word}': pick(values) for name, values in ratios.items()
            for word, pick in (('least', min), ('median', np.median), ('most', max))},
         estimate_cpu_s_mean=spent / len(ratios['error']), cases=beyond, targets=TARGETS,
         passed=not beyond)


if __name__ == '__main__':
    main()

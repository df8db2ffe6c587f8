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

"""Gaits that simulation finds and the solver does not: random sets from twenty starts each.

Six networks, of which the delayed one has delays up to 5, and six of one's own (own_networks),
among them relaxation oscillators and one with unlike cells.
Simulation is of the whole network, held in the gait's class by a symmetry lock; what it does in
the end is compared with the gait's shifts. A gait that it settles on must be among the ones of
coexisting_orbits, with its period, and attract in its class. Where it is neutral in its class, a
few of the starts end beside it, within what counts as the gait: these are counted by themselves.
So are cycles that are the gait's no more if a simulation goes on (they settled slowly), and second
orbits that attract beside the one that was found, if --all-orbits finds them.
The seed is a new one each time, unless it is given.
"""

import argparse
from collections.abc import Iterator
import time

from common import emit, log
from cpg_ros.dynamics.arclength import NoOrbit
from cpg_ros.dynamics.floquet import MAX_STABLE_MODULUS, multipliers_within
from cpg_ros.dynamics.integration.simulate import simulate, Trajectory
from cpg_ros.dynamics.orbit import check_values, signal_symmetry
from cpg_ros.dynamics.settling import last_cycle
from cpg_ros.dynamics.solve_orbit import coexisting_orbits
from cpg_ros.networks.library.biped import Biped
from cpg_ros.networks.library.delayed import Delayed
from cpg_ros.networks.library.quadruped import Quadruped
from cpg_ros.networks.network import Network
from cpg_ros.networks.registry import PRESETS
from cpg_ros.networks.symmetry import Symmetry
import numpy as np
from own_networks import (
    Brusselators,
    FhnRing,
    half_centre,
    UnlikePairs,
    VanDerPol,
    WilsonCowan,
)

SETS, STARTS = 40, 20
#: A cycle has a shift where signals differ by less than this fraction of their range.
SAME = 0.01
#: What differs by less than this from more symmetry comes to have it: it settles slowly.
RICHER = 0.03
#: A simulation has so many of the cycles that it settles in, or what returns may be a torus.
CYCLES = 12
#: What has no orbit is simulated so many times as long again.
LONGER = 8
#: Below this range of the first variable it rests; gain of the lock, 1/model time.
MOVES, HOLD = 0.05, 1.0
#: So near to 1 a multiplier within the class is neutral.
NEUTRAL = 1e-6
#: So many cycles have to repeat those before, but for this share of their RMS; looked at points.
REPEATS, UNLIKE, POINTS = 4.0, 0.3, 2000
#: By what fraction its size may change over three cycles, or it still dies away.
STEADY = 2e-3
TARGETS = {'missed': 0, 'other_orbits': 0}


def varied(network: str, rng: np.random.Generator, **ranges: tuple[float, float]) -> Network:
    """Return a random preset's network with some parameters drawn anew."""
    presets = list(PRESETS[network].values())
    return presets[rng.integers(len(presets))].network.replace(
        **{name: rng.uniform(*span) for name, span in ranges.items()})


def quadruped(rng: np.random.Generator) -> Network:
    """As the paper's couplings are distributed, about."""
    return Quadruped(*rng.uniform(-0.7, 0.7, 4), *rng.uniform(-0.2, 0.2, 2))


def biped(rng: np.random.Generator) -> Network:
    """As the paper's couplings are distributed, about."""
    return Biped.symmetric(rng.uniform(0.2, 0.32), rng.uniform(0.15, 0.4), *rng.uniform(-1, 1, 3))


def delayed(rng: np.random.Generator) -> Network:
    """About example 1 of the paper, with delays up to 5."""
    return Delayed(rng.uniform(-5.5, -3.5), rng.uniform(0.5, 1.5), rng.uniform(5.0, 8.0),
                   rng.uniform(-3.0, 3.0), rng.uniform(0.2, 5.0))


def fhn_ring(rng: np.random.Generator) -> Network:
    """About where the cells oscillate by themselves."""
    return FhnRing(rng.uniform(0.2, 1.0), rng.uniform(-0.4, 0.4), rng.uniform(0.05, 0.15))


def wilson_cowan(rng: np.random.Generator) -> Network:
    """About where one half-centre oscillates by itself."""
    return WilsonCowan(p=rng.uniform(-1.0, 3.0), q=rng.uniform(-5.0, -1.0),
                       k=rng.uniform(-3.0, 3.0), tau=rng.uniform(0.5, 2.0))


def hodgkin_huxley(rng: np.random.Generator) -> Network:
    """Excitatory and inhibitory synapses."""
    return half_centre()(rng.uniform(10.0, 60.0), rng.uniform(0.05, 1.5),
                         float(rng.choice([-75.0, 0.0])))


def van_der_pol(rng: np.random.Generator) -> Network:
    """Relaxation oscillators."""
    return VanDerPol(rng.uniform(0.5, 8.0), rng.uniform(-0.4, 0.4))


def unlike_pairs(rng: np.random.Generator) -> Network:
    """Extensors that are slower or faster than flexors."""
    return UnlikePairs(rng.uniform(-0.4, 0.4), rng.uniform(0.3, 1.0), rng.uniform(-0.4, 0.4),
                       *rng.uniform(0.05, 0.15, 2))


def brusselators(rng: np.random.Generator) -> Network:
    """About where each oscillates by itself."""
    return Brusselators(rng.uniform(-0.5, 0.5), 1.0, rng.uniform(1.8, 3.5))


#: How a network is drawn, from where to where the states of its variables start, and how long it
#: is simulated for, in model time.
NETWORKS = {
    'delayed': (delayed, [(-1.0, 1.0)], 400.0),
    'quadruped': (quadruped, [(-0.6, 0.9)] * 2, 1500.0),
    'biped': (biped, [(-0.4, 0.5)] * 2, 1500.0),
    'phase': (lambda rng: varied('phase', rng, w=(0.5, 2.0), a=(10.0, 30.0), nu=(0.5, 2.0)),
              [(-1.0, 1.0)] * 3, 60.0),
    'hopf': (lambda rng: varied('hopf', rng, mu=(0.5, 2.0), b=(5.0, 30.0), duty=(0.4, 0.75)),
             [(-1.0, 1.0)] * 2, 60.0),
    'matsuoka': (lambda rng: varied('matsuoka', rng, beta=(2.0, 3.5), a=(1.6, 2.4), c=(0.5, 2.0)),
                 [(-0.5, 1.0)] * 2, 120.0),
    'fhn_ring': (fhn_ring, [(-2.0, 2.0), (-0.5, 1.5)], 2000.0),
    'wilson_cowan': (wilson_cowan, [(0.0, 1.0)] * 2, 600.0),
    'half_centre': (hodgkin_huxley, [(-75.0, -30.0), *[(0.0, 1.0)] * 4], 1500.0),
    'van_der_pol': (van_der_pol, [(-2.0, 2.0)] * 2, 800.0),
    'unlike_pairs': (unlike_pairs, [(-2.0, 2.0), (-0.5, 1.5)], 2000.0),
    'brusselators': (brusselators, [(0.0, 3.0)] * 2, 600.0)}


def turned(signals: np.ndarray, shift: float) -> np.ndarray:
    """Return signals, on even points of a cycle, by a fraction of it later."""
    return np.roll(signals, -round(float(shift) * len(signals)), axis=0)


def period_of(network: Network, symmetry: Symmetry, run: Trajectory) -> float | None:
    """Return the period of what a simulation does in the end, None unless it is the gait."""
    cycle = last_cycle(run, network.cells) if np.isfinite(run.x).all() else None
    if cycle is None or CYCLES * cycle.period > run.t[-1]:
        return None
    three = int(3 * cycle.period / run.t[1])
    sizes = [np.ptp(some) for some in (run.x[-2 * three:-three, 0], run.x[-three:, 0])]
    if sizes[1] < MOVES or abs(sizes[1] / sizes[0] - 1.0) > STEADY:
        return None
    # Of spikes at uneven distances the last two may be as far apart as those before.
    before = run(run.t[-1] - np.linspace(0.0, REPEATS, POINTS) * cycle.period)[:, 0]
    later = run(run.t[-1] - np.linspace(1.0, REPEATS + 1.0, POINTS) * cycle.period)[:, 0]
    if np.std(before - later) > UNLIKE * np.std(before):
        return None
    signals = cycle.signals[:, :network.cells]
    if symmetry.group.elements.keys() > {'1'}:
        pairs = [(signals[:, list(symmetry.group.elements[element])], turned(signals, shift))
                 for element, shift in symmetry.shifts]
    else:
        # Of phase oscillators, whose cells are alike but for their phases.
        pairs = [(signals[:, cell], turned(signals[:, 0], phase))
                 for cell, phase in enumerate(symmetry.phases)]
    if symmetry.odd:
        pairs.append((signals, -turned(signals, 0.5)))
    gap = max(np.abs(one - other).max() for one, other in pairs)
    if gap > SAME * np.ptp(signals) or signal_symmetry(symmetry, signals, RICHER):
        return None
    return cycle.period


def settled(network: Network, gait: str, starts: np.ndarray, span: float) -> list[float]:
    """Periods from each start that settles in the gait in so much model time."""
    symmetry = network.symmetry(gait)
    run = simulate(network, starts, span, network.step, lock=(HOLD, symmetry), every=5,
                   progress=False)
    return [period for x, slopes in zip(run.x, run.slopes, strict=True)
            if (period := period_of(network, symmetry, Trajectory(run.t, x, slopes)))]


def starts_of(name: str, network: Network, rng: np.random.Generator
              ) -> Iterator[tuple[str, np.ndarray]]:
    """Yield the gaits that the network's weights allow, and random states in their classes."""
    states = NETWORKS[name][1]
    low, high = np.repeat(np.array(states * (network.variables // len(states))).T, network.cells,
                          axis=1)
    for gait in network.gaits():
        basis = network.symmetry(gait).basis
        try:
            check_values(network, gait)
        except NoOrbit:
            # Its weights lack the symmetry: the lock would make the gait.
            continue
        yield gait, rng.uniform(low, high, (STARTS, network.components)) @ basis.T @ basis


def judged(network: Network, gait: str, periods: list[float], everything: bool = False
           ) -> tuple[str, float, bool]:
    """What is wrong with the solver's answer, '' if nothing; for which period; is it neutral."""
    try:
        orbits = coexisting_orbits(network, gait, everything=everything).orbits
    except NoOrbit as error:
        return str(error)[:60], periods[0], False
    growth = [multipliers_within(one).leading for one in orbits]
    attracting = [one.period for one, largest in zip(orbits, growth, strict=True)
                  if largest < 1.0 + NEUTRAL]
    neutral = any(MAX_STABLE_MODULUS <= largest < 1.0 + NEUTRAL for largest in growth)
    lost = [period for period in periods
            if not any(abs(one / period - 1.0) < 1e-2 for one in attracting)]
    if not lost:
        return '', periods[0], neutral
    known = any(abs(one.period / lost[0] - 1.0) < 1e-2 for one in orbits)
    return 'not stable' if known else f'period {orbits[0].period:.4f}', lost[0], neutral


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--seed', type=int,
                        default=int(np.random.SeedSequence().entropy % 10**9))
    parser.add_argument('--sets', type=int, default=SETS, help='of each network')
    parser.add_argument('--quick', action='store_true', help='one set of each network')
    parser.add_argument('--networks', nargs='+', choices=list(NETWORKS),
                        default=list(NETWORKS))
    args = parser.parse_args()
    seed, rng = args.seed, np.random.default_rng(args.seed)
    sets = [(name, NETWORKS[name][0](rng)) for name in args.networks
            for _ in range(1 if args.quick else args.sets)]
    missed, seen, neutral, slow, second, spent = [], 0, 0, 0, 0, 0.0
    for count, (name, network) in enumerate(sets):
        span = NETWORKS[name][2]
        for gait, starts in starts_of(name, network, rng):
            if not (periods := settled(network, gait, starts, span)):
                continue
            began = time.process_time()
            reason, period, between = judged(network, gait, periods)
            spent += time.process_time() - began
            if reason:
                # It may still be on its way to something else.
                if not (periods := settled(network, gait, starts, LONGER * span)):
                    slow += 1
                    continue
                reason, period, between = judged(network, gait, periods)
            if reason.startswith('period'):
                # One that attracts has been found, and is what is asked for without --all-orbits.
                reason, period, between = judged(network, gait, periods, everything=True)
                second += not reason
            seen += 1
            neutral += between
            if reason:
                missed.append({'network': network.name, 'gait': gait, 'period': period,
                               'params': network.as_dict(), 'reason': reason})
                log(f'missed: {missed[-1]}')
        if count % 10 == 9:
            log(f'{count + 1} sets, {seen} gaits')
    emit(benchmark='missed_gaits', seed=seed, networks=args.networks, sets=len(sets), gaits=seen,
         neutral=neutral, slow=slow, second_orbits=second,
         missed=sum(not one['reason'].startswith('period') for one in missed),
         other_orbits=sum(one['reason'].startswith('period') for one in missed),
         solve_cpu_s_mean=spent / max(seen, 1), misses=missed, targets=TARGETS,
         passed=seen > 0 and not missed)


if __name__ == '__main__':
    main()

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

"""The simulated Go2 with feedback and, in the same run, without it: pushes, rough ground, slopes.

At 0.4 m/s where a gait can be steered. Pushes of 0.1 s come from 12 directions at 8 phases of the
stride. Open and closed meet the same; the seed is fresh, and printed.
"""

import argparse
from concurrent.futures import ProcessPoolExecutor
import os
import secrets
import sys
import time
from typing import Any

from common import emit, log, ROOT
from cpg_ros.simulation.scenario import Noise
from feedback_figures import (
    flat,
    GAITS,
    ground,
    pushes,
    sideways,
    slopes,
    subject,
    switches,
    wander,
)
from tqdm import tqdm

ROBOT = ROOT / 'config' / 'unitree_go2.yaml'
OPEN, CLOSED = (12.0, 16.0, 20.0, 24.0), (24.0, 30.0, 34.0, 38.0, 42.0)
#: Force sensors 10 % wrong with 5 % noise, 0.5 degrees of IMU bias, 0.02 rad/s on the gyro.
DULL = {'delay': 0.01, 'force_bias': 0.1, 'force_noise': 0.05, 'lean_bias': 0.00873,
        'turning_noise': 0.02}


def measure(job: tuple[str, str, bool, int, bool]) -> tuple[tuple[str, str, bool], Any]:
    """Measure one figure of one gait, in a process of its own."""
    gait, figure, closed, seed, quick = job
    began, network = time.perf_counter(), 'quadruped' if figure == 'quadruped' else 'delayed'
    others = [name for name in GAITS if name != gait] if figure == 'switches' else []
    one = subject(ROBOT, gait, closed, seed, quick, network, others)
    impulses = CLOSED if closed else OPEN
    if figure in ('pushes', 'noisy', 'quadruped'):
        if figure == 'noisy':
            one.noise = Noise(**DULL, seed=seed)
        if figure == 'quadruped':
            impulses = (24.0, 28.0, 32.0, 36.0) if closed else OPEN
        if gait in ('pace', 'bound'):
            impulses = (4.0, 8.0, 12.0, *OPEN[1:], *CLOSED[1:])[:None if closed else 6]
        found: Any = pushes(one, impulses[::2] if quick else impulses)
    else:
        found = {'ground': ground, 'slopes': slopes, 'flat': flat, 'switches': switches,
                 'wander': wander, 'sideways': sideways}[figure](one)
    log(f'{gait}, {figure}, {"closed" if closed else "open"}: {found} '
        f'({time.perf_counter() - began:.0f} s)')
    return (gait, figure, closed), found


def jobs(quick: bool) -> list[tuple[str, str, bool]]:
    """Return what is to be measured, long jobs first."""
    ways = (True, False)
    return ([(gait, figure, closed) for closed in ways for gait in ('trot', 'walk')
             for figure in ('ground', 'pushes')]
            + [(gait, 'switches', closed) for gait in GAITS[::3 if quick else 1]
               for closed in ways]
            + [('trot', 'noisy', True), ('trot', 'wander', True), ('trot', 'wander', False)]
            + [('trot', 'quadruped', closed) for closed in ways]
            + [(gait, 'pushes', closed) for gait in ('pace', 'bound') for closed in ways]
            + [(gait, figure, closed) for gait in ('trot', 'walk') for figure in ('flat', 'slopes')
               for closed in ways] + [('trot', 'sideways', True)])


def verdicts(found: dict[str, dict[str, dict[str, Any]]]) -> dict[str, bool]:
    """Hold figures against what the feedback is to reach."""
    met = {}
    for gait, cost in (('trot', 1.03), ('walk', 1.08)):
        closed, opened = found[gait]['closed'], found[gait]['open']
        crossed, plane, before = closed['ground'], closed['flat'], opened['flat']
        met |= {f'{gait} {name}': bool(good) for name, good in {
            'pushes': closed['pushes']['half_survive_N_s'] >= 34.0,
            'height field 6 cm': crossed['height_field_6_cm'] >= 0.98,
            'height field 8 cm': crossed['height_field_8_cm'] >= 0.90,
            'boxes': crossed['boxes_5_cm'] >= 0.80,
            'slopes': all(closed['slopes'][f'{way}_upright'] == 1.0
                          for way in ('up', 'down', 'across')),
            'cost': plane['cost_of_transport'] <= cost * before['cost_of_transport'],
            'speed': all(abs(plane[f'speed_at_{v}'] / v - 1.0) <= 0.03 for v in (0.2, 0.4)),
            'line': plane['off_line_m'] <= 0.5,
            'settling': plane['settling_s'] <= 1.3 * before['settling_s'],
            'friction 0.3': plane['friction_0.3_m'] >= before['friction_0.3_m']}.items()}
    trot = found['trot']['closed']
    met['trot at 24 N s'] = trot['pushes']['survived'].get('24', 0.0) >= 0.95
    met['trot uphill'] = trot['slopes']['uphill_m'] >= 2.0
    met['trot with noise and delay'] = trot['noisy']['half_survive_N_s'] >= 34.0
    met['quadruped'] = trot['quadruped']['half_survive_N_s'] >= 28.0
    met['wander'] = trot['wander']['falls'] == 0
    met['switches'] = not any(sum(one['closed']['switches'].values()) for one in found.values()
                              if 'switches' in one['closed'])
    for gait in ('pace', 'bound'):
        met[f'{gait} pushes'] = (found[gait]['closed']['pushes']['half_survive_N_s']
                                 >= found[gait]['open']['pushes']['half_survive_N_s'])
    return met


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--quick', action='store_true', help='few runs: a look, no verdict')
    parser.add_argument('--only', nargs='+', metavar='FIGURE', help='such as pushes ground')
    parser.add_argument('--gaits', nargs='+', metavar='GAIT', help='only these')
    parser.add_argument('--seed', type=int, default=None, help='a fresh one if not given')
    parser.add_argument('--processes', type=int, default=len(os.sched_getaffinity(0)))
    arguments = parser.parse_args()
    seed = secrets.randbelow(2**31) if arguments.seed is None else arguments.seed
    log(f'seed {seed}')
    chosen = [job for job in jobs(arguments.quick)
              if job[1] in (arguments.only or [job[1]])
              and job[0] in (arguments.gaits or [job[0]])]
    began, found = time.perf_counter(), {}
    with ProcessPoolExecutor(arguments.processes) as pool:
        waiting = [(*job, seed, arguments.quick) for job in chosen]
        for (gait, figure, closed), one in tqdm(pool.map(measure, waiting), total=len(waiting),
                                                unit='figure', disable=None):
            ways = found.setdefault(gait, {'open': {}, 'closed': {}})
            ways['closed' if closed else 'open'][figure] = one
    whole = not (arguments.only or arguments.gaits)
    met = verdicts(found) if whole else {}
    emit(benchmark='feedback', seed=seed, quick=arguments.quick,
         minutes=(time.perf_counter() - began) / 60.0, gaits=found, met=met)
    return 0 if arguments.quick or all(met.values()) else 1


if __name__ == '__main__':
    sys.exit(main())

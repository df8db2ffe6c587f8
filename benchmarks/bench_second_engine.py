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

"""The Go2's gaits with feedback in MuJoCo and in Bullet: speeds, drift, tilt, cost, pushes.

Gaits, efference copies and gains are those of the robot file, which were found in MuJoCo; commands
and pushes are the same in all rows. Bullet needs ``pip install pybullet``.
"""

import argparse
from collections.abc import Callable
from importlib.util import find_spec
import math
import secrets
import time
from typing import Any

from common import emit, log, ROOT
from cpg_ros.feedback.gains import robot_gains
from cpg_ros.motion.robot_file import read_robot
from cpg_ros.simulation.closed_loop import ClosedLoopBatch
from cpg_ros.simulation.scenario import impulse, Scenario
from feedback_figures import AFTER, interval, subject
import numpy as np

GO2 = ROOT / 'config' / 'unitree_go2.yaml'
#: Of a usual floor; time of a steady walk, s, and its first part that is ignored, s.
FRICTION, WALK, BEGINNING = 0.8, 12.0, 6.0
#: Time of the pushes, s.
PUSHED = 2.5
SPEEDS = {'trot': (0.2, 0.4, 0.6), 'walk': (0.2, 0.4, 0.6), 'run': (1.0, 1.5, 2.0)}
#: Time constant of hard contacts in MuJoCo, s; as shipped they have 0.02.
HARD = 0.005
#: A foot's stiffness, N/m, and damping, N s/m, in Bullet where it is soft.
SOFT = {'contactStiffness': 1e4, 'contactDamping': 300.0}


def stiffen(loop: ClosedLoopBatch) -> None:
    """Make the contacts of MuJoCo hard."""
    loop.body.model.geom_solref[:, 0] = HARD


def in_bullet(rotors: str, **contact: float) -> Callable[[ClosedLoopBatch], None]:
    """Return what moves a loop's bodies to Bullet, as of `bullet.put_in_bullet`."""
    from bullet import put_in_bullet
    return lambda loop: put_in_bullet(loop, rotors, **contact)


#: What moves the bodies, by what a row is called.
ENGINES: dict[str, Callable[[], Callable[[ClosedLoopBatch], None]]] = {
    'MuJoCo': lambda: lambda loop: None,
    'MuJoCo, hard contacts': lambda: stiffen,
    'Bullet': lambda: in_bullet('own'),
    'Bullet, soft feet': lambda: in_bullet('own', **SOFT),
    'Bullet, rotors in the links that they move': lambda: in_bullet('link'),
    'Bullet, motors without rotors': lambda: in_bullet('none')}


def measure(gait: str, engine: str, args: argparse.Namespace) -> dict[str, Any]:
    """Return the figures of a gait in an engine."""
    one = subject(GO2, gait, robot_gains(read_robot(GO2)), args.seed, False)
    ENGINES[engine]()(one.loop)
    ran = one.run([Scenario(args.friction, speed=speed) for speed in SPEEDS[gait]], WALK)
    late = slice(round(BEGINNING / one.loop.timestep), None)
    found: dict[str, Any] = {
        'asked, m/s': SPEEDS[gait],
        'upright': ran.upright.tolist(),
        'speed, m/s': ran.velocity[:, late, 0].mean(axis=1).tolist(),
        'estimated, m/s': ran.estimated[:, late, 0].mean(axis=1).tolist(),
        'off the line, m': ran.place[:, -1, 1].tolist(),
        'tilt, degrees': np.degrees(np.abs(ran.rpy[:, late, :2]).max(axis=(1, 2))).tolist(),
        'cost of transport': ran.cost.tolist()}
    draws = np.random.default_rng([args.seed, 1])
    for size in args.impulses:
        first = draws.uniform(0.0, 2.0 * math.pi)
        runs = [Scenario(args.friction, speed=SPEEDS[gait][1], phase=draws.uniform(), pushes=(
            impulse(PUSHED, size * math.cos(way), size * math.sin(way)),))
            for way in first + 2.0 * math.pi * np.arange(args.pushes) / args.pushes]
        share = float(one.run(runs, PUSHED + AFTER).upright.mean())
        found[f'{size:g} N s'] = share
        found[f'{size:g} N s, 95 %'] = interval(share, args.pushes)
    return found


def lines(gait: str, rows: dict[str, dict[str, Any]], sizes: list[float]) -> list[str]:
    """Return the rows of a gait in Markdown."""
    def several(values: list[float], digits: int) -> str:
        return ', '.join(f'{value:.{digits}f}' for value in values)
    return [f'| {gait} | {engine} | ' + ' | '.join(
        (several(one['speed, m/s'], 2), several(one['off the line, m'], 2),
         several(one['tilt, degrees'], 0), several(one['cost of transport'], 2),
         *(f'{100.0 * one[f"{size:g} N s"]:.0f} ('
           + ' to '.join(f'{100.0 * end:.0f}' for end in one[f'{size:g} N s, 95 %']) + ')'
           for size in sizes))) + ' |' for engine, one in rows.items()]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--gaits', nargs='+', default=['trot', 'walk'], choices=list(SPEEDS))
    parser.add_argument('--engines', nargs='+', default=list(ENGINES), choices=list(ENGINES),
                        metavar='ENGINE', help='; '.join(ENGINES))
    parser.add_argument('--impulses', type=float, nargs='*', default=[40.0], metavar='NS',
                        help='of the pushes, N s (default: 40)')
    parser.add_argument('--pushes', type=int, default=12,
                        help='of one size (default: %(default)s)')
    parser.add_argument('--friction', type=float, default=FRICTION, help='(default: %(default)s)')
    parser.add_argument('--seed', type=int, default=None, help='a fresh one if not given')
    args = parser.parse_args()
    args.seed = secrets.randbelow(2**31) if args.seed is None else args.seed
    if any('Bullet' in engine for engine in args.engines) and not find_spec('pybullet'):
        parser.error('rows in Bullet need it: pip install pybullet, or --engines MuJoCo')
    log(f'seed {args.seed}')
    found: dict[str, dict[str, Any]] = {}
    for gait in args.gaits:
        rows = found[gait] = {}
        for engine in args.engines:
            began = time.perf_counter()
            rows[engine] = measure(gait, engine, args)
            log('\n'.join(lines(gait, {engine: rows[engine]}, args.impulses))
                + f' ({time.perf_counter() - began:.0f} s)')
    emit(benchmark='second_engine', seed=args.seed, friction=args.friction, gaits=found)
    return 0


if __name__ == '__main__':
    raise SystemExit(main())

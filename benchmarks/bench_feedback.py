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

"""A simulated robot with feedback and, in the same run, without it: pushes, rough ground, slopes.

At 0.4 m/s where a gait can be steered. Pushes of 0.1 s come from 12 directions at 8 phases of the
stride. Open and closed meet the same; the seed is fresh, and printed. Of a robot other than the
Go2, ``--robot my_robot.yaml --model mini_cheetah`` measures the pushes that its gaits survive.
"""

import argparse
from concurrent.futures import ProcessPoolExecutor
import itertools
import os
from pathlib import Path
import secrets
import sys
import time
from typing import Any, NamedTuple

from common import emit, log, ROOT
from cpg_ros.common.command_line import progress_bar
from cpg_ros.common.errors import CpgError
from cpg_ros.feedback.gains import Gains, robot_gains
from cpg_ros.feedback.kinematics import GRAVITY
from cpg_ros.motion.robot import Robot
from cpg_ros.motion.robot_file import read_robot
from cpg_ros.simulation.scenario import SensorNoise
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

ROBOT, MODEL = ROOT / 'config' / 'unitree_go2.yaml', 'go2'
OPEN, CLOSED = (12.0, 16.0, 20.0, 24.0), (24.0, 30.0, 34.0, 38.0, 42.0)
#: What a robot that nobody knows yet is pushed with, N s for each kg; it ends where most fall.
UNKNOWN = tuple(0.35 * k for k in range(1, 13))
#: Networks whose trot has the same feedback, and what half of the pushes on it are to be, N s.
OTHERS, ENOUGH = ('quadruped', 'phase', 'hopf', 'matsuoka'), 28.0
#: How many times its open-loop impulse a robot other than the Go2 is to survive.
TWICE = 2.0
#: Force sensors 10 % wrong with 5 % noise, 0.5 degrees of IMU bias, 0.02 rad/s on the gyro.
DULL = {'delay': 0.01, 'force_bias': 0.1, 'force_noise': 0.05, 'orientation_bias': 0.00873,
        'gyroscope_noise': 0.02}


class Job(NamedTuple):
    """A figure of a gait, with feedback or without it; the network is the robot's first if ''."""

    gait: str
    figure: str
    closed: bool
    network: str = ''


class Run(NamedTuple):
    """What all jobs share.

    Attributes:
        robot: its file.
        model: of it, as of tune.
        seed: of pushes and grounds.
        quick: few runs: a look, no verdict.
        gains: of the laws.
        impulses: of pushes, N s; the usual ones if empty.

    """

    robot: Path
    model: str
    seed: int
    quick: bool
    gains: Gains
    impulses: tuple[float, ...]


def measure(job: Job, run: Run) -> Any:
    """Measure one figure of one gait, in a process of its own."""
    began = time.perf_counter()
    others = [name for name in GAITS if name != job.gait] if job.figure == 'switches' else []
    one = subject(run.robot, job.gait, run.gains if job.closed else None, run.seed, run.quick,
                  job.network, others, run.model)
    if job.figure in ('pushes', 'noisy', 'networks'):
        if job.figure == 'noisy':
            one.noise = SensorNoise(**DULL, seed=run.seed)
        impulses = run.impulses or pushed_with(job, run, one.loop.geometry.weight / GRAVITY)
        found: Any = pushes(one, impulses[::2] if run.quick else impulses)
    else:
        found = {'ground': ground, 'slopes': slopes, 'flat': flat, 'switches': switches,
                 'wander': wander, 'sideways': sideways}[job.figure](one)
    log(f'{job.gait}, {job.figure} {job.network}, {"closed" if job.closed else "open"}: {found} '
        f'({time.perf_counter() - began:.0f} s)')
    return found


def changed(changes: list[str], gains: Gains) -> Gains:
    """Return gains of which some are changed, each a GAIN=VALUE.

    Raises:
        ValueError: it is none.
        InputError: it is outside its limits.

    """
    for change in changes:
        name, _, value = change.partition('=')
        if name not in Gains._fields:
            raise ValueError(f"argument --set: '{name}' is not one of {', '.join(Gains._fields)}")
        kind = type(getattr(gains, name))
        gains = gains._replace(**{name: kind(float(value))})
    gains.check()
    return gains


def pushed_with(job: Job, run: Run, mass: float) -> tuple[float, ...]:
    """Return the impulses that a gait is pushed with, N s."""
    if run.robot != ROBOT:
        return tuple(round(fraction * mass, 1) for fraction in UNKNOWN)
    if job.gait in ('pace', 'bound'):
        return (4.0, 8.0, 12.0, *OPEN[1:], *CLOSED[1:])[:None if job.closed else 6]
    if job.figure == 'networks' and job.closed:
        return (24.0, 28.0, 32.0, 36.0)
    return CLOSED if job.closed else OPEN


def jobs(quick: bool) -> list[Job]:
    """Return what is to be measured of the Go2, long jobs first."""
    ways = (True, False)
    return ([Job(gait, figure, closed) for closed in ways for gait in ('trot', 'walk')
             for figure in ('ground', 'pushes')]
            + [Job(gait, 'switches', closed) for gait in GAITS[::3 if quick else 1]
               for closed in ways]
            + [Job('trot', 'noisy', True), Job('trot', 'wander', True),
               Job('trot', 'wander', False), Job('walk', 'wander', True)]
            + [Job('trot', 'networks', closed, network) for network in OTHERS for closed in ways]
            + [Job(gait, 'pushes', closed) for gait in ('pace', 'bound') for closed in ways]
            + [Job(gait, figure, closed) for gait in ('trot', 'walk')
               for figure in ('flat', 'slopes') for closed in ways]
            + [Job('trot', 'sideways', True)])


def jobs_of(robot: Robot) -> list[Job]:
    """Return what is to be measured of another robot: pushes, of each gait that it was given."""
    return [Job(gait, 'pushes', closed) for gait in GAITS if gait in robot.motions
            for closed in (True, False)]


def twice(found: dict[str, dict[str, dict[str, Any]]]) -> dict[str, bool]:
    """Hold another robot's trot and walk against what the feedback is to reach."""
    half = {way: {gait: one[way]['pushes']['half_survive_N_s'] for gait, one in found.items()}
            for way in ('open', 'closed')}
    return {f'{gait} pushes': half['closed'][gait] >= TWICE * half['open'][gait]
            for gait in found if gait in ('trot', 'walk')}


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
            # Open loop, a robot that slips goes faster than it should.
            'friction 0.3': plane['friction_0.3_upright'] >= before['friction_0.3_upright'] and (
                abs(plane['friction_0.3_speed'] - 0.4) <= abs(before['friction_0.3_speed'] - 0.4)),
            }.items()}
    trot = found['trot']['closed']
    met['trot at 24 N s'] = trot['pushes']['survived'].get('24', 0.0) >= 0.95
    met['trot uphill'] = trot['slopes']['uphill_m'] >= 2.0
    met['trot with noise and delay'] = trot['noisy']['half_survive_N_s'] >= 34.0
    for network, one in trot['networks'].items():
        met[network] = one['half_survive_N_s'] >= ENOUGH
    for gait in ('trot', 'walk'):
        met[f'{gait} wander'] = found[gait]['closed']['wander']['falls'] == 0
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
    parser.add_argument('--gait', dest='gaits', nargs='+', metavar='GAIT', help='only these')
    parser.add_argument('--set', nargs='+', default=[], metavar='GAIN=VALUE', dest='changes',
                        help='gains other than usual, such as touchdown=1; closed loop only')
    parser.add_argument('--impulses', nargs='+', type=float, default=[], metavar='NS',
                        help='of pushes, rising')
    parser.add_argument('--robot', type=Path, default=ROBOT, metavar='FILE',
                        help='robot file that tune has written (default: the Go2)')
    parser.add_argument('--model', default=MODEL, metavar='MODEL', help='its model, as of tune')
    parser.add_argument('--seed', type=int, default=None, help='a fresh one if not given')
    parser.add_argument('--processes', type=int, default=len(os.sched_getaffinity(0)))
    arguments = parser.parse_args()
    seed = secrets.randbelow(2**31) if arguments.seed is None else arguments.seed
    log(f'seed {seed}')
    path = arguments.robot.resolve()
    try:
        robot = read_robot(path)
        run = Run(path, arguments.model, seed, arguments.quick,
                  changed(arguments.changes, robot_gains(robot)), tuple(arguments.impulses))
        own = jobs(run.quick) if path == ROBOT else jobs_of(robot)
    except (CpgError, ValueError) as error:
        parser.error(str(error))
    args = [job for job in own if job.figure in (arguments.only or [job.figure])
              and job.gait in (arguments.gaits or [job.gait])
              and (job.closed or not arguments.changes)]
    began, found = time.perf_counter(), {}
    with (ProcessPoolExecutor(arguments.processes) as pool,
          progress_bar('figures', len(args)) as progress):
        measured = pool.map(measure, args, itertools.repeat(run))
        for done, (job, one) in enumerate(zip(args, measured, strict=True), 1):
            way = found.setdefault(job.gait, {'open': {}, 'closed': {}})[
                'closed' if job.closed else 'open']
            if job.network:
                way.setdefault(job.figure, {})[job.network] = one
            else:
                way[job.figure] = one
            progress(done)
    whole = not (arguments.only or arguments.gaits or arguments.changes or run.impulses)
    met = {} if not whole else verdicts(found) if path == ROBOT else twice(found)
    emit(benchmark='feedback', robot=path.stem, seed=seed, quick=run.quick,
         changed=arguments.changes, minutes=(time.perf_counter() - began) / 60.0, gaits=found,
         met=met)
    return 0 if run.quick or all(met.values()) else 1


if __name__ == '__main__':
    sys.exit(main())

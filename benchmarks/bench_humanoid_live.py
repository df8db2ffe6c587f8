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

"""A humanoid over the graph: generator and robot_sim in lockstep at 500 Hz, as fast as they can.

Friction, noise and delay as in bench_humanoid.py: the same walks and pushes in processes of their
own. Speeds are measured from 5 s of simulated time on. Pushes of 0.1 s come every 7 s in 8
directions, 3 times each; after a fall ~/reset puts the robot on its feet. CPU time of the nodes
is given for each second of simulated time. A tour goes through the gaits at runtime.
"""

import argparse
import math
import time
from typing import Any

from common import emit, log
import numpy as np
from processes import enter_workspace
import rclpy
from stage import Stage

NOISE = {'friction': 0.6, 'imu_delay': 0.004, 'joint_delay': 0.004, 'gyroscope_noise': 0.02,
         'accelerometer_noise': 0.1, 'force_noise': 0.05}
SPEEDS = (0.0, 0.3, 0.5)
#: Height of the base at which it lies, m.
LOW = 0.4
DIRECTIONS, ROUNDS, EVERY = 8, 3, 7.0
#: After a push of this duration, s, as robot_sim's; so long after a fall it walks again.
PUSH, AGAIN = 0.1, 8.0
#: Gaits of the tour, each with its speed in m/s, for 8 s.
TOUR = (('walk', 0.3), ('run', 0.5), ('walk', 0.3), ('two_legged_hop', 0.0), ('run', 1.0),
        ('two_legged_jump', 0.0), ('walk', 0.5), ('walk', math.nan))
TARGETS = {'speed_error': 0.1, 'survived_20': 22}


def walked(robot: str, speed: float, seconds: float, seed: int) -> dict[str, float]:
    log(f'{speed:g} m/s, seed {seed}')
    stage = Stage(robot, 'biped', LOW, noise_seed=seed, **NOISE)
    try:
        stage.spend(1.0)
        stage.drive(speed)
        stage.spend(4.0)
        before, began = stage.cpu(), time.monotonic()
        rows = stage.spend(seconds - 5.0)
        spent = (stage.cpu() - before) / (seconds - 5.0)
        return {'fell': float(not stage.upright), 'forward': float(rows[:, 1].mean()),
                'left': float(rows[:, 2].mean()), 'tilt': float(rows[:, 3].max()),
                'cpu_generator': float(spent[0]), 'cpu_robot_sim': float(spent[1]),
                'times_real_time': (seconds - 5.0) / (time.monotonic() - began)}
    finally:
        stage.end()


def pushed(robot: str, strength: float, seed: int) -> int:
    """Return how many pushes of an impulse in N s were survived."""
    log(f'pushes of {strength:g} N s')
    stage, survived = Stage(robot, 'biped', LOW, noise_seed=seed, **NOISE), 0
    try:
        stage.spend(1.0)
        stage.drive(0.3)
        stage.spend(5.0)
        for k in range(DIRECTIONS * ROUNDS):
            angle, force = 2.0 * math.pi * (k % DIRECTIONS) / DIRECTIONS, strength / PUSH
            # Or it would stop: a command counts for a minute.
            stage.drive(0.3)
            stage.push(force * math.cos(angle), force * math.sin(angle))
            # No multiple of a stride's duration.
            stage.spend(EVERY + 0.2 * (k // DIRECTIONS))
            survived += stage.upright
            if not stage.upright:
                stage.stand_up()
                stage.spend(AGAIN)
        return survived
    finally:
        stage.end()


def toured(robot: str, seed: int) -> dict[str, Any]:
    """Go through the gaits; return the mean speeds in the last 4 s of each."""
    log('tour')
    stage, found = Stage(robot, 'biped', LOW, noise_seed=seed, **NOISE), []
    try:
        stage.spend(1.0)
        for gait, speed in TOUR:
            stage.switch(gait)
            stage.drive(speed)
            stage.spend(4.0)
            found.append((gait, speed if math.isfinite(speed) else 'stand',
                          float(stage.spend(4.0)[:, 1].mean())))
        return {'upright': stage.upright, 'falls': stage.body.output.count('has fallen'),
                'gaits': found}
    finally:
        stage.end()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--robot', default='humanoid')
    parser.add_argument('--seeds', type=int, default=3)
    parser.add_argument('--first-seed', type=int, default=1000)
    parser.add_argument('--seconds', type=float, default=45.0)
    parser.add_argument('--impulses', type=float, nargs='*', default=[20.0, 30.0])
    args = parser.parse_args()
    enter_workspace()
    rclpy.init()
    seeds = range(args.first_seed, args.first_seed + args.seeds)
    walks, loads = {}, []
    for speed in SPEEDS:
        own = [walked(args.robot, speed, args.seconds, seed) for seed in seeds]
        loads += own
        walks[f'{speed:g}'] = {
            'runs': len(own), 'falls': sum(one['fell'] for one in own),
            **{key: float(np.mean([one[key] for one in own])) for key in ('forward', 'left')},
            'error': max(abs(one['forward'] - speed) for one in own),
            'tilt_rad': max(one['tilt'] for one in own)}
    survived = {f'{strength:g}': pushed(args.robot, strength, args.first_seed)
                for strength in args.impulses}
    tour = toured(args.robot, args.first_seed)
    load = {key: float(np.median([one[key] for one in loads])) for key in (
        'cpu_generator', 'cpu_robot_sim', 'times_real_time')}
    passed = (not any(one['falls'] for one in walks.values()) and not tour['falls']
              and all(walks[f'{speed:g}']['error'] <= TARGETS['speed_error'] * speed
                      for speed in SPEEDS[1:])
              and survived.get('20', 24) >= TARGETS['survived_20'])
    emit(benchmark='humanoid_live', robot=args.robot, seconds=args.seconds, walks=walks,
         pushes_of=DIRECTIONS * ROUNDS, survived=survived, tour=tour, **load, targets=TARGETS,
         passed=passed)


if __name__ == '__main__':
    main()

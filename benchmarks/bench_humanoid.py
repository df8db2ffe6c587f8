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

"""A humanoid in simulation, clocked by the biped network: gaits, pushes, what each law adds.

In process, physics and feedback at 500 Hz, friction 0.6, the velocity estimated, noise of the
inertial unit and of the foot forces, 4 ms of delay. Every run has a seed of its own. Goings last
61 s, or 31 s. Pushes of 0.1 s on the base come in 8 directions at 3 phases of a stride, at 0.3 m/s
in the walk and 0.5 m/s in the run, survived if the robot is upright 6 s later. Ablations get the
same pushes. 'even clock' has phases that grow evenly, as those of a sine, in place of the network:
it says what the network's dynamics add to the balance. 'ten times' walks, runs, walks and stands.
'ends' are of runs at 1 m/s: in a walk, in a stand and in a jump, at any time of the stride.
Grounds are crossed at 0.3 m/s for 21 s: tiles of random heights, ramps that begin after half a
metre, another friction or a load on the base that the feedback does not know of.
"""

import argparse
from concurrent.futures import ProcessPoolExecutor
import ctypes
from functools import cache
import math
import multiprocessing
from typing import Any, NamedTuple

from common import emit, log
from cpg_ros.feedback.biped.feedback import BipedFeedback, gait_plan
from cpg_ros.feedback.biped.gains import BipedGains
from cpg_ros.motion.robot_file import load_robot
from cpg_ros.simulation.biped_run import BipedRun
from cpg_ros.simulation.scenario import impulse, SensorNoise
from cpg_ros.simulation.terrain import Terrain
import numpy as np

NOISE = SensorNoise(delay=0.004, gyroscope_noise=0.02, accelerometer_noise=0.1, force_noise=0.05)
DIRECTIONS, PHASES, AFTER = 8, 3, 6.0
#: Gait, speed forward and left in m/s, turn in rad/s, s.
GOINGS = {'0': ('walk', 0.0, 0.0, 0.0, 61.0), '0.3': ('walk', 0.3, 0.0, 0.0, 61.0),
          '0.5': ('walk', 0.5, 0.0, 0.0, 61.0), 'backward': ('walk', -0.2, 0.0, 0.0, 31.0),
          'sideways': ('walk', 0.0, 0.1, 0.0, 31.0), 'turning': ('walk', 0.2, 0.0, 0.3, 31.0),
          'run 0.5': ('run', 0.5, 0.0, 0.0, 31.0), 'run 1.0': ('run', 1.0, 0.0, 0.0, 31.0),
          'hop': ('two_legged_hop', 0.0, 0.0, 0.0, 31.0),
          'jump': ('two_legged_jump', 0.0, 0.0, 0.0, 31.0)}
IMPULSES = {'walk': (20.0, 30.0, 40.0), 'run': (15.0, 20.0, 25.0)}
SPEEDS = {'walk': 0.3, 'run': 0.5}
#: Kind and size of the terrain, friction, load in kg; then s and runs of each.
GROUNDS = {'tiles 3 cm': ('boxes', 0.03, 0.6, 0.0), 'tiles 4 cm': ('boxes', 0.04, 0.6, 0.0),
           'slope +4 degrees': ('ramp', 4.0, 0.6, 0.0),
           'slope -4 degrees': ('ramp', -4.0, 0.6, 0.0), 'friction 0.5': ('', 0.0, 0.5, 0.0),
           'load +5 kg': ('', 0.0, 0.6, 5.0), 'load -3 kg': ('', 0.0, 0.6, -3.0)}
CROSSING, CROSSINGS = 21.0, 4
#: What a run at 1 m/s changes to after 8 s, and a bit more in each of the runs, s.
ENDS = {'end in a walk': ('walk', 0.4), 'end in a stand': ('run', math.nan),
        'end in a jump': ('two_legged_jump', 0.0)}
RUNNING, LATER = 8.0, 0.07
#: Changes of the gains that take a law away.
ABLATIONS = {'without placement': {'place_x': 0.0, 'place_y': 0.0},
             'without speed-up': {'speed_up': 0.0},
             'without pressure': {'cop_x': 0.0, 'cop_y': 0.0}}
EVEN = 'even clock'
TARGETS = {'speed_error': 0.1, 'survived_20': 22, 'survived_30': 12}
#: A round of 'ten times', s, and its gaits and commands from their times on.
ROUND, CHANGES = 16.0, ((5.0, 'run'), (9.0, 'walk'))


class Metronome(BipedFeedback):
    """The same laws without the network: phases of the legs grow evenly.

    The cells stand still, and the arms with them.
    """

    def __init__(self, *given: Any, **named: Any) -> None:
        super().__init__(*given, **named)
        legs = self.track.legs

        def move(_: int, strides: float) -> int:
            legs[:] = (legs + strides) % 1.0
            return 1

        kind = ctypes.CFUNCTYPE(ctypes.c_int32, ctypes.c_void_p, ctypes.c_double)
        self._even = kind(move), kind(lambda _, phase: 0)
        self.biped.functions[:] = [ctypes.cast(one, ctypes.c_void_p).value for one in self._even]


class Job(NamedTuple):
    """A run: what it is, its seed, what it does, impulse in N s, its number, what is missing."""

    robot: str
    model: str
    seed: int
    name: str
    gait: str
    wish: tuple[float, float, float]
    duration: float
    impulse: float = 0.0
    number: int = 0
    ablation: str = ''


@cache
def runner(robot: str, model: str, ground: str = '', number: int = 0) -> BipedRun:
    kind, size, friction, load = GROUNDS.get(ground, ('', 0.0, 0.6, 0.0))
    made = BipedRun(model, load_robot(robot), NOISE, friction,
                    terrain=Terrain(kind, size, number) if kind else None)
    made.body.load(load)
    return made


def measure(job: Job) -> tuple[Job, dict[str, float]]:
    run = (runner(job.robot, job.model, job.name, job.number) if job.name in GROUNDS else
           runner(job.robot, job.model))
    robot = run.robot
    assert robot.biped is not None
    gains = BipedGains.of({**robot.biped.gains, **ABLATIONS.get(job.ablation, {})}, job.gait)
    feedback = (Metronome if job.ablation == EVEN else BipedFeedback)(
        robot, gait_plan(robot, job.gait))
    feedback.set_gains(job.gait, gains)
    pushes: tuple[tuple[float, float, float], ...] = ()
    if job.impulse:
        direction, phase = divmod(job.number, PHASES)
        angle = 2.0 * math.pi * direction / DIRECTIONS
        when = job.duration - AFTER + phase / PHASES / gains.frequency
        pushes = (impulse(when, job.impulse * math.cos(angle), job.impulse * math.sin(angle)),)
    commands: tuple[tuple[float, float, float, float], ...] = ((1.0, *job.wish),)
    gaits: tuple[tuple[float, str], ...] = ()
    if job.name == 'ten times':
        begins = [ROUND * k for k in range(10)]
        gaits = tuple((begin + when, gait) for begin in begins for when, gait in CHANGES)
        commands = tuple(one for begin in begins for one in (
            (begin + 1.0, *job.wish), (begin + 12.0, math.nan, 0.0, 0.0)))
    if job.name in ENDS:
        gait, speed = ENDS[job.name]
        when = RUNNING + LATER * job.number
        gaits, commands = ((when, gait),), (*commands, (when, speed, 0.0, 0.0))
    found = run.run(job.duration, commands, pushes, feedback, job.seed, gaits)
    late = found.path[:, 0] > 5.0
    yaw = np.unwrap(found.path[:, 4])
    turn = np.polyfit(found.path[late, 0], yaw[late], 1)[0] if late.sum() > 1 else 0.0
    return job, {'fell': found.fell, 'forward': found.speed[0], 'left': found.speed[1],
                 'turn': float(turn), 'tilt': found.tilt, 'cost': found.cost,
                 'flight': found.flight}


def pushed(robot: tuple[str, str], seed: int, gait: str, strength: float, ablation: str = ''
           ) -> list[Job]:
    return [Job(*robot, seed + k, 'push', gait, (SPEEDS[gait], 0.0, 0.0), 5.0 + AFTER, strength,
                k, ablation) for k in range(DIRECTIONS * PHASES)]


def summary(own: list[dict[str, float]], wish: tuple[float, float, float]) -> dict[str, Any]:
    def mean(key: str) -> float:
        return float(np.mean([one[key] for one in own]))
    made = {'falls': sum(math.isfinite(one['fell']) for one in own), 'runs': len(own),
            **{key: mean(key) for key in ('forward', 'left', 'turn')},
            'error': max(abs(one['forward'] - wish[0]) for one in own),
            'tilt_rad': max(one['tilt'] for one in own), 'flight': mean('flight')}
    return made | ({'cost_of_transport': mean('cost')} if abs(wish[0]) > 0.1 else {})


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--robot', default='humanoid')
    parser.add_argument('--model', help='the name of the robot if not given')
    parser.add_argument('--seeds', type=int, default=5)
    parser.add_argument('--first-seed', type=int, default=1000)
    parser.add_argument('--jobs', type=int, default=2)
    parser.add_argument('--quick', action='store_true', help='no ablations')
    args = parser.parse_args()
    robot, seed = (args.robot, args.model or args.robot), args.first_seed
    jobs = [Job(*robot, seed + k, name, gait, tuple(wish), seconds)
            for name, (gait, *wish, seconds) in GOINGS.items() for k in range(args.seeds)]
    jobs += [Job(*robot, seed + k, 'ten times', 'walk', (0.3, 0.0, 0.0), 10.0 * ROUND)
             for k in range(2)]
    jobs += [Job(*robot, seed + k, name, 'walk', (0.3, 0.0, 0.0), CROSSING, number=k)
             for name in GROUNDS for k in range(CROSSINGS)]
    jobs += [Job(*robot, seed + k, name, 'run', (1.0, 0.0, 0.0), RUNNING + 7.0, number=k)
             for name in ENDS for k in range(4 * args.seeds)]
    for gait, strengths in IMPULSES.items():
        for strength in strengths:
            jobs += pushed(robot, seed, gait, strength)
    ablations = () if args.quick else (*ABLATIONS, EVEN)
    for ablation in ablations:
        for strength in IMPULSES['walk'][:2]:
            jobs += pushed(robot, seed, 'walk', strength, ablation)
    log(f'{len(jobs)} runs')
    with ProcessPoolExecutor(args.jobs, multiprocessing.get_context('spawn')) as pool:
        found = list(pool.map(measure, jobs, chunksize=4))
    goings = {name: summary([one for job, one in found if job.name == name], tuple(wish))
              for name, (_, *wish, _) in GOINGS.items()}
    crossed = {name: summary([one for job, one in found if job.name == name], (0.3, 0.0, 0.0))
               for name in GROUNDS}
    ten = [one['fell'] for job, one in found if job.name == 'ten times']
    ended = {name: [math.isfinite(one['fell']) for job, one in found if job.name == name]
             for name in ENDS}
    survived = {label: {f'{strength:g}': sum(math.isinf(one['fell']) for job, one in found if (
        job.name, job.gait, job.ablation, job.impulse) == ('push', gait, ablation, strength))
        for strength in IMPULSES[gait][:2 if ablation else None]}
        for label, gait, ablation in (('walk', 'walk', ''), ('run', 'run', ''),
                                      *((one, 'walk', one) for one in ablations))}
    whole = survived['walk']
    passed = (not any(one['falls'] for one in goings.values()) and all(map(math.isinf, ten))
              and not any(map(any, ended.values()))
              and all(goings[name]['error'] <= TARGETS['speed_error'] * abs(GOINGS[name][1])
                      for name in ('0.3', '0.5', 'backward', 'run 0.5', 'run 1.0'))
              and whole['20'] >= TARGETS['survived_20'] and whole['30'] >= TARGETS['survived_30'])
    emit(benchmark='humanoid', robot=args.robot, goings=goings, grounds=crossed,
         walk_run_walk_stand_ten_times={'runs': len(ten), 'falls': sum(map(math.isfinite, ten))},
         run_ends={name: {'runs': len(own), 'falls': sum(own)} for name, own in ended.items()},
         pushes_of=DIRECTIONS * PHASES, survived=survived, targets=TARGETS, passed=passed)


if __name__ == '__main__':
    main()

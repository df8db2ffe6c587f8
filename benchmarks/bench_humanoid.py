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

"""A humanoid in simulation, clocked by the biped network: walks, pushes, and what each law adds.

In process, physics and feedback at 500 Hz, friction 0.6, the velocity estimated, noise of the
inertial unit and of the foot forces, 4 ms of delay. Walks of 61 s at 0, 0.3 and 0.5 m/s, each with
a seed of its own; pushes of 0.1 s on the base at 0.3 m/s in 8 directions at 3 phases of a stride,
survived if the robot is upright 6 s later. Ablations get the same pushes. 'even clock' has phases
that grow evenly in place of the network: it says what the network's dynamics add to the balance.
"""

import argparse
from concurrent.futures import ProcessPoolExecutor
from functools import cache
import math
import multiprocessing
from typing import NamedTuple

from common import emit, log
from cpg_ros.feedback.biped.feedback import BipedFeedback
from cpg_ros.feedback.biped.gains import BipedGains
from cpg_ros.robots.robot_file import load_robot
from cpg_ros.simulation.biped_run import BipedRun
from cpg_ros.simulation.scenario import impulse, SensorNoise
import numpy as np

SPEEDS, IMPULSES = (0.0, 0.3, 0.5), (20.0, 30.0, 40.0)
NOISE = SensorNoise(delay=0.004, gyroscope_noise=0.02, accelerometer_noise=0.1, force_noise=0.05)
DIRECTIONS, PHASES, AFTER = 8, 3, 6.0
#: Changes of the gains that take a law away.
ABLATIONS = {'without placement': {'place_x': 0.0, 'place_y': 0.0},
             'without speed-up': {'speed_up': 0.0},
             'without pressure': {'pressure_x': 0.0, 'pressure_y': 0.0}}
EVEN = 'even clock'
TARGETS = {'speed_error': 0.1, 'survived_20': 22, 'survived_30': 12}


class EvenClock:
    """Phases of two legs that grow evenly."""

    def __init__(self, legs: np.ndarray) -> None:
        self.legs = legs

    def advance(self, strides: float) -> bool:
        self.legs[:] = (self.legs + strides) % 1.0
        return True


class Metronome(BipedFeedback):
    """The same laws without the network."""

    def _start(self) -> None:
        super()._start()
        self.track = EvenClock(self.track.legs.copy())  # type: ignore[assignment]


class Job(NamedTuple):
    """A run: seed, speed in m/s, impulse in N s, its number, what is taken away."""

    robot: str
    model: str
    seed: int
    speed: float
    duration: float
    impulse: float = 0.0
    number: int = 0
    ablation: str = ''


@cache
def runner(robot: str, model: str) -> BipedRun:
    return BipedRun(model, load_robot(robot), NOISE)


def measure(job: Job) -> tuple[Job, float, tuple[float, float], float, float]:
    run = runner(job.robot, job.model)
    robot = run.robot
    gains = BipedGains.of({**(robot.biped.gains if robot.biped else {}),
                      **ABLATIONS.get(job.ablation, {})})
    feedback = (Metronome if job.ablation == EVEN else BipedFeedback)(robot, gains)
    pushes: tuple[tuple[float, float, float], ...] = ()
    if job.impulse:
        direction, phase = divmod(job.number, PHASES)
        angle = 2.0 * math.pi * direction / DIRECTIONS
        when = job.duration - AFTER + phase / PHASES / gains.frequency
        pushes = (impulse(when, job.impulse * math.cos(angle), job.impulse * math.sin(angle)),)
    found = run.run(job.duration, ((1.0, job.speed, 0.0, 0.0),), pushes, feedback, job.seed)
    return job, found.fell, found.speed, found.tilt, found.cost


def pushed(robot: str, model: str, seed: int, strength: float, ablation: str = '') -> list[Job]:
    return [Job(robot, model, seed + k, 0.3, 5.0 + AFTER, strength, k, ablation)
            for k in range(DIRECTIONS * PHASES)]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--robot', default='humanoid')
    parser.add_argument('--model', help='the name of the robot if not given')
    parser.add_argument('--seeds', type=int, default=5)
    parser.add_argument('--first-seed', type=int, default=1000)
    parser.add_argument('--seconds', type=float, default=61.0)
    parser.add_argument('--jobs', type=int, default=2)
    parser.add_argument('--quick', action='store_true', help='no ablations')
    chosen = parser.parse_args()
    robot, model, seed = chosen.robot, chosen.model or chosen.robot, chosen.first_seed
    jobs = [Job(robot, model, seed + k, speed, chosen.seconds) for speed in SPEEDS
            for k in range(chosen.seeds)]
    for strength in IMPULSES:
        jobs += pushed(robot, model, seed, strength)
    for ablation in () if chosen.quick else (*ABLATIONS, EVEN):
        for strength in IMPULSES[:2]:
            jobs += pushed(robot, model, seed, strength, ablation)
    log(f'{len(jobs)} runs')
    with ProcessPoolExecutor(chosen.jobs, multiprocessing.get_context('spawn')) as pool:
        found = list(pool.map(measure, jobs, chunksize=4))
    walks, survived = {}, {}
    for speed in SPEEDS:
        own = [one for one in found if one[0].speed == speed and not one[0].impulse]
        speeds = np.array([one[2] for one in own])
        walks[str(speed)] = {
            'falls': sum(math.isfinite(one[1]) for one in own), 'runs': len(own),
            'speed': float(speeds[:, 0].mean()), 'sideways': float(speeds[:, 1].mean()),
            'error': float(np.abs(speeds[:, 0] - speed).max()),
            'tilt_rad': max(one[3] for one in own)}
        if speed:
            walks[str(speed)]['cost_of_transport'] = float(np.mean([one[4] for one in own]))
    for ablation in ('', *(() if chosen.quick else (*ABLATIONS, EVEN))):
        survived[ablation or 'all laws'] = {
            f'{strength:g}': sum(math.isinf(one[1]) for one in found
                                 if one[0].impulse == strength and one[0].ablation == ablation)
            for strength in (IMPULSES[:2] if ablation else IMPULSES)}
    whole = survived['all laws']
    passed = (not any(one['falls'] for one in walks.values())
              and all(walks[str(speed)]['error'] <= TARGETS['speed_error'] * speed
                      for speed in SPEEDS[1:])
              and whole['20'] >= TARGETS['survived_20'] and whole['30'] >= TARGETS['survived_30'])
    emit(benchmark='humanoid', robot=robot, seconds=chosen.seconds, walks=walks,
         pushes_of=DIRECTIONS * PHASES, survived=survived, targets=TARGETS, passed=passed)


if __name__ == '__main__':
    main()

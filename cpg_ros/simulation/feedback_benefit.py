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

"""Whether feedback helps a robot in simulation: pushes survived with it and without it.

Both meet the same pushes; sensors have noise, bias and delay, as real ones have. A paired test
says whether what differs is more than chance.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
import math

from cpg_ros.feedback.froude_scaling import leg_length, robot_gains
from cpg_ros.feedback.gains import Gains
from cpg_ros.feedback.kinematics import geometry_of, GRAVITY
from cpg_ros.feedback.timetable import Timetable
from cpg_ros.motion.plan import GaitPlan, plan
from cpg_ros.networks.registry import NETWORKS
from cpg_ros.robots.feedback_keys import OwnFeedback
from cpg_ros.robots.robot import Robot
from cpg_ros.simulation.closed_loop import ClosedLoop
from cpg_ros.simulation.scenario import impulse, Scenario, SensorNoise
import numpy as np
from scipy.stats import binomtest

#: Impulses of pushes, as shares of m sqrt(g l) with the legs' length l.
IMPULSES = (0.2, 0.4, 0.6)
#: Pushes of each impulse, undisturbed runs, and how long these are and a push is watched, s.
PUSHES, UNDISTURBED, WALKED = 8, 4, 5.0
PUSHED, WATCHED = 1.6, 3.4
#: Froude number, v / sqrt(g l), of the speed that is asked for, and share of the fastest speed.
FROUDE, SHARE = 0.2, 0.8
#: Delays of the sensors, s, by turns from run to run, and what else is wrong with them.
DELAYS = (0.01, 0.02)
SENSORS = SensorNoise(force_bias=0.2, force_noise=0.2, orientation_bias=0.01,
                      gyroscope_noise=0.02, gyroscope_bias=0.01, accelerometer_noise=0.3,
                      accelerometer_bias=0.1)
#: Laws that robots with slow joints or feet that drag are tried without, one set after the other.
WITHOUT: Sequence[tuple[str, ...]] = ((), ('reflexes',), ('reflexes', 'posture'))


def more_than_chance(won: int, lost: int) -> bool:
    """Whether of runs that end in two ways more are won than lost (p < 0.05, sign test)."""
    changed = won + lost
    return changed > 0 and bool(binomtest(won, changed, alternative='greater').pvalue < 0.05)


@dataclass(frozen=True)
class Benefit:
    """What feedback does to a gait.

    Attributes:
        gait: its name.
        upright: undisturbed runs with feedback that did not fall, of UNDISTURBED.
        survived: pushes with feedback, of all.
        without: the same without feedback.
        lost: those survived without feedback only.

    """

    gait: str
    upright: int
    survived: int
    without: int
    lost: int

    @property
    def won(self) -> int:
        """Pushes survived with feedback only."""
        return self.survived - self.without + self.lost

    @property
    def helps(self) -> bool:
        """Whether it fells no undisturbed robot, and more of the same pushes are survived.

        More than chance would have it (p < 0.05, one-sided sign test of the pushes that end in
        two ways: the exact form of McNemar's test).
        """
        return self.upright == UNDISTURBED and more_than_chance(self.won, self.lost)

    def __str__(self) -> str:
        pushes = PUSHES * len(IMPULSES)
        return (f'{self.gait}: {self.survived} of {pushes} pushes survived (without feedback '
                f'{self.without}; {self.won} with it only, {self.lost} without it only), '
                f'{self.upright} of {UNDISTURBED} undisturbed runs, sensors '
                f'{" and ".join(f"{1e3 * delay:g}" for delay in DELAYS)} ms late')


def program_of(robot: Robot, gait: str) -> GaitPlan:
    """Plan a gait on the robot's first network; errors as of plan."""
    preset = NETWORKS[robot.networks[0]].presets()[gait]
    return plan(robot, gait, preset, preset.network, robot.motion(gait, gait).frequency or 0.0)


def judged_gaits(robot: Robot) -> list[str]:
    """Return the gaits that feedback is judged in: those with an efference copy that do not hop.

    Hops, whose left and right legs land together, have little use for it.
    """
    if robot.geometry is None:
        return []
    geometry, known = geometry_of(robot), NETWORKS[robot.networks[0]].presets()
    return [gait for gait, motion in robot.motions.items()
            if motion.efference is not None and gait in known
            and not Timetable(program_of(robot, gait), geometry).hops]


class FeedbackTrial:
    """Runs of one gait with any gains.

    Attributes:
        loop: the bodies.
        length: of the legs, m.
        speed: asked for, m/s.

    """

    def __init__(self, robot: Robot, model: str, gait: str, kp: float | None = None,
                 kd: float | None = None) -> None:
        """Load the model; arguments as of tuning.tune, the robot with an efference copy.

        Raises:
            SimulationError: the model cannot be used.

        """
        program = program_of(robot, gait)
        self.loop = ClosedLoop(model, program, kp=kp, kd=kd)
        self.length = leg_length(self.loop.geometry)
        self.speed = FROUDE * math.sqrt(GRAVITY * self.length)
        if program.motion.steering is not None:
            self.speed = min(self.speed, SHARE * program.speeds[1])

    def pushed(self, rng: np.random.Generator, count: int, impulses: Sequence[float]
               ) -> list[Scenario]:
        """Return runs with pushes from so many directions of each impulse, as of IMPULSES."""
        unit = self.loop.geometry.weight * math.sqrt(self.length / GRAVITY)
        found = []
        for share in impulses:
            first = rng.uniform(0.0, 2.0 * math.pi)
            for k in range(count):
                way = first + 2.0 * math.pi * k / count
                found.append(Scenario(speed=self.speed, phase=rng.uniform(), pushes=(
                    impulse(PUSHED, share * unit * math.cos(way), share * unit * math.sin(way)),)))
        return found

    def calm(self) -> list[Scenario]:
        """Return undisturbed runs."""
        return [Scenario(speed=self.speed, phase=k / UNDISTURBED) for k in range(UNDISTURBED)]

    def survived(self, gains: Gains | None, pushed: Sequence[Scenario]) -> np.ndarray:
        """Return which runs with pushes are survived; None for no feedback."""
        return self._upright(gains, pushed, WATCHED)

    def upright(self, gains: Gains | None) -> int:
        """Return how many undisturbed runs do not fall."""
        return int(self._upright(gains, self.calm(), WALKED).sum())

    def _upright(self, gains: Gains | None, scenarios: Sequence[Scenario], duration: float
                 ) -> np.ndarray:
        found = np.zeros(len(scenarios), dtype=bool)
        for k, delay in enumerate(DELAYS):
            some = slice(k, None, len(DELAYS))
            found[some] = self.loop.run(scenarios[some], duration, gains,
                                        noise=replace(SENSORS, delay=delay)).upright
        return found


def judge_feedback(robot: Robot, model: str, gaits: Sequence[str], kp: float | None = None,
                   kd: float | None = None, seed: int = 0) -> tuple[Robot, list[Benefit]]:
    """Return a robot whose file says whether its feedback helps in gaits, and by what it is so.

    Of the sets of laws in WITHOUT it gets the first that helps in every gait; where none does, its
    feedback is off unless one asks for it. Laws and gains of its own stay.

    Args:
        robot: with the geometry of its legs and an efference copy of each gait.
        model: as of ``robot_model.load``.
        gaits: to be judged.
        kp: proportional gain of the joints, N m / rad; None for what is usual.
        kd: damping gain of the joints, N m s / rad; the same.
        seed: of the pushes.

    Raises:
        SimulationError: the model cannot be used.

    """
    own = robot.feedback or OwnFeedback()
    trials = {gait: FeedbackTrial(robot, model, gait, kp, kd) for gait in gaits}
    pushed = {gait: trial.pushed(np.random.default_rng(seed), PUSHES, IMPULSES)
              for gait, trial in trials.items()}
    before = {gait: trial.survived(None, pushed[gait]) for gait, trial in trials.items()}
    first: list[Benefit] = []
    for without in WITHOUT:
        tried = replace(own, enabled=True, laws={**own.laws, **dict.fromkeys(without, False)})
        gains, found = robot_gains(replace(robot, feedback=tried)), []
        for gait, trial in trials.items():
            upright, old = trial.upright(gains), before[gait]
            new = (trial.survived(gains, pushed[gait]) if upright == UNDISTURBED
                   else np.zeros_like(old))
            found.append(Benefit(gait, upright, int(new.sum()), int(old.sum()),
                                 int((old & ~new).sum())))
            if not found[-1].helps:
                break
        first = first or found
        if all(one.helps for one in found):
            return replace(robot, feedback=replace(tried, made=_text(found))), found
    return replace(robot, feedback=replace(own, enabled=False, made=_text(first))), first


def _text(found: Sequence[Benefit]) -> str:
    return 'in simulation, ' + '; '.join(map(str, found))

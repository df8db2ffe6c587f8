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

"""What bench_feedback.py measures of a gait with feedback, or without it: a function a figure."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
import itertools
import math
from pathlib import Path

from cpg_ros.feedback.efference_copy import EfferenceCopy
from cpg_ros.feedback.gains import Gains
from cpg_ros.motion.plan import plan
from cpg_ros.motion.robot import Robot
from cpg_ros.motion.robot_file import read_robot
from cpg_ros.networks.registry import PRESETS
from cpg_ros.simulation.closed_loop import ClosedLoopBatch
from cpg_ros.simulation.robot_setup.walk_recording import measure_efference
from cpg_ros.simulation.scenario import impulse, Outcome, Scenario, SensorNoise
from cpg_ros.simulation.terrain import Terrain
import numpy as np

#: When pushes begin, s, and for how long a robot then has to stay up.
PUSHED, AFTER = 1.6, 2.5
#: Ground counts as crossed at this way, m, within this time, s.
WAY, CROSSING = 5.0, 18.0
GAITS = ('walk', 'trot', 'pace', 'bound', 'jump', 'pronk')
SLOPES = {'up': Terrain('ramp', 15.0), 'down': Terrain('ramp', -15.0),
          'across': Terrain('ramp', 15.0, across=True)}


@dataclass
class Subject:
    """A gait with feedback, or without it.

    Attributes:
        loop: bodies; a gait to begin with, and perhaps others.
        expected: efference copies of gaits whose robot file has none.
        gains: None without feedback.
        rng: where pushes and grounds come from.
        quick: few runs: a look, no verdict.

    """

    loop: ClosedLoopBatch
    expected: Mapping[str, EfferenceCopy]
    gains: Gains | None
    rng: np.random.Generator
    quick: bool = False
    noise: SensorNoise | None = field(default=None)

    def run(self, scenarios: Sequence[Scenario], duration: float, goal: float = math.inf
            ) -> Outcome:
        return self.loop.run(scenarios, duration, self.gains, self.expected, self.noise, goal)

    def seeds(self, count: int) -> list[int]:
        return [int(seed) for seed in self.rng.integers(0, 2**31, 2 if self.quick else count)]


def subject(robot_file: Path, gait: str, gains: Gains | None, seed: int, quick: bool,
            network: str = '', others: Sequence[str] = (), model: str = 'go2') -> Subject:
    """Make a subject, on the robot's first network if none is named; open loop without gains.

    Seeds are those of the run, so that open and closed meet the same.
    """
    robot = read_robot(robot_file)
    plans = [_program(robot, network or robot.networks[0], one) for one in (gait, *others)]
    loop = ClosedLoopBatch(model, *plans)
    expected = {}
    if gains is not None:
        for plan in plans:
            if plan.motion.efference is None:
                expected[plan.name] = measure_efference(ClosedLoopBatch(model, plan))
    return Subject(loop, expected, gains, np.random.default_rng(seed),
                   quick)


def _program(robot: Robot, network: str, gait: str):
    preset = PRESETS[network][gait]
    return plan(robot, gait, preset, preset.network, robot.motion(gait, gait).frequency or 0.0)


def pushes(one: Subject, impulses: Sequence[float], friction: float = 1.0) -> dict[str, object]:
    """Push from 12 directions at 8 phases, harder and harder until most fall.

    The impulse that half survive is read off the line through the shares.
    """
    directions, phases = (4, 2) if one.quick else (12, 8)
    fractions: dict[float, float] = {}
    for size in impulses:
        first = one.rng.uniform(0.0, 2.0 * math.pi)
        ways = first + np.arange(directions) * 2.0 * math.pi / directions
        fractions[size] = float(one.run(
            [Scenario(friction, phase=k / phases, pushes=(
                impulse(PUSHED, size * math.cos(way), size * math.sin(way)),))
             for way in ways for k in range(phases)],
            PUSHED + AFTER).upright.mean())
        if fractions[size] < 0.4:
            break
    half = max(fractions) if min(fractions.values()) >= 0.5 else min(fractions)
    for low, high in itertools.pairwise(fractions):
        if fractions[low] >= 0.5 > fractions[high]:
            half = float(np.interp(0.5, [fractions[high], fractions[low]], [high, low]))
    count = directions * phases
    return {'survived': {f'{size:g}': fraction for size, fraction in fractions.items()},
            'interval_95': {f'{size:g}': interval(fraction, count)
                            for size, fraction in fractions.items()},
            'half_survive_N_s': half}


def interval(fraction: float, count: int) -> tuple[float, float]:
    """Return the 95 % confidence interval of a fraction of so many runs (Wilson 1927)."""
    z = 1.96 / math.sqrt(count)
    middle, half = fraction + z**2 / 2.0, z * math.sqrt(fraction * (1.0 - fraction) + z**2 / 4.0)
    return (round((middle - half) / (1.0 + z**2), 3), round((middle + half) / (1.0 + z**2), 3))


def ground(one: Subject) -> dict[str, object]:
    """Cross 50 height fields of 6 and of 8 cm, and 50 fields of boxes of 5 cm."""
    found = {}
    for kind, size in (('height_field', 0.06), ('height_field', 0.08), ('boxes', 0.05)):
        ran = one.run([Scenario(terrain=Terrain(kind, size, seed)) for seed in one.seeds(50)],
                      CROSSING, goal=WAY)
        found[f'{kind}_{100 * size:.0f}_cm'] = float(np.isfinite(ran.arrived).mean())
    return found


def slopes(one: Subject) -> dict[str, object]:
    """Go up, down and across a ramp of 15 degrees for 10 s, from four phases each."""
    found: dict[str, object] = {}
    for name, ramp in SLOPES.items():
        ran = one.run([Scenario(terrain=ramp, phase=k / 4) for k in range(4)], 10.0)
        found[f'{name}_upright'] = float(ran.upright.mean())
        if name == 'up':
            found['uphill_m'] = float(ran.place[:, -1, 0].mean())
    return found


def flat(one: Subject) -> dict[str, object]:
    """Walk on flat ground: cost, speeds, a line of 20 m, steps of speed, slippery ground."""
    long = 10.0 if one.quick else 60.0
    ran = one.run([Scenario(speed=0.4), Scenario(speed=0.2)], 15.0)
    line = one.run([Scenario()], long, goal=20.0)
    slippery = one.run([Scenario(friction=0.3, phase=k / 8) for k in range(8)], 10.0)
    late = round(5.0 / one.loop.timestep)
    return {'cost_of_transport': float(ran.cost[0]),
            'speed_at_0.4': float(ran.velocity[0, late:, 0].mean()),
            'speed_at_0.2': float(ran.velocity[1, late:, 0].mean()),
            'off_line_m': float(np.abs(line.place[0, :, 1]).max()),
            'settling_s': settling(one),
            'friction_0.3_m': float(slippery.place[:, -1, 0].mean()),
            'friction_0.3_speed': float(slippery.velocity[:, late:, 0].mean()),
            'friction_0.3_upright': float(slippery.upright.mean())}


def settling(one: Subject) -> float:
    """Return how long steps of 0.2 m/s up and down take to 15 % of the step, s, on average.

    Speeds are means over a stride, and their last value is what they settle to.
    """
    dt, begin, hold = one.loop.timestep, 6.0, 6.0
    ran = one.run([Scenario(speed=low, phase=k / 4, commands=((begin, high, 0.0, 0.0),))
                   for low, high in ((0.2, 0.4), (0.4, 0.2)) for k in range(4)], begin + hold)
    stride = round(1.0 / (one.loop.plan.frequency * dt))
    times = []
    for speed in ran.velocity[:, :, 0]:
        mean = np.convolve(speed, np.full(stride, 1.0 / stride), mode='valid')
        start = round(begin / dt) - stride
        last = mean[-round(2.0 / dt):].mean()
        off = np.abs(mean[start:] - last) > 0.15 * 0.2
        times.append((np.flatnonzero(off)[-1] + 1 if off.any() else 0) * dt)
    return float(np.mean(times))


def switches(one: Subject) -> dict[str, object]:
    """Change from the gait to each other one on rough ground of 4 cm, 20 seeds."""
    others = [name for name in one.loop.plans if name != one.loop.plan.name]
    runs = [Scenario(terrain=Terrain('height_field', 0.04, seed), switches=((3.0, other),))
            for other in others for seed in one.seeds(20)]
    ran = one.run(runs, 7.0)
    upright = ran.upright.reshape(len(others), -1)
    return {other: int((~row).sum()) for other, row in zip(others, upright, strict=True)}


def wander(one: Subject) -> dict[str, object]:
    """Follow random wishes, a new one every 3 s for 60 s, on rough ground of 4 cm, 20 seeds."""
    runs = []
    for seed in one.seeds(20):
        rng = np.random.default_rng(seed)
        wishes = tuple((3.0 * k, rng.uniform(0.0, 0.4), rng.uniform(-0.15, 0.15),
                        rng.uniform(-0.5, 0.5)) for k in range(1, 20))
        runs.append(Scenario(terrain=Terrain('height_field', 0.04, seed), commands=wishes))
    ran = one.run(runs, 15.0 if one.quick else 60.0)
    return {'falls': int((~ran.upright).sum()), 'runs': len(runs)}


def sideways(one: Subject) -> dict[str, object]:
    """Ask for 0.1 m/s to the left, walking on the spot and forward."""
    ran = one.run([Scenario(speed=speed, commands=((2.0, speed, 0.1, 0.0),))
                   for speed in (0.0, 0.3)], 12.0)
    late = round(5.0 / one.loop.timestep)
    return {'left_at_0': float(ran.velocity[0, late:, 1].mean()),
            'left_at_0.3': float(ran.velocity[1, late:, 1].mean()),
            'forward_at_0.3': float(ran.velocity[1, late:, 0].mean())}

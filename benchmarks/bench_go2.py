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

"""The shipped Go2 in simulation, open loop: how far its gaits go and what they survive.

Beside it, in the same physics and at the same frequency, plain sines through a stand at 0.9 and
-1.8 rad: thigh 0.9 - 0.3 x, calf -1.8 - 0.45 max(0, tanh(3 y)), x and y the cosine and sine of a
leg's phase (bound at 1.5 Hz with the other sign of y). Untuned, they are what anyone would try
first.
"""

import math
import sys
import time

from common import emit, log, ROOT
from cpg_ros.motion.pattern import Pattern
from cpg_ros.motion.plan import GaitPlan, plan
from cpg_ros.motion.robot_file import read_robot
from cpg_ros.motion.strides import StrideCommand
from cpg_ros.networks.registry import PRESETS
from cpg_ros.simulation.bodies import OpenLoopBatch, targets
from cpg_ros.simulation.body import Body
from cpg_ros.simulation.run_metrics import RunMetrics
from cpg_ros.simulation.scenario import Scenario
import numpy as np

sys.path.append(str(ROOT / 'test' / 'support'))

from pattern_follower import Fallen, Follow, speed  # noqa: E402

DT, DURATION = 0.002, 10.0
GAITS = ('walk', 'trot', 'pace', 'bound', 'jump', 'pronk')
FAR = {'trot': 4.0, 'walk': 2.5, 'pace': 3.5, 'bound': 3.0, 'jump': 1.0, 'pronk': 1.0}
ROBOT = read_robot(ROOT / 'config' / 'unitree_go2.yaml')


def gait_plan(gait: str) -> GaitPlan:
    preset = PRESETS['delayed'][gait]
    return plan(ROBOT, gait, preset, preset.network, ROBOT.motion(gait, gait).frequency or 0.0)


def sines(made: GaitPlan) -> np.ndarray:
    """Plain formulas on the gait's phases, (steps, joints), with the same ramp of a second."""
    time_ = DT * np.arange(1, round(DURATION / DT) + 1)
    level = np.minimum(time_, 1.0)**2 * (3.0 - 2.0 * np.minimum(time_, 1.0))
    bound = made.gait == 'bound'
    phases = made.orbit.phases[ROBOT.leg_cells]
    columns = {}
    for joints, phase in zip(ROBOT.legs.values(), phases, strict=True):
        angle = 2.0 * math.pi * ((1.5 if bound else 2.5) * time_ + phase)
        y = (-1.0 if bound else 1.0) * -np.sin(angle)
        for joint, angles in zip(joints, (
                0.0 * time_, 0.9 - level * 0.3 * np.cos(angle),
                -1.8 - level * 0.45 * np.maximum(0.0, np.tanh(3.0 * y))), strict=True):
            columns[joint.name] = angles
    return np.stack([columns[name] for name in ROBOT.order], axis=1)


def pushed(batch: OpenLoopBatch, angles: np.ndarray, force: float) -> int:
    """How many of 20 seeds a run survives, each with four random pushes."""
    runs = []
    for seed in range(20):
        rng = np.random.default_rng(seed)
        pushes = tuple((when + rng.uniform(0.0, 1.0), force * math.cos(way), force * math.sin(way))
                       for when, way in ((2.0 * k, rng.uniform(-math.pi, math.pi))
                                         for k in range(1, 5)))
        runs.append((angles, Scenario(pushes=pushes)))
    return sum(trial.upright for trial in batch.run(runs))


def tour(body: Body, made: dict[str, GaitPlan]) -> str:
    """All 30 switches, one after the other, from standing: the first that fails, or ''."""
    for one in GAITS:
        for other in GAITS:
            if one == other:
                continue
            walk = Follow(body, Pattern(made[one]))
            try:
                walk.go(2.5)
                walk.pattern.apply(made[other], 1.0)
                walk.go(3.0)
            except Fallen as fall:
                return f'{one} to {other}: {fall}'
    return ''


def steered(body: Body, made: GaitPlan, forward: float, turn: float) -> tuple[float, float]:
    """Return the speeds and yaw rates that are reached for those commanded."""
    pattern = Pattern(made, strides=StrideCommand(4))
    pattern.steer(*made.steer(forward, turn))
    walk = Follow(body, pattern)
    walk.go(2.0)
    track = walk.go(8.0)
    return speed(track, DT), float(track[-1, 2] - track[0, 2]) / 8.0


def figures(trial: RunMetrics) -> dict[str, float | bool]:
    return {'distance_m': trial.distance, 'heading_deg': trial.heading, 'speed_m_s': trial.speed,
            'duty': trial.duty, 'hops': trial.hops, 'pitch_deg': trial.pitch,
            'cost_of_transport': trial.cost, 'slip': trial.slip, 'upright': trial.upright}


def main() -> int:
    batch, body = OpenLoopBatch('go2', ROBOT), Body('go2', ROBOT)
    made = {gait: gait_plan(gait) for gait in GAITS}
    angles = {gait: targets(made[gait], DURATION, DT) for gait in GAITS}
    log('six gaits and the plain formulas')
    began = time.perf_counter()
    trials = batch.run([(angles[gait], Scenario()) for gait in GAITS])
    steps = len(GAITS) * DURATION / DT / (time.perf_counter() - began)
    plain_angles = {gait: sines(made[gait]) for gait in GAITS}
    plain = batch.run([(plain_angles[gait], Scenario()) for gait in GAITS])
    log('pushes')
    survived = {f'{force:.0f}_N': pushed(batch, angles['trot'], force)
                for force in (20.0, 60.0, 90.0)}
    plain_survived = {f'{force:.0f}_N': pushed(batch, plain_angles['trot'], force)
                      for force in (20.0, 60.0, 90.0)}
    log('30 switches')
    failed = tour(body, made)
    log('steering')
    speeds = {f'{v:g}': steered(body, made['trot'], v, 0.0)[0] for v in (0.2, 0.3, 0.4)}
    turns = {f'{w:+g}': steered(body, made['trot'], 0.2, w)[1] for w in (-0.3, 0.3)}
    error = max(abs(found / float(asked) - 1.0) for asked, found in speeds.items())
    met = (all(trial.upright and abs(trial.heading) <= 20.0 and trial.distance >= FAR[gait]
               for gait, trial in zip(GAITS, trials, strict=True))
           and survived['20_N'] == 20 and not failed and error <= 0.2
           and all(float(asked) * found > 0.0 for asked, found in turns.items()))
    emit(benchmark='go2', gaits={gait: figures(one) for gait, one
                                 in zip(GAITS, trials, strict=True)},
         plain={gait: figures(one) for gait, one in zip(GAITS, plain, strict=True)},
         pushes_survived_of_20=survived, plain_pushes_survived_of_20=plain_survived,
         switches_failed=failed, trot_speeds=speeds, trot_turns=turns,
         largest_speed_error=error, physics_steps_per_s=steps, met=met)
    return 0 if met else 1


if __name__ == '__main__':
    sys.exit(main())

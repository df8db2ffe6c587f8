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

"""Leg odometry over 100 m: drift in percent of the way, and whether its covariance is true.

Robots walk at changing speeds and turning rates, half of them on a height field, some pushed, with
noisy sensors that are 4 ms late. NEES is the squared error of x and y over its covariance, 2 on
average where that is true. ``--robot`` and ``--model`` take another robot, as ``tune`` wrote it.
"""

import argparse
from pathlib import Path
import secrets
import time

from common import emit, log, ROOT
from cpg_ros.feedback.estimate import SensorData
from cpg_ros.feedback.gains import Gains
from cpg_ros.feedback.odometry import Odometry
from cpg_ros.motion.plan import plan
from cpg_ros.networks.registry import PRESETS
from cpg_ros.robots.robot_file import read_robot
from cpg_ros.simulation.closed_loop import ClosedLoop
from cpg_ros.simulation.efference_measurement import measure_efference
from cpg_ros.simulation.scenario import impulse, Scenario, SensorNoise
from cpg_ros.simulation.terrain import Terrain
import numpy as np
from scipy.stats import chi2

#: Way in m, longest time for it in s, time between changes of the command, s, largest push, N s.
WAY, LONGEST, CHANGE, PUSHED = 100.0, 420.0, 4.0, 12.0
SPEEDS, LEFT, TURN = (0.15, 0.4), 0.1, 0.4
NOISE = {'delay': 0.004, 'force_bias': 0.05, 'force_noise': 0.05, 'orientation_bias': 0.005,
         'gyroscope_noise': 0.02, 'gyroscope_bias': 0.002, 'accelerometer_noise': 0.1,
         'accelerometer_bias': 0.05}


def scenarios(rng: np.random.Generator, runs: int) -> list[Scenario]:
    """Draw commands, ground and pushes."""
    times = np.arange(CHANGE, LONGEST, CHANGE)
    return [Scenario(
        phase=rng.uniform(), speed=rng.uniform(*SPEEDS),
        commands=tuple((t, rng.uniform(*SPEEDS), rng.uniform(-LEFT, LEFT),
                        rng.uniform(-TURN, TURN)) for t in times),
        terrain=Terrain('height_field', 0.06, int(rng.integers(1000))) if k % 2 else None,
        pushes=(impulse(10.0, *rng.uniform(-PUSHED, PUSHED, 2)),) if k % 3 == 0 else ())
        for k in range(runs)]


def measure(loop: ClosedLoop, runs: int, seed: int) -> dict[str, object]:
    """Return drift in percent and NEES at the end of the way, of runs that did not fall."""
    expected = measure_efference(loop, SPEEDS)
    ran = loop.run(scenarios(np.random.default_rng(seed), runs), LONGEST, Gains(), expected,
                   SensorNoise(**NOISE, seed=seed))
    legs, joints = len(loop.program.robot.legs), len(loop.program.robot.joints)
    sensors, nothing = SensorData.zeros(1, legs, joints), np.zeros(legs, dtype=bool)
    drifts, errors = [], []
    for k in np.flatnonzero(ran.upright):
        made = Odometry(loop.geometry)
        for rpy, velocity, place in zip(ran.rpy[k], ran.estimated[k], ran.place[k], strict=True):
            sensors.rpy[0], reached = rpy, place
            made.advance(sensors, velocity, nothing, loop.timestep)
            if made.pose[5] >= WAY:
                break
        off = made.pose[:2] - (reached - ran.place[k, 0])
        drifts.append(float(100.0 * np.hypot(*off) / made.pose[5]))
        errors.append(float(off @ np.linalg.solve(made.covariance[:2, :2], off)))
    walked = ran.velocity[ran.upright, :, 0].sum() / ran.estimated[ran.upright, :, 0].sum()
    bounds = chi2.ppf([0.025, 0.975], 2 * len(errors)) / len(errors)
    return {'runs': runs, 'fell': int(runs - ran.upright.sum()), 'drift_percent': sorted(drifts),
            'true_over_estimated': float(walked), 'nees': float(np.mean(errors)),
            'nees_bounds': bounds.tolist()}


def main() -> None:
    """Measure gaits of a robot; print one JSON line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--robot', type=Path, default=ROOT / 'config' / 'unitree_go2.yaml')
    parser.add_argument('--model', default='go2')
    parser.add_argument('--gaits', nargs='+', default=['trot', 'walk'])
    parser.add_argument('--runs', type=int, default=8)
    parser.add_argument('--seed', type=int, default=secrets.randbelow(2**31))
    chosen = parser.parse_args()
    robot, found = read_robot(chosen.robot), {}
    for gait in chosen.gaits:
        began, preset = time.perf_counter(), PRESETS['delayed'][gait]
        made = plan(robot, gait, preset, preset.network, robot.motion(gait, gait).frequency)
        found[gait] = measure(ClosedLoop(chosen.model, made), chosen.runs, chosen.seed)
        log(f'{gait}: {found[gait]} ({time.perf_counter() - began:.0f} s)')
    emit(benchmark='odometry', model=chosen.model, seed=chosen.seed, way_m=WAY, **found)


if __name__ == '__main__':
    main()

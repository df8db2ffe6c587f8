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
noisy sensors that are 4 ms late and an IMU whose heading drifts by half a degree a minute. Speeds,
ground, pushes and gains are a Go2's; ``--size`` scales them to legs of other lengths. NEES is
the squared error of x and y over its covariance, 2 on average where that is true; both come for a
robot as it is, and for one whose scale was measured along a tape first. ``--robot`` and
``--model`` take another robot, as ``tune`` wrote it.
"""

import argparse
import math
from pathlib import Path
import secrets
import time

from common import emit, log, ROOT
from cpg_ros.feedback.estimate import advance_odometry, Odometry, SensorData
from cpg_ros.feedback.gains import GO2_LEG_LENGTH, scaled_gains
from cpg_ros.motion.plan import plan
from cpg_ros.motion.robot_file import read_robot
from cpg_ros.networks.registry import NETWORKS
from cpg_ros.simulation.closed_loop import ClosedLoopBatch
from cpg_ros.simulation.robot_setup.walk_recording import measure_efference
from cpg_ros.simulation.scenario import impulse, Outcome, Scenario, SensorNoise
from cpg_ros.simulation.terrain import Terrain
import numpy as np
from scipy.stats import chi2

#: Way in m, longest time for it in s, time between changes of the command, s, largest push, N s.
WAY, LONGEST, CHANGE, PUSHED = 100.0, 420.0, 4.0, 12.0
SPEEDS, LEFT, TURN = (0.15, 0.4), 0.1, 0.4
#: How long it walks along the tape at each of three speeds, s, and the standard deviation of a
#: scale that was measured so.
TAPE, MEASURED = 40.0, 0.015
#: Drift of the IMU's heading, rad/sqrt(s).
HEADING = math.radians(0.5) / math.sqrt(60.0)
NOISE = {'delay': 0.004, 'force_bias': 0.05, 'force_noise': 0.05, 'orientation_bias': 0.005,
         'gyroscope_noise': 0.02, 'gyroscope_bias': 0.002, 'accelerometer_noise': 0.1,
         'accelerometer_bias': 0.05}


def scenarios(rng: np.random.Generator, runs: int, size: float) -> list[Scenario]:
    """Draw commands, ground and pushes."""
    pace = math.sqrt(size)
    times = np.arange(CHANGE, LONGEST / pace, CHANGE)
    return [Scenario(
        phase=rng.uniform(), speed=pace * rng.uniform(*SPEEDS),
        commands=tuple((t, pace * rng.uniform(*SPEEDS), pace * rng.uniform(-LEFT, LEFT),
                        rng.uniform(-TURN, TURN)) for t in times),
        terrain=(Terrain('height_field', 0.06 * size, int(rng.integers(1000))) if k % 2
                 else None),
        pushes=((impulse(10.0, *(size**3 * pace * rng.uniform(-PUSHED, PUSHED, 2))),)
                if k % 3 == 0 else ()))
        for k in range(runs)]


def tape(loop: ClosedLoopBatch, expected: object, seed: int, size: float) -> float:
    """Return true divided by estimated distance, as measured straight along a tape."""
    speeds = math.sqrt(size) * np.linspace(*SPEEDS, 3)
    ran = loop.run([Scenario(speed=speed) for speed in speeds], TAPE,
                   scaled_gains(size * GO2_LEG_LENGTH), expected, SensorNoise(**NOISE, seed=seed))
    walked = loop.timestep * ran.estimated[:, :, 0].sum(axis=1)
    ways = np.linalg.norm(ran.place[:, -1] - ran.place[:, 0], axis=1)
    return float(np.mean(ways / walked))


def measure(loop: ClosedLoopBatch, expected: object, args: argparse.Namespace, scale: float
            ) -> dict[str, object]:
    """Return drift in percent and NEES at the end of the way, of runs that did not fall."""
    runs, seed, size = args.runs, args.seed, args.size
    ran = loop.run(scenarios(np.random.default_rng(seed), runs, size), LONGEST / math.sqrt(size),
                   scaled_gains(size * GO2_LEG_LENGTH), expected, SensorNoise(**NOISE, seed=seed))
    found: dict[str, object] = {'runs': runs, 'fell': int(runs - ran.upright.sum())}
    for name, how in (('as_it_is', ()), ('measured', (scale, MEASURED))):
        drifts, errors = [], []
        for k in np.flatnonzero(ran.upright):
            made, reached = _follow(loop, ran, k, how, np.random.default_rng((seed, k)))
            off = made.pose[:2] - (reached - ran.place[k, 0])
            drifts.append(float(100.0 * np.hypot(*off) / made.pose[5]))
            errors.append(float(off @ np.linalg.solve(made.covariance[:2, :2], off)))
        bounds = chi2.ppf([0.025, 0.975], 2 * len(errors)) / len(errors)
        found[name] = {'drift_percent': sorted(drifts), 'nees': float(np.mean(errors)),
                       'nees_bounds': bounds.tolist()}
    return found


def _follow(loop: ClosedLoopBatch, ran: Outcome, k: int, how: tuple[float, ...],
            rng: np.random.Generator) -> tuple[Odometry, np.ndarray]:
    """Return the odometry at the end of one run's way, and where the base is then, m, (2,)."""
    legs, joints = len(loop.plan.robot.legs), len(loop.plan.robot.joints)
    sensors, nothing = SensorData.zeros(1, legs, joints), np.zeros(legs, dtype=bool)
    made, legs_of = Odometry.begin(*how), loop.geometry.arrays
    off = HEADING * math.sqrt(loop.timestep) * np.cumsum(rng.standard_normal(len(ran.rpy[k])))
    step = 0
    while step < len(ran.rpy[k]) - 1 and made.pose[5] < WAY:
        sensors.rpy[0] = ran.rpy[k, step] + [0.0, 0.0, off[step]]
        advance_odometry(made, legs_of, sensors, ran.estimated[k, step], nothing, loop.timestep)
        step += 1
    return made, ran.place[k, step]


def main() -> None:
    """Measure gaits of a robot; print one JSON line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--robot', type=Path, default=ROOT / 'config' / 'unitree_go2.yaml')
    parser.add_argument('--model', default='go2')
    parser.add_argument('--size', type=float, default=1.0, help="length of the legs over a Go2's")
    parser.add_argument('--gait', dest='gaits', nargs='+', default=['trot', 'walk'])
    parser.add_argument('--runs', type=int, default=8)
    parser.add_argument('--seed', type=int, default=secrets.randbelow(2**31))
    args = parser.parse_args()
    robot, loops = read_robot(args.robot), {}
    for gait in args.gaits:
        preset = NETWORKS[robot.networks[0]].presets()[gait]
        made = plan(robot, gait, preset, preset.network, robot.motion(gait, gait).frequency)
        loop = ClosedLoopBatch(args.model, made)
        loops[gait] = loop, measure_efference(loop, math.sqrt(args.size) * np.array(SPEEDS))
    scales = {gait: tape(*loops[gait], args.seed + 1, args.size) for gait in loops}
    log(f'by the tape: {scales}')
    found = {}
    for gait in loops:
        began = time.perf_counter()
        found[gait] = measure(*loops[gait], args, float(np.mean(list(scales.values()))))
        log(f'{gait}: {found[gait]} ({time.perf_counter() - began:.0f} s)')
    emit(benchmark='odometry', model=args.model, size=args.size, seed=args.seed, way_m=WAY,
         scales=scales, scale_error=MEASURED, **found)


if __name__ == '__main__':
    main()

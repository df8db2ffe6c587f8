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

"""The Go2 with feedback where it is not the model: joints, IMU, servos, rates, masses, floors.

Each row changes the body, its servos or its sensors; the gait, the efference copy and the gains
stay. It asks for 0.4 m/s (``--speed``) and pushes for 0.1 s from 12 directions at two phases. Of
each row: speed, tilt, cost of transport, drift to the side, and pushes survived. The pushes are
the same in all rows. With ``--biped`` a humanoid walks at 0.3 m/s instead, with noise and errors
of its sensors.
"""

import argparse
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
import math
import secrets
import time
from types import MappingProxyType
from typing import Any, NamedTuple

from bench_humanoid import NOISE
from common import emit, log, ROOT
from cpg_ros.feedback.gains import robot_gains
from cpg_ros.motion.robot_file import load_robot, read_robot
from cpg_ros.simulation.biped_run import BipedRun
from cpg_ros.simulation.closed_loop import ClosedLoopBatch
from cpg_ros.simulation.robot_model import engine
from cpg_ros.simulation.scenario import impulse, Scenario, SensorNoise
from feedback_figures import AFTER, interval, subject
import numpy as np

GO2 = ROOT / 'config' / 'unitree_go2.yaml'
#: Of a usual floor; time of the steady walk, s, and its first part that is ignored, s.
FRICTION, WALK, BEGINNING = 0.8, 14.0, 8.0
#: Time of the pushes, s: by then the feedback knows the servos' gains.
PUSHED = 6.0


class Row(NamedTuple):
    """An error of the model.

    Attributes:
        noise: of the sensors.
        scenario: what differs from the usual one.
        change: changes the body's model in place.
        rate: of feedback and pattern, Hz.

    """

    noise: Mapping[str, Any] = MappingProxyType({})
    scenario: Mapping[str, float] = MappingProxyType({})
    change: Callable[[ClosedLoopBatch, np.random.Generator], None] = lambda loop, rng: None
    rate: float = 500.0


def zeros(size: float, loop: ClosedLoopBatch, rng: np.random.Generator) -> None:
    """Move the zero of every joint by a size, rad, up or down; encoder and servo agree."""
    model = loop.body.model
    joints = model.jnt_qposadr[model.jnt_qposadr >= 7]
    model.qpos0[joints] += size * rng.choice([-1.0, 1.0], joints.size)


def weak(factor: float, loop: ClosedLoopBatch, rng: np.random.Generator) -> None:
    """Give one motor, the knee of the right hind leg, a fraction of its torque."""
    model = loop.body.model
    name = engine().mjtObj.mjOBJ_JOINT
    joint = engine().mj_name2id(model, name, 'RR_calf_joint')
    motor = int(np.flatnonzero(model.actuator_trnid[:, 0] == joint)[0])
    model.actuator_gainprm[motor, 0] *= factor
    model.actuator_biasprm[motor, 1:3] *= factor
    model.actuator_forcerange[motor] *= factor


def centre(forward: float, left: float, loop: ClosedLoopBatch, rng: np.random.Generator) -> None:
    """Move the centre of mass of the trunk, m."""
    model = loop.body.model
    model.body_ipos[loop.parts.base, :2] += forward, left
    engine().mj_setConst(model, engine().MjData(model))


def rub(factor: float, loop: ClosedLoopBatch, rng: np.random.Generator) -> None:
    """Multiply the dry friction of the joints."""
    loop.body.model.dof_frictionloss[6:] *= factor


def rotors(factor: float, loop: ClosedLoopBatch, rng: np.random.Generator) -> None:
    """Multiply the inertia of the motors' rotors."""
    loop.body.model.dof_armature[6:] *= factor


ROWS: dict[str, Row] = {
    'as modelled': Row(),
    **{f'zeros of joints ±{size:g} rad': Row(change=partial(zeros, size))
       for size in (0.03, 0.06)},
    **{f'IMU tilted by {size:g} rad': Row({'orientation_bias': size}) for size in (0.02, 0.04)},
    **{f'a knee with {100 * factor:g} % torque': Row(change=partial(weak, factor))
       for factor in (0.8, 0.6)},
    **{f'{key} x {factor:g}': Row(scenario={key: factor})
       for key in ('kp', 'kd') for factor in (0.5, 0.7, 1.5, 2.0)},
    **{f'{rate:g} Hz': Row(rate=rate) for rate in (100.0, 200.0, 1000.0)},
    **{f'sensors {late:g} ms late': Row({'delay': 1e-3 * late}) for late in (6, 14, 20)},
    **{f'payload {mass:g} kg': Row(scenario={'payload': mass}) for mass in (3.0, 5.0)},
    **{f'all masses x {factor:g}': Row(scenario={'mass': factor}) for factor in (0.85, 1.15)},
    'centre of mass 3 cm ahead': Row(change=partial(centre, 0.03, 0.0)),
    'centre of mass 3 cm to the left': Row(change=partial(centre, 0.0, 0.03)),
    **{f'friction of joints x {factor:g}': Row(change=partial(rub, factor))
       for factor in (0.0, 2.0)},
    **{f'inertia of rotors x {factor:g}': Row(change=partial(rotors, factor))
       for factor in (0.5, 2.0)},
    **{f'friction of the ground {mu:g}': Row(scenario={'friction': mu}) for mu in (0.4, 1.2)},
    'a foot sensor stuck at 0 N': Row({'stuck': 0.0}),
    'a foot sensor stuck at 80 N': Row({'stuck': 80.0})}


#: Rows of a biped, by changes of its sensors' noise; duration of each run, s.
BIPED: dict[str, dict[str, float]] = {
    'as modelled': {},
    **{f'roll and pitch wrong by {size:g} rad': {'orientation_bias': size}
       for size in (0.02, 0.04)},
    'IMU mounted at a tilt of 0.04 rad': {'imu_tilt': 0.04},
    **{f'sensors {late:g} ms late': {'delay': 1e-3 * late} for late in (10, 14, 20)},
    'roll and pitch wrong by 0.04 rad, sensors 14 ms late': {'orientation_bias': 0.04,
                                                             'delay': 0.014},
    'IMU mounted at a tilt of 0.04 rad, sensors 14 ms late': {'imu_tilt': 0.04, 'delay': 0.014},
    'a foot sensor stuck at 100 N': {'stuck': 100.0}}
BIPED_WALK = 12.0


def held(loop: ClosedLoopBatch, rate: float) -> None:
    """Let feedback and pattern run at a rate in Hz, and the physics take steps in between."""
    steps = round(1.0 / (rate * loop.timestep))
    if steps < 1:
        loop.timestep = loop.body.model.opt.timestep = 1.0 / rate
    if steps <= 1:
        return
    loop.timestep = steps * loop.body.model.opt.timestep
    once = loop.rollout

    def rollout(models: Any, state: np.ndarray, control: np.ndarray,
                warmstart: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
        after, sensed = once(models, state, np.repeat(control, steps, axis=1), warmstart)
        return after[:, -1:], sensed[:, -1:]
    loop.rollout = rollout  # type: ignore[method-assign]


def measure(row: Row, args: argparse.Namespace) -> dict[str, Any]:
    """Return the figures of a row."""
    gains = robot_gains(read_robot(GO2))._replace(servo_gains=not args.without)
    one = subject(GO2, args.gait, gains, args.seed, args.quick)
    rng = np.random.default_rng(args.seed)
    row.change(one.loop, rng)
    held(one.loop, row.rate)
    one.noise = SensorNoise(**{'delay': 1e-3 * args.late, **row.noise}, seed=args.seed)
    usual = {'friction': FRICTION, 'speed': args.speed, **row.scenario}
    walk = one.run([Scenario(**usual, phase=k / 4) for k in range(2 if args.quick else 4)], WALK)
    late = slice(round(BEGINNING / one.loop.timestep), None)
    directions, phases = (4, 2) if args.quick else (12, 2)
    draws = np.random.default_rng([args.seed, 1])
    found: dict[str, Any] = {
        'walks upright': f'{int(walk.upright.sum())} of {len(walk.upright)}',
        'speed, m/s': float(walk.velocity[:, late, 0].mean()),
        'tilt, degrees': float(np.degrees(np.abs(walk.rpy[:, late, :2]).max(axis=(1, 2)).mean())),
        'cost of transport': float(walk.cost.mean()),
        'aside, m/s': float(walk.velocity[:, late, 1].mean()),
        'pushes of': directions * phases}
    for size in args.impulses:
        first = draws.uniform(0.0, 2.0 * math.pi)
        share = float(one.run([Scenario(**usual, phase=draws.uniform(), pushes=(impulse(
            PUSHED, size * math.cos(way), size * math.sin(way)),))
            for way in first + 2.0 * math.pi * np.arange(directions) / directions
            for _ in range(phases)], PUSHED + AFTER).upright.mean())
        found[f'{size:g} N s'] = share
        found[f'{size:g} N s, 95 %'] = interval(share, directions * phases)
    return found


def measure_biped(run: BipedRun, changes: dict[str, float], args: argparse.Namespace
                  ) -> dict[str, Any]:
    """Return the figures of a row of a biped; seeds of the runs count from the given one on."""
    run.noise = replace(NOISE, **changes)
    ran = [run.run(BIPED_WALK, ((1.0, 0.3, 0.0, 0.0),), seed=args.seed + k)
           for k in range(2 if args.quick else 6)]
    falls = [one.fell for one in ran if math.isfinite(one.fell)]
    return {'falls': f'{len(falls)} of {len(ran)}'
            + (f', after {min(falls):.1f} s' if falls else ''),
            'speed, m/s': float(np.mean([one.speed[0] for one in ran])),
            'aside, m/s': float(np.mean([abs(one.speed[1]) for one in ran])),
            'tilt, degrees': math.degrees(float(np.mean([one.tilt for one in ran])))}


def table(rows: dict[str, dict[str, Any]]) -> str:
    """Return the figures in Markdown, a row each."""
    keys = [key for key in next(iter(rows.values())) if not key.endswith('95 %')]
    lines = [['', *keys], ['---'] * (1 + len(keys))]
    for name, found in rows.items():
        lines.append([name, *(f'{100.0 * found[key]:.0f} %' if key.endswith('N s') else
                              f'{found[key]:.2f}' if isinstance(found[key], float) else
                              str(found[key]) for key in keys)])
    return '\n'.join(f'| {" | ".join(line)} |' for line in lines)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--gait', default='trot', help='(default: %(default)s)')
    parser.add_argument('--speed', type=float, default=0.4, metavar='M/S',
                        help='asked for (default: %(default)s)')
    parser.add_argument('--impulses', type=float, nargs='+', default=[30.0, 40.0], metavar='NS',
                        help='of the pushes, N s (default: 30 40)')
    parser.add_argument('--rows', nargs='+', default=list(ROWS), choices=list(ROWS),
                        metavar='ROW', help='; '.join(ROWS).replace('%', '%%'))
    parser.add_argument('--late', type=float, default=0.0, metavar='MS',
                        help='delay of all sensors (default: %(default)g)')
    parser.add_argument('--without', action='store_true', help='without the law servo_gains')
    parser.add_argument('--biped', choices=['unitree_g1', 'humanoid'],
                        help='a biped instead, with rows of its own')
    parser.add_argument('--quick', action='store_true', help='few runs: a look')
    parser.add_argument('--seed', type=int, default=None, help='a fresh one if not given')
    args = parser.parse_args()
    args.seed = secrets.randbelow(2**31) if args.seed is None else args.seed
    log(f'seed {args.seed}')
    rows = {}
    walks = args.biped and BipedRun(args.biped, load_robot(args.biped), NOISE)
    for name in BIPED if walks else args.rows:
        began = time.perf_counter()
        rows[name] = (measure_biped(walks, BIPED[name], args) if walks else
                      measure(ROWS[name], args))
        log(f'{name}: {rows[name]} ({time.perf_counter() - began:.0f} s)')
    log(table(rows))
    emit(benchmark='model_errors', robot=args.biped or 'go2', gait=args.gait, speed=args.speed,
         seed=args.seed, quick=args.quick, late=args.late, without=args.without, rows=rows)
    return 0


if __name__ == '__main__':
    raise SystemExit(main())

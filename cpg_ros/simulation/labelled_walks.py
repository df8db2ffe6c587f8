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

"""Walks for a labelled data set: what a gait meets in simulation, and what is true of each run."""

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
import math
from typing import Any

from cpg_ros.errors import InputError
from cpg_ros.feedback.estimate import SensorData
from cpg_ros.feedback.froude_scaling import robot_gains
from cpg_ros.motion.plan import GaitPlan, plan
from cpg_ros.networks.registry import PRESETS
from cpg_ros.robots.robot import Robot
from cpg_ros.short_repr import ShortRepr
from cpg_ros.simulation.closed_loop import ClosedLoop
from cpg_ros.simulation.scenario import impulse, PUSH, Scenario, SensorNoise
from cpg_ros.simulation.terrain import Terrain
import numpy as np

#: Pushes of these impulses, N s, so far apart and so long before the end, s; rough ground, m.
PUSHES, APART, BEFORE, ROUGH = (8.0, 20.0), 4.0, 1.0, 0.03
#: A foot that bears less than this share of the weight does not stand.
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
        preset = presets[gait]
        yield plan(robot, gait, preset, preset.network, robot.motions[gait].frequency or 1.0)


def walks(program: GaitPlan, model: str, seconds: float, seed: Sequence[int]
          ) -> list[LabelledWalk]:
    """Let a gait walk on flat ground, pushed, and on rough ground, with its robot's feedback.

    Args:
        program: the gait, at full strides, so that frequency and readout are those planned.
        model: of the robot's body.
        seconds: how long.
        seed: of pushes, friction, ground and noise.

    Raises:
        CpgError: see `ClosedLoop`.

    """
    met = _scenarios(np.random.default_rng(seed), seconds, program.own_speed)
    loop = ClosedLoop(model, program)
    gains = None if program.motion.efference is None else robot_gains(program.robot)
    ran = loop.run(list(met.values()), seconds, gains, noise=SensorNoise(**NOISE, seed=seed[0]),
                   keep_senses=True)
    assert ran.senses is not None and ran.efforts is not None
    found = []
    for run, (ground, scenario) in enumerate(met.items()):
        steps = ran.senses.foot_forces.shape[1]
        if np.isfinite(ran.fell[run]):
            steps = round(float(ran.fell[run]) / loop.timestep)
        senses = SensorData(*(np.ascontiguousarray(one[run, :steps]) for one in ran.senses))
        found.append(LabelledWalk(ground, senses, ran.efforts[run, :steps], loop.timestep, _truth(
            program, scenario, float(ran.fell[run]),
            senses.foot_forces[steps // 3:] > LOADED * loop.geometry.weight)
            | {'servo': _gains(loop)}))
    return found


def _gains(loop: ClosedLoop) -> dict[str, float]:
    """Return the gains of the servos, N m/rad and N m s/rad."""
    model = loop.body.model
    return {'kp': float(model.actuator_gainprm[0, 0]), 'kd': float(-model.actuator_biasprm[0, 2])}


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


def _truth(program: GaitPlan, scenario: Scenario, fell: float, stands: np.ndarray
           ) -> dict[str, Any]:
    """Return what is true; when it fell, s, and whether each foot stands, shape (n, legs)."""
    robot, network = program.robot, program.orbit.network
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
            'duty': dict(zip(robot.legs, np.round(stands.mean(axis=0), 3).tolist(), strict=True))}

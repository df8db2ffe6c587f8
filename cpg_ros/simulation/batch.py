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

"""Many runs at once, open loop: what a program publishes, and bodies that follow it on all cores.

Physics is MuJoCo's own ``rollout``, native threads; nothing is fed back, so that all of a run's
targets are known beforehand.
"""

from collections.abc import Callable, Sequence
import copy
from dataclasses import dataclass
import os
from typing import Any

from cpg_ros.motion.pattern import Pattern
from cpg_ros.motion.plan import Program
from cpg_ros.motion.steering import Drive
from cpg_ros.robots.robot import Robot
from cpg_ros.simulation.body import Body
from cpg_ros.simulation.model_indices import Anatomy
from cpg_ros.simulation.robot_model import engine
from cpg_ros.simulation.run_metrics import judge, RunMetrics
import numpy as np

#: A push lasts this long, s.
PUSH = 0.1
#: Runs whose states are kept at the same time.
TOGETHER = 12


@dataclass(frozen=True)
class Scenario:
    """What a robot meets.

    Attributes:
        friction: between feet and floor.
        mass: factor on the mass of every link.
        pushes: each (s, N, N): when, and the force on the base forward and to the left.

    """

    friction: float = 1.0
    mass: float = 1.0
    pushes: tuple[tuple[float, float, float], ...] = ()


def targets(program: Program, duration: float, timestep: float,
            strides: Sequence[float] = (), pace: float = 1.0, ramp: float = 1.0) -> np.ndarray:
    """Work out the angles that a generator publishes from the stand on.

    The ramp is the generator's own; after it the orbit is what it is, and is looked up.

    Args:
        program: the gait.
        duration: s.
        timestep: of the generator, s.
        strides: factor of each leg's stride; none for the gait as it is.
        pace: factor of the frequency.
        ramp: from the stand into the gait, s.

    Returns:
        Angles in rad in the order of the robot's controllers, shape (steps, joints).

    """
    robot = program.robot
    drive, stride = None, np.ones(len(robot.legs))
    if len(strides) or pace != 1.0:
        drive, stride = Drive(stride.size), np.array(strides or stride, dtype=float)
        drive.ask(stride, pace, at_once=True)
    pattern = Pattern(program, ramp, drive=drive)
    steps = round(duration / timestep)
    found = np.empty((steps, len(robot.order)))
    done = 0
    while done < steps and pattern.level < 1.0:
        pattern.advance(timestep)
        found[done] = pattern.position
        done += 1
    if done < steps:
        ahead = (pattern.phases[0] - program.readout.start
                 + program.frequency * pace * timestep * np.arange(1, steps - done + 1))
        still, stride = program.in_place.angles, stride[robot.leg_of_joint, None]
        angles = still + stride * (program.readout.angles - still)
        base = robot.column('offset') + program.shift
        found[done:] = (base[:, None] + _periodic(angles, program, ahead)).T
    return found[:, robot.places]


def _periodic(angles: np.ndarray, program: Program, theta: np.ndarray) -> np.ndarray:
    """Look each joint up at phases of the orbit in cycles; (joints, m) -> (joints, n)."""
    grid = np.arange(angles.shape[1] + 1) / angles.shape[1]
    ahead = program.orbit.phases[program.robot.cells]
    return np.array([np.interp((theta + phase) % 1.0, grid, np.append(row, row[0]))
                     for row, phase in zip(angles, ahead, strict=True)])


class Batch:
    """Bodies of one robot, as many as there are cores.

    Attributes:
        body: one of them, for its model and its stand.
        parts: where its parts are in the model.
        timestep: s.

    """

    def __init__(self, name: str, robot: Robot, kp: float | None = None,
                 kd: float | None = None, timestep: float = 0.002, threads: int = 0,
                 say: Callable[[str], None] = lambda line: None) -> None:
        """Load the model; arguments as of ``robot_model.load``; threads: 0 for all cores.

        Raises:
            SimulationError: MuJoCo is missing, or the model cannot be used.

        """
        mujoco = engine()
        from mujoco import rollout
        self.body = Body(name, robot, kp, kd, timestep, say=say)
        self.parts = Anatomy(self.body)
        self.timestep = timestep
        self._models: dict[tuple[float, float], Any] = {}
        self._threads = threads or (
            len(os.sched_getaffinity(0)) if hasattr(os, 'sched_getaffinity')
            else os.cpu_count() or 1)
        self._data = [mujoco.MjData(self.body.model) for _ in range(self._threads)]
        self._pool = rollout.Rollout(nthread=self._threads)
        full = mujoco.mjtState.mjSTATE_FULLPHYSICS
        self._start = np.empty(mujoco.mj_stateSize(self.body.model, full))
        mujoco.mj_getState(self.body.model, self.body.data, self._start, full)

    def run(self, runs: Sequence[tuple[np.ndarray, Scenario]]) -> list[RunMetrics]:
        """Let bodies follow targets from the stand, and judge each run.

        Args:
            runs: targets of the joints, rad, shape (steps, joints), and what is met; all as long.

        """
        mujoco, model = engine(), self.body.model
        spec = int(mujoco.mjtState.mjSTATE_CTRL | mujoco.mjtState.mjSTATE_XFRC_APPLIED)
        base, joints = self.parts.base, model.nu
        found = []
        for first in range(0, len(runs), TOGETHER):
            part = runs[first:first + TOGETHER]
            steps = len(part[0][0])
            control = np.zeros((len(part), steps, joints + 6 * model.nbody))
            for one, (angles, scenario) in zip(control, part, strict=True):
                one[:, :joints] = angles
                for when, forward, left in scenario.pushes:
                    begun = round(when / self.timestep)
                    during = slice(begun, begun + round(PUSH / self.timestep))
                    one[during, joints + 6 * base:joints + 6 * base + 2] += forward, left
            state, sensors = self._pool.rollout(
                [self._model(scenario) for _, scenario in part], self._data,
                np.tile(self._start, (len(part), 1)), control, control_spec=spec)
            found += [judge(self.body, self.parts, angles, scenario.mass, one, sensed)
                      for (angles, scenario), one, sensed
                      in zip(part, state, sensors, strict=True)]
        return found

    def _model(self, scenario: Scenario) -> Any:
        key = (scenario.friction, scenario.mass)
        if key not in self._models:
            mujoco = engine()
            model = copy.copy(self.body.model)
            # Of two geoms in contact the larger friction counts.
            floor = model.geom_bodyid == 0
            sliding = model.geom_friction[:, 0]
            sliding[:] = np.where(floor, scenario.friction,
                                  np.minimum(sliding, scenario.friction))
            model.body_mass[:] *= scenario.mass
            model.body_inertia[:] *= scenario.mass
            mujoco.mj_setConst(model, mujoco.MjData(model))
            self._models[key] = model
        return self._models[key]

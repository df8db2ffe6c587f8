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

"""Bodies of one robot that step the physics together, each on its own ground.

The physics is MuJoCo's ``rollout``, with native threads.
"""

from collections.abc import Callable, Sequence
import copy
import os
from typing import Any

from cpg_ros.motion.pattern import Pattern
from cpg_ros.motion.plan import GaitPlan
from cpg_ros.motion.robot import Robot
from cpg_ros.motion.strides import StrideCommand
from cpg_ros.simulation.body import add_payload, Anatomy, Body
from cpg_ros.simulation.robot_model import engine
from cpg_ros.simulation.run_metrics import metrics_of, RunMetrics
from cpg_ros.simulation.scenario import Scenario
from cpg_ros.simulation.terrain import lay, set_friction, Terrain
import numpy as np

#: KP_DIGITS: decimals of a changing factor of the servos' gains, each value of which is a model.
KP_DIGITS = 1


class BatchPhysics:
    """Bodies of one robot, all of which begin in the stand.

    Attributes:
        body: one of them, for its model and its stand.
        parts: indices of its parts in the model.
        timestep: s.
        start: state in the stand, as of mjSTATE_FULLPHYSICS, shape (states,).

    """

    def __init__(self, body: Body, threads: int) -> None:
        """Prepare to step bodies like this one on some threads, 0 for all cores."""
        mujoco = engine()
        from mujoco import rollout
        self.body, self.parts, self.timestep = body, Anatomy(body), body.model.opt.timestep
        threads = threads or (len(os.sched_getaffinity(0)) if hasattr(os, 'sched_getaffinity')
                              else os.cpu_count() or 1)
        self._data = [mujoco.MjData(body.model) for _ in range(threads)]
        self._pool = rollout.Rollout(nthread=threads)
        self._models: dict[tuple[float | Terrain | None, ...], Any] = {}
        self._spec = int(mujoco.mjtState.mjSTATE_CTRL | mujoco.mjtState.mjSTATE_XFRC_APPLIED)
        full = mujoco.mjtState.mjSTATE_FULLPHYSICS
        body.reset()
        self.start = np.empty(mujoco.mj_stateSize(body.model, full))
        mujoco.mj_getState(body.model, body.data, self.start, full)

    def controls(self, runs: int, steps: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the control inputs of bodies, all zero, and views of two parts of them.

        Returns:
            Inputs for ``rollout``, shape (runs, steps, numbers); targets of the joints, rad, shape
                (runs, steps, joints); force on the base forward and to the left, N, shape (runs,
                steps, 2).

        """
        model = self.body.model
        control = np.zeros((runs, steps, model.nu + 6 * model.nbody))
        base = model.nu + 6 * self.parts.base
        return control, control[:, :, :model.nu], control[:, :, base:base + 2]

    def rollout(self, models: Sequence[Any], state: np.ndarray, control: np.ndarray,
                warmstart: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
        """Take steps from states, (runs, states); return states and sensors after each."""
        return self._pool.rollout(models, self._data, state, control, control_spec=self._spec,
                                  initial_warmstart=warmstart)

    def model(self, scenario: Scenario, kp_scale: float = 1.0) -> Any:
        """Return the model of a body in a scenario, with the servos' kp scaled."""
        kp = scenario.kp * kp_scale
        key = (scenario.friction, scenario.mass, scenario.payload, scenario.terrain, kp,
               scenario.kd)
        if key not in self._models:
            mujoco, model = engine(), copy.copy(self.body.model)
            set_friction(model, scenario.friction)
            model.actuator_gainprm[:, 0] *= kp
            model.actuator_biasprm[:, 1:3] *= kp, scenario.kd
            if scenario.mass != 1.0:
                model.body_mass[:] *= scenario.mass
                model.body_inertia[:] *= scenario.mass
            if scenario.payload:
                add_payload(model, self.parts.base, scenario.payload)
            if scenario.mass != 1.0 or scenario.payload:
                mujoco.mj_setConst(model, mujoco.MjData(model))
            if scenario.terrain is not None:
                lay(model, scenario.terrain)
            self._models[key] = model
        return self._models[key]


# Many runs at once, open loop: what a plan publishes, and bodies that follow it on all cores.

#: BATCH_SIZE: number of runs whose states are in memory at the same time.
BATCH_SIZE = 12


def targets(plan: GaitPlan, duration: float, timestep: float,
            strides: Sequence[float] = (), pace: float = 1.0, ramp: float = 1.0) -> np.ndarray:
    """Return the angles that a generator publishes from the stand.

    Args:
        plan: the gait.
        duration: s.
        timestep: of the generator, s.
        strides: factor of each leg's stride; empty for the gait's own.
        pace: factor of the frequency.
        ramp: from the stand into the gait, s.

    Returns:
        Angles, rad, in the order of the robot's controllers, shape (steps, joints).

    """
    robot = plan.robot
    command, stride = None, np.ones(len(robot.legs))
    if len(strides) or pace != 1.0:
        command, stride = StrideCommand(stride.size), np.array(strides or stride, dtype=float)
        command.set_target(stride, pace, at_once=True)
    pattern = Pattern(plan, ramp, strides=command)
    table = np.empty((round(duration / timestep), len(robot.order)))
    for row in table:
        pattern.advance(timestep)
        row[:] = pattern.position
    return table[:, robot.order_indices]


class OpenLoopBatch(BatchPhysics):
    """Bodies of one robot without feedback, one for each core at a time."""

    def __init__(self, name: str, robot: Robot, kp: float | None = None,
                 kd: float | None = None, timestep: float = 0.002, threads: int = 0,
                 say: Callable[[str], None] = lambda line: None) -> None:
        """Load the model; arguments as of ``robot_model.load``; threads: 0 for all cores.

        Raises:
            SimulationError: MuJoCo is missing, or the model cannot be used.

        """
        super().__init__(Body(name, robot, kp, kd, timestep, say=say), threads)

    def run(self, runs: Sequence[tuple[np.ndarray, Scenario]]) -> list[RunMetrics]:
        """Let bodies follow targets from the stand, and return the metrics of each run.

        Args:
            runs: targets of the joints, rad, shape (steps, joints), and scenario of each run, all
                of one length.

        """
        outcomes = []
        for first in range(0, len(runs), BATCH_SIZE):
            part = runs[first:first + BATCH_SIZE]
            control, joints, force = self.controls(len(part), len(part[0][0]))
            for k, (angles, scenario) in enumerate(part):
                joints[k], force[k] = angles, scenario.forces(len(angles), self.timestep)
            models = [self.model(scenario) for _, scenario in part]
            state, sensors = self.rollout(models, np.tile(self.start, (len(part), 1)), control)
            outcomes += [metrics_of(self.body, self.parts, angles, model, run, sensed)
                         for (angles, _), model, run, sensed
                         in zip(part, models, state, sensors, strict=True)]
        return outcomes

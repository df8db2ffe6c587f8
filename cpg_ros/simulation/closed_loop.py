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

"""Many bodies at once with feedback, or without it: pushed, on rough ground, on slopes.

All of them take a step of physics together, a ``rollout`` of one step, and one ``Feedback`` of as
many runs takes their sensor data. A run that has ended takes no more steps.
"""

from collections.abc import Callable, Mapping, Sequence
import math

from cpg_ros.feedback.efference_copy import EfferenceCopy
from cpg_ros.feedback.estimate import BodyState, SensorData
from cpg_ros.feedback.feedback import Feedback
from cpg_ros.feedback.gains import Gains
from cpg_ros.feedback.kinematics import geometry_of
from cpg_ros.feedback.laws.virtual_stiffness import stretch
from cpg_ros.feedback.tick import PlannedMotion
from cpg_ros.motion.pattern import Pattern
from cpg_ros.motion.plan import GaitPlan
from cpg_ros.motion.strides import StrideCommand
from cpg_ros.simulation.bodies import BatchPhysics
from cpg_ros.simulation.body import Body, FALLEN
from cpg_ros.simulation.robot_setup.model_reading import geometry_from, load_description
from cpg_ros.simulation.run_metrics import BEGINNING, cost_of_transport, motor_power, torques
from cpg_ros.simulation.scenario import Outcome, Scenario, SensorNoise
from cpg_ros.simulation.sensors import fill_sensor_data, NoisySenses
from cpg_ros.simulation.terrain import add_ground
import numpy as np

# The patterns of many runs: ramped in, steered, switched, corrected, held to limits.

#: RAMP: duration of the ramp from the stand into the gait, s; TRANSITION: duration of a gait
#: switch, s.
RAMP, TRANSITION = 1.0, 1.0


class Patterns:
    """As many patterns as runs, which know the same gaits.

    Attributes:
        planned: the motion before any correction; its arrays are overwritten by plan.

    """

    def __init__(self, plans: Mapping[str, GaitPlan], feedback: Feedback,
                 scenarios: Sequence[Scenario], dt: float, trimmed: bool) -> None:
        """Stand; all runs, one a scenario, begin with the first plan.

        ``dt`` is that of a tick, s; if ``trimmed``, the feedback changes strides and clocks.
        """
        self._plans, self._feedback, self._dt, self._trimmed = plans, feedback, dt, trimmed
        first, runs = next(iter(plans.values())), len(scenarios)
        self._patterns = [Pattern(first, RAMP, strides=StrideCommand(len(first.robot.legs)))
                          for _ in scenarios]
        self.planned = PlannedMotion.zeros(runs, len(first.robot.joints))
        self.planned.velocity[:, 0] = [scenario.speed for scenario in scenarios]
        self._position = self.planned.angles.copy()
        for run, (pattern, scenario) in enumerate(zip(self._patterns, scenarios, strict=True)):
            pattern.begin_at(scenario.phase)
            if any(scenario.pose):
                pattern.body.go_to(scenario.pose, RAMP)
            if trimmed and pattern.strides is not None:
                pattern.strides.trim = feedback.memory.stride[run]
            self._steer(run, first)
        self._time = 0.0
        self._events: list[tuple[float, int, str, tuple[float, ...]]] = sorted(
            [(command[0], run, '', command[1:]) for run, scenario in enumerate(scenarios)
             for command in scenario.commands]
            + [(when, run, name, ()) for run, scenario in enumerate(scenarios)
               for when, name in scenario.switches], reverse=True)

    def _steer(self, run: int, plan: GaitPlan) -> None:
        if plan.motion.steering is not None:
            self._patterns[run].steer(*plan.steer(self.planned.velocity[run, 0],
                                                  self.planned.turn[run]))
        else:
            self._patterns[run].steer(np.ones(len(plan.robot.legs)), 1.0)

    @property
    def level(self) -> float:
        """0 at the stand, 1 in the full gait: the least of all runs."""
        return min(pattern.level for pattern in self._patterns)

    def plan(self) -> None:
        """Advance by one time step and fill the planned motion."""
        planned, feedback = self.planned, self._feedback
        self._time += self._dt
        while self._events and self._events[-1][0] <= self._time:
            _, run, name, command = self._events.pop()
            plan = self._plans[name] if name else self._patterns[run].plan
            if name:
                self._patterns[run].apply(plan, TRANSITION)
            else:
                planned.velocity[run], planned.turn[run] = command[:2], command[2]
            self._steer(run, plan)
        planned.heading[:] += planned.turn * self._dt
        for run, pattern in enumerate(self._patterns):
            if self._trimmed:
                pattern.frequency_scale = feedback.memory.frequency_scale[run]
            planned.angles[run] = pattern.plan_tick(self._dt)
            planned.phase[run] = pattern.phases[0]
            planned.lean[run] = pattern.body.now[1:]
            old, new, planned.mix[run] = pattern.fading
            planned.gaits[run] = feedback.slot(old), feedback.slot(new)

    def move(self, angles: np.ndarray) -> np.ndarray:
        """Return angles, rad, shape (runs, joints), within the joints' limits and speeds."""
        for pattern, goal, position in zip(self._patterns, angles, self._position, strict=True):
            pattern.move(self._dt, goal)
            position[:] = pattern.position
        return self._position


class ClosedLoopBatch(BatchPhysics):
    """Bodies of one robot with feedback from their sensors.

    Attributes:
        plans: the gaits that they know, by name; runs begin with the first.
        geometry: of the legs.

    """

    def __init__(self, name: str, *plans: GaitPlan, timestep: float = 0.002,
                 threads: int = 1, kp: float | None = None, kd: float | None = None) -> None:
        """Load the model of the plans' robot; name, kp and kd as of ``robot_model.load``.

        Raises:
            SimulationError: MuJoCo is missing, or the model cannot be used.

        """
        self._robot = plans[0].robot
        super().__init__(Body(name, self._robot, kp, kd, timestep, add_ground), threads)
        self.plans = {plan.name: plan for plan in plans}
        self.geometry = geometry_of(self._robot, self._robot.geometry
                                    or geometry_from(self._robot, load_description(name)))

    @property
    def plan(self) -> GaitPlan:
        """The gait that runs begin with."""
        return next(iter(self.plans.values()))

    def run(self, scenarios: Sequence[Scenario], duration: float, gains: Gains | None = None,
            expected: EfferenceCopy | Mapping[str, EfferenceCopy] | None = None,
            noise: SensorNoise | None = None, goal: float = math.inf,
            observe: Callable[[SensorData, np.ndarray], None] = lambda senses, efforts: None
            ) -> Outcome:
        """Simulate bodies that walk off from the stand.

        Args:
            scenarios: one a run.
            duration: s.
            gains: of the feedback; None for none.
            expected: efference copy of the first gait, or of gaits by name; None for nothing
                expected.
            noise: of the sensors.
            goal: way forward at which a run ends, m.
            observe: takes the measurements before each step, arrays (runs, ...) that the next
                step may overwrite, and the efforts of the servos in it, N m, shape (runs,
                joints); of a run that has ended they mean nothing.

        """
        model, dt, parts = self.body.model, self.timestep, self.parts
        runs, steps, legs = len(scenarios), round(duration / dt), len(self._robot.legs)
        if not isinstance(expected, Mapping):
            expected = {} if expected is None else {self.plan.name: expected}
        feedback = Feedback(self.geometry, gains, runs, len(self._robot.joints))
        for name, plan in self.plans.items():
            feedback.learn(plan, expected.get(name))
        memory, state_of = feedback.memory, BodyState(self.geometry, runs)
        estimated = memory.velocity if gains is not None else state_of.velocity
        pattern = Patterns(self.plans, feedback, scenarios, dt, gains is not None)
        limits = np.stack([self._robot.column('lower'), self._robot.column('upper')])
        models = [self.model(item) for item in scenarios]
        stiff = [] if gains is None or not gains.stiffen or gains.virtual_stiffness else [
            self.model(item, gains.stiffen_kp) for item in scenarios]
        control, joints, force = self.controls(runs, 1)
        forces = np.stack([item.forces(steps, dt) for item in scenarios], axis=1)
        order, indices = np.argsort(self._robot.order_indices), self._robot.order_indices
        state, sensors = np.tile(self.start, (runs, 1)), np.zeros((runs, model.nsensordata))
        moving = slice(1 + model.nq, 1 + model.nq + model.nv)
        free = 1 + model.nq + int(model.jnt_dofadr[model.body_jntadr[parts.base]])
        base = slice(free, free + 6)
        before, warm = state[:, moving].copy(), np.zeros((runs, model.nv))
        earlier = state[:, base].copy()
        angle_at, rate_at = 1 + parts.angles[order], moving.start + parts.speeds[order]
        senses = SensorData.zeros(runs, legs, len(order))
        noisy = None if noise is None else NoisySenses(noise, runs, legs, dt)
        velocity, work = np.zeros((runs, 3)), np.zeros((steps, runs))
        fell, arrived = np.full((2, runs), np.inf)
        going, some, all_models = np.arange(runs), slice(None), models
        record: dict[str, np.ndarray] = {}
        delay = 0.0 if noise is None else noise.delay
        for k in range(steps):
            pattern.plan()
            senses.joint_positions[:] = state[:, angle_at]
            senses.joint_velocities[:] = state[:, rate_at]
            np.negative(sensors[:, 2:3 * legs:3], out=senses.foot_forces)
            fill_sensor_data(senses, state[:, 1 + parts.pose[3:]], state[:, base], earlier, dt,
                             velocity)
            noticed = senses if noisy is None else noisy(senses)
            if gains is not None:
                angles = feedback.advance(noticed, pattern.planned, dt, 1.0, pattern.level, delay)
            else:
                angles = pattern.planned.angles
                state_of.update(noticed, dt)
            angles = pattern.move(angles)
            if gains is not None and gains.virtual_stiffness:
                stretch(angles, noticed.joint_positions, memory.stiff, gains, limits)
            joints[:, 0], force[:, 0] = angles[:, indices], forces[k]
            signals = {'place': state[:, 1 + parts.pose[:2]], 'rpy': senses.rpy,
                       'velocity': velocity, 'estimated': estimated,
                       'angular_velocity': senses.angular_velocity,
                       'phase': pattern.planned.phase, 'kp_scale': memory.kp_scale,
                       'stiff': memory.stiff}
            for key, value in signals.items():
                if not k:
                    record[key] = np.zeros((steps, *value.shape))
                record[key][k] = value
            speeds = senses.joint_velocities[:, indices]
            _, applied = torques(model, joints[:, 0], senses.joint_positions[:, indices], speeds,
                                 memory.kp_scale)
            work[k] = motor_power(applied, speeds)
            observe(noticed, applied[:, order])
            earlier, before = state[:, base].copy(), state[some, moving]
            if stiff:
                models = [(stiff if memory.kp_scale[run] > 1.0 else all_models)[run]
                          for run in going]
            after, sensed = self.rollout(models, state[some], control[some], warm[some])
            state[some], sensors[some] = after[:, 0], sensed[:, 0]
            warm[some] = (state[some, moving] - before) / dt
            height = np.cos(senses.rpy[:, 0]) * np.cos(senses.rpy[:, 1])
            down = (height < math.cos(FALLEN)) | (sensors[:, 3 * legs] > 0.0)
            far = state[:, 1 + parts.pose[0]] > goal
            ends = (down | far)[going]
            if ends.any():
                over = going[ends]
                fell[over[down[over]]] = arrived[over[~down[over]]] = k * dt
                state[over, base] = earlier[over] = 0.0
                going = going[~ends]
                some, models = going, [all_models[run] for run in going]
                if not going.size:
                    break
        for rows in (*record.values(), work):
            rows[k + 1:] = rows[k]
        late = slice(min(round(BEGINNING / dt), steps // 2), None)
        cost = cost_of_transport(work[late].sum(axis=0) * dt, self.geometry.weight,
                                 record['velocity'][late, :, 0].sum(axis=0) * dt)
        return Outcome(fell=fell, arrived=arrived, cost=cost,
                       **{key: rows.swapaxes(0, 1) for key, rows in record.items()})

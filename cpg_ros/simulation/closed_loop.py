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
from cpg_ros.feedback.gains import Gains, VARIABLES
from cpg_ros.feedback.kinematics import geometry_of
from cpg_ros.feedback.laws.servo_gains import restore, ServoEstimate
from cpg_ros.feedback.laws.virtual_stiffness import stretch
from cpg_ros.feedback.tick import PlannedMotion
from cpg_ros.motion.pattern import Pattern
from cpg_ros.motion.plan import GaitPlan
from cpg_ros.motion.strides import StrideCommand
from cpg_ros.simulation.bodies import BatchPhysics, KP_DIGITS
from cpg_ros.simulation.body import Body, MAX_LEAN
from cpg_ros.simulation.robot_setup.model_reading import geometry_from, load_description
from cpg_ros.simulation.run_metrics import cost_of_transport, motor_power, SETTLING_TIME, torques
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
        patterns: one a run.
        planned: the motion before any correction; its arrays are overwritten by plan.

    """

    def __init__(self, plans: Mapping[str, GaitPlan], feedback: Feedback,
                 scenarios: Sequence[Scenario], dt: float, trimmed: bool) -> None:
        """Stand; all runs, one a scenario, begin with the first plan.

        ``dt`` is that of a tick, s; if ``trimmed``, the feedback changes strides and clocks.
        """
        self._plans, self._feedback, self._dt, self._trimmed = plans, feedback, dt, trimmed
        first, runs = next(iter(plans.values())), len(scenarios)
        self.patterns = [Pattern(first, RAMP, strides=StrideCommand(len(first.robot.legs)))
                          for _ in scenarios]
        self.planned = PlannedMotion.zeros(runs, len(first.robot.joints))
        self.planned.velocity[:, 0] = [scenario.speed for scenario in scenarios]
        self._position = self.planned.angles.copy()
        for run, (pattern, scenario) in enumerate(zip(self.patterns, scenarios, strict=True)):
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
            self.patterns[run].steer(*plan.steer(self.planned.velocity[run, 0],
                                                  self.planned.turn[run]))
        else:
            self.patterns[run].steer(np.ones(len(plan.robot.legs)), 1.0)

    @property
    def level(self) -> float:
        """0 at the stand, 1 in the full gait: the least of all runs."""
        return min(pattern.level for pattern in self.patterns)

    def plan(self) -> None:
        """Advance by one time step and fill the planned motion."""
        planned, feedback = self.planned, self._feedback
        self._time += self._dt
        while self._events and self._events[-1][0] <= self._time:
            _, run, name, command = self._events.pop()
            plan = self._plans[name] if name else self.patterns[run].plan
            if name:
                self.patterns[run].apply(plan, TRANSITION)
            else:
                planned.velocity[run], planned.turn[run] = command[:2], command[2]
            self._steer(run, plan)
        planned.heading[:] += planned.turn * self._dt
        for run, pattern in enumerate(self.patterns):
            if self._trimmed:
                pattern.frequency_scale = feedback.memory.frequency_scale[run]
            planned.angles[run] = pattern.plan_tick(self._dt)
            planned.phase[run] = pattern.phases[0]
            planned.lean[run] = pattern.body.now[1:]
            old, new, planned.mix[run] = pattern.fading
            planned.gaits[run] = feedback.slot(old), feedback.slot(new)

    def move(self, angles: np.ndarray) -> np.ndarray:
        """Return angles, rad, shape (runs, joints), within the joints' limits and speeds."""
        for pattern, goal, position in zip(self.patterns, angles, self._position, strict=True):
            pattern.move(self._dt, goal)
            position[:] = pattern.position
        return self._position


class _Bodies:
    """The bodies of all runs; one that has ended stays where it is.

    Attributes:
        place: of the bases on the ground, m, shape (runs, 2).
        velocity: of the bases in their own frames, m/s, shape (runs, 3), by ``measure``.
        fell: when they fell, s, infinite if they did not, shape (runs,).
        arrived: when they reached the goal, likewise.

    """

    def __init__(self, physics: BatchPhysics, scenarios: Sequence[Scenario], order: np.ndarray
                 ) -> None:
        """Stand; order: indices in ``Robot.order`` of the joints as sensors have them."""
        model, parts, runs = physics.body.model, physics.parts, len(scenarios)
        self._physics, self._legs = physics, len(physics.body.robot.legs)
        self._scenarios = scenarios
        self._control, self._joints, self._force = physics.controls(runs, 1)
        self._state = np.tile(physics.start, (runs, 1))
        self._sensors = np.zeros((runs, model.nsensordata))
        self._moving = slice(1 + model.nq, 1 + model.nq + model.nv)
        free = 1 + model.nq + int(model.jnt_dofadr[model.body_jntadr[parts.base]])
        #: Columns of the state: velocity of the base, its orientation, and the joints.
        self._base, self._turned = slice(free, free + 6), 1 + parts.pose[3:]
        self._angles = 1 + parts.angles[order]
        self._rates = self._moving.start + parts.speeds[order]
        self._warm = np.zeros((runs, model.nv))
        self._earlier = self._state[:, self._base].copy()
        self.place, self.velocity = np.zeros((runs, 2)), np.zeros((runs, 3))
        self.fell, self.arrived = np.full((2, runs), np.inf)
        #: Runs that go on, as indices and as what selects their rows.
        self._going = np.arange(runs)
        self._some: slice | np.ndarray = slice(None)

    @property
    def parts(self) -> tuple[np.ndarray, ...]:
        """State of the physics, what sensors show of it, the bases' last speeds; solver's start.

        The first axis of each is the run; they may be changed.
        """
        return self._state, self._sensors, self._earlier, self._warm

    def measure(self, senses: SensorData) -> None:
        """Fill the sensors' exact values, and what is known of the bases."""
        state = self._state
        senses.joint_positions[:] = state[:, self._angles]
        senses.joint_velocities[:] = state[:, self._rates]
        np.negative(self._sensors[:, 2:3 * self._legs:3], out=senses.foot_forces)
        fill_sensor_data(senses, state[:, self._turned], state[:, self._base], self._earlier,
                         self._physics.timestep, self.velocity)
        self.place[:] = state[:, 1 + self._physics.parts.pose[:2]]

    def step(self, targets: np.ndarray, force: np.ndarray, kp_scale: np.ndarray) -> None:
        """Take a step of the physics.

        Args:
            targets: of the joints, in ``Robot.order``, rad, shape (runs, joints).
            force: on the bases, forward and to the left, N, shape (runs, 2).
            kp_scale: factor of the servos' stiffness, shape (runs,).

        """
        some, state = self._some, self._state
        self._joints[:, 0], self._force[:, 0] = targets, force
        self._earlier[:] = state[:, self._base]
        before = state[some, self._moving]
        models = [self._physics.model(self._scenarios[run], kp_scale[run])
                  for run in self._going.tolist()]
        after, sensed = self._physics.rollout(models, state[some], self._control[some],
                                              self._warm[some])
        state[some], self._sensors[some] = after[:, 0], sensed[:, 0]
        self._warm[some] = (state[some, self._moving] - before) / self._physics.timestep

    def go_on(self, rpy: np.ndarray, goal: float, now: float) -> bool:
        """End runs that have fallen or arrived, at a time in s; return whether any goes on.

        Args:
            rpy: of the bases before the step, rad, shape (runs, 3).
            goal: way forward, m.
            now: s.

        """
        level = np.cos(rpy[:, 0]) * np.cos(rpy[:, 1])
        down = (level < math.cos(MAX_LEAN)) | (self._sensors[:, 3 * self._legs] > 0.0)
        far = self._state[:, 1 + self._physics.parts.pose[0]] > goal
        ends = (down | far)[self._going]
        if ends.any():
            over = self._going[ends]
            self.fell[over[down[over]]] = self.arrived[over[~down[over]]] = now
            self._state[over, self._base] = self._earlier[over] = 0.0
            self._some = self._going = self._going[~ends]
        return bool(self._going.size)


class ClosedLoop:
    """Bodies that walk off from the stand, their patterns and their feedback.

    Attributes:
        patterns, feedback, bodies: of all runs.
        senses: exact measurements of the last tick.
        state_of: estimate where there is no feedback.
        indices, order: of the joints in ``Robot.order`` among the robot's, and the inverse.

    """

    def __init__(self, batch: 'ClosedLoopBatch', scenarios: Sequence[Scenario],
                 gains: Gains | None, expected: EfferenceCopy | Mapping[str, EfferenceCopy] | None,
                 noise: SensorNoise | None = None) -> None:
        """Stand; arguments as of ClosedLoopBatch.run."""
        robot, runs, self._dt, self._gains = batch.robot, len(scenarios), batch.timestep, gains
        if not isinstance(expected, Mapping):
            expected = {} if expected is None else {batch.plan.name: expected}
        self.feedback = Feedback(batch.geometry, gains, runs, len(robot.joints))
        for name, plan in batch.plans.items():
            self.feedback.learn(plan, expected.get(name))
        self.state_of = BodyState(batch.geometry, runs)
        self.patterns = Patterns(batch.plans, self.feedback, scenarios, self._dt,
                                 gains is not None)
        self._limits = np.stack([robot.column(key) for key in ('lower', 'upper', 'velocity')])
        self.indices = robot.order_indices
        self.order = np.argsort(self.indices)
        self.bodies = _Bodies(batch, scenarios, self.order)
        self.senses = SensorData.zeros(runs, len(robot.legs), len(self.order))
        self._noisy = None if noise is None else NoisySenses(noise, runs, len(robot.legs),
                                                             self._dt)
        self._delay = 0.0 if noise is None else noise.delay
        self.servos, self._model = ServoEstimate.begin(runs, len(robot.joints)), batch.body.model
        self._servo_scales = np.array([(scenario.kp, scenario.kd) for scenario in scenarios]).T
        self._efforts: list[np.ndarray] = []

    def command(self) -> tuple[SensorData, np.ndarray]:
        """Advance patterns and feedback by a tick.

        Returns:
            What the sensors show, and the targets of the joints, in ``Robot.order``, rad, shape
                (runs, joints).

        """
        patterns, feedback, gains, dt = self.patterns, self.feedback, self._gains, self._dt
        patterns.plan()
        self.bodies.measure(self.senses)
        noticed = self.senses if self._noisy is None else self._noisy(self.senses)
        if gains is not None:
            angles = feedback.advance(noticed, patterns.planned, dt, 1.0, patterns.level,
                                      self._delay)
        else:
            angles = patterns.planned.angles
            self.state_of.update(noticed, dt)
        angles = patterns.move(angles)
        if gains is not None and gains.virtual_stiffness:
            stretch(angles, noticed.joint_positions, feedback.memory.stiff, gains, self._limits)
        if gains is not None and gains.servo_gains and gains.servo_kp:
            restore(angles, (noticed.joint_positions, noticed.joint_velocities,
                             self._measured_efforts()), self.servos,
                    (feedback.memory.kp_scale, feedback.memory.stiff_for),
                    (gains.servo_kp, gains.servo_kd), self._limits, (dt, True, 1.0))
        return noticed, angles[:, self.indices]

    def _measured_efforts(self) -> np.ndarray:
        """Return the torques with which servos hold the last targets, as late as all senses."""
        last, senses, (kp, kd) = self.servos, self.senses, self._servo_scales
        _, efforts = torques(self._model, last.targets[:, last.newest[0]][:, self.indices],
                             senses.joint_positions[:, self.indices],
                             senses.joint_velocities[:, self.indices],
                             last.scales[:, last.newest[0]].round(KP_DIGITS) * kp, kd)
        self._efforts.append(efforts[:, self.order])
        late = len(self._efforts) > round(self._delay / self._dt)
        return self._efforts.pop(0) if late else self._efforts[0]

    def go(self, ticks: int) -> None:
        """Take some ticks without a push."""
        for _ in range(ticks):
            _, angles = self.command()
            self.bodies.step(angles, np.zeros((len(angles), 2)),
                             self.feedback.memory.kp_scale.round(KP_DIGITS))

    def take(self, other: 'ClosedLoop') -> None:
        """Put all runs, which have not begun, into the state of another walk's only run.

        That one is in its full gait, where no limit of a joint acts.
        """
        memory, (pattern,) = self.feedback.memory, other.patterns.patterns
        for name, part, source in zip(memory._fields, memory, other.feedback.memory, strict=True):
            if name in VARIABLES:
                part[:] = source
        for part, source in zip(self.bodies.parts, other.bodies.parts, strict=True):
            part[:] = source
        self.patterns.plan()
        while self.patterns.level < 1.0:
            self.patterns.move(np.tile(pattern.position, (len(memory.velocity), 1)))
            self.patterns.plan()
        for each in self.patterns.patterns:
            each.like(pattern)


class ClosedLoopBatch(BatchPhysics):
    """Bodies of one robot with feedback from their sensors.

    Attributes:
        robot: that of the gaits.
        plans: the gaits that they know, by name; runs begin with the first.
        geometry: of the legs.

    """

    def __init__(self, name: str, *plans: GaitPlan, timestep: float = 0.002,
                 threads: int = 1, kp: float | None = None, kd: float | None = None) -> None:
        """Load the model of the plans' robot; name, kp and kd as of ``robot_model.load``.

        Raises:
            SimulationError: MuJoCo is missing, or the model cannot be used.

        """
        self.robot = plans[0].robot
        super().__init__(Body(name, self.robot, kp, kd, timestep, add_ground), threads)
        self.plans = {plan.name: plan for plan in plans}
        self.geometry = geometry_of(self.robot, self.robot.geometry
                                    or geometry_from(self.robot, load_description(name)))

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
            expected: efference copy of the first gait, or of gaits by name; None for those of
                the robot file.
            noise: of the sensors.
            goal: way forward at which a run ends, m.
            observe: takes the measurements before each step, arrays (runs, ...) that the next
                step may overwrite, and the efforts of the servos in it, N m, shape (runs,
                joints); of a run that has ended they mean nothing.

        """
        dt, steps = self.timestep, round(duration / self.timestep)
        walk = ClosedLoop(self, scenarios, gains, expected, noise)
        memory, bodies, senses = walk.feedback.memory, walk.bodies, walk.senses
        forces = np.stack([scenario.forces(steps, dt) for scenario in scenarios], axis=1)
        signals = {'place': bodies.place, 'rpy': senses.rpy, 'velocity': bodies.velocity,
                   'estimated': memory.velocity if gains is not None else walk.state_of.velocity,
                   'angular_velocity': senses.angular_velocity,
                   'phase': walk.patterns.planned.phase,
                   'kp_scale': memory.kp_scale, 'stiff': memory.stiff}
        record = {key: np.zeros((steps, *value.shape)) for key, value in signals.items()}
        work = np.zeros((steps, len(scenarios)))
        kp, kd = np.array([(scenario.kp, scenario.kd) for scenario in scenarios]).T
        for k in range(steps):
            noticed, angles = walk.command()
            for key, value in signals.items():
                record[key][k] = value
            speeds = senses.joint_velocities[:, walk.indices]
            kp_scale = memory.kp_scale.round(KP_DIGITS)
            _, applied = torques(self.body.model, angles, senses.joint_positions[:, walk.indices],
                                 speeds, kp_scale * kp, kd)
            work[k] = motor_power(applied, speeds)
            observe(noticed, applied[:, walk.order])
            bodies.step(angles, forces[k], kp_scale)
            if not bodies.go_on(senses.rpy, goal, k * dt):
                break
        for rows in (*record.values(), work):
            rows[k + 1:] = rows[k]
        late = slice(min(round(SETTLING_TIME / dt), steps // 2), None)
        cost = cost_of_transport(work[late].sum(axis=0) * dt, self.geometry.weight,
                                 record['velocity'][late, :, 0].sum(axis=0) * dt)
        return Outcome(fell=bodies.fell, arrived=bodies.arrived, cost=cost,
                       **{key: rows.swapaxes(0, 1) for key, rows in record.items()})

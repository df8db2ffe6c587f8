"""Many bodies at once with feedback, or without it: pushed, on rough ground, on slopes.

All of them take a step of physics together, MuJoCo's own ``rollout`` of one step, and what they
feel goes through one ``Feedback`` of as many runs.
"""

import copy
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from cpg_ros.feedback.efference_copy import EfferenceCopy
from cpg_ros.feedback.estimate import BodyState, Senses, upward
from cpg_ros.feedback.feedback import Feedback
from cpg_ros.feedback.gains import Gains
from cpg_ros.motion.plan import Program
from cpg_ros.motion.smoothstep import smoothstep
from cpg_ros.motion.steering import TIME_CONSTANT
from cpg_ros.simulation.batch import PUSH
from cpg_ros.simulation.body import FALLEN, Body
from cpg_ros.simulation.leg_geometry import read_geometry
from cpg_ros.simulation.model_indices import Anatomy
from cpg_ros.simulation.proprioception import felt
from cpg_ros.simulation.robot_model import engine
from cpg_ros.simulation.run_metrics import BEGINNING
from cpg_ros.simulation.terrain import Terrain, add_ground, lay

#: From the stand into the gait, s.
RAMP = 1.0


@dataclass(frozen=True)
class Scenario:
    """What a robot meets in a run, flat ground and nothing else if not told.

    Attributes:
        friction: between feet and ground.
        terrain: ground that is not flat.
        push: impulse on the base forward and to the left, N s, within PUSH seconds.
        when: the push begins, s.
        phase: of the first leg at the start of the gait, cycles.

    """

    friction: float = 1.0
    terrain: Terrain | None = None
    push: tuple[float, float] = (0.0, 0.0)
    when: float = math.inf
    phase: float = 0.0


@dataclass(frozen=True)
class Outcome:
    """How runs ended, and their signals after each step; the first axis is the run's.

    Attributes:
        fell: when it fell, s, infinite if it did not, shape (runs,).
        place: of the base on the ground, m, shape (runs, steps, 2).
        lean: roll, pitch and yaw, rad, shape (runs, steps, 3).
        velocity: true one of the base in its own frame, m/s, shape (runs, steps, 3).
        estimated: the same as estimated.
        turning: rad/s, its own frame, shape (runs, steps, 3).
        phase: of the first leg, cycles, shape (runs, steps).
        cost: of transport after BEGINNING, shape (runs,).

    """

    fell: np.ndarray
    place: np.ndarray
    lean: np.ndarray
    velocity: np.ndarray
    estimated: np.ndarray
    turning: np.ndarray
    phase: np.ndarray
    cost: np.ndarray

    @property
    def upright(self) -> np.ndarray:
        """Whether each run did not fall."""
        return np.isinf(self.fell)


class ClosedLoop:
    """Bodies of one robot that feel what they do.

    Attributes:
        body: one of them, for its model and its stand.
        parts: where its parts are in the model.
        geometry: of its legs.
        timestep: of physics and feedback, s.

    """

    def __init__(self, name: str, program: Program, timestep: float = 0.002,
                 threads: int = 1) -> None:
        """Load the model of the program's robot; the name as of ``model.load``.

        Raises:
            SimulationError: MuJoCo is missing, or the model cannot be used.

        """
        mujoco = engine()
        from mujoco import rollout
        self.program, self.timestep = program, timestep
        self.body = Body(name, program.robot, timestep=timestep, add=add_ground)
        self.parts = Anatomy(self.body)
        self.geometry = read_geometry(self.body, self.parts)
        self.body.reset()
        self._models: dict[tuple[float, Terrain | None], Any] = {}
        self._data = [mujoco.MjData(self.body.model) for _ in range(threads)]
        self._pool = rollout.Rollout(nthread=threads)
        full = mujoco.mjtState.mjSTATE_FULLPHYSICS
        self._start = np.empty(mujoco.mj_stateSize(self.body.model, full))
        mujoco.mj_getState(self.body.model, self.body.data, self._start, full)

    def run(self, trials: Sequence[Scenario], duration: float, speed: float = 0.4,
            gains: Gains | None = None, expected: EfferenceCopy | None = None) -> Outcome:
        """Let bodies walk from the stand.

        Args:
            trials: one a run.
            duration: s.
            speed: wanted, forward, m/s; ignored where the gait cannot be steered.
            gains: of the feedback; None for none.
            expected: efference copy; None for nothing expected.

        """
        model, program, dt = self.body.model, self.program, self.timestep
        runs, steps = len(trials), round(duration / dt)
        feedback = Feedback(program, self.geometry, expected, gains, runs)
        pose = _Pattern(program, feedback, trials, speed, dt)
        models = [self._model(trial) for trial in trials]
        spec = int(engine().mjtState.mjSTATE_CTRL | engine().mjtState.mjSTATE_XFRC_APPLIED)
        control = np.zeros((runs, 1, model.nu + 6 * model.nbody))
        force = control[:, 0, model.nu + 6 * self.parts.base:][:, :2]
        impulse = np.array([trial.push for trial in trials]) / PUSH
        begins = np.array([trial.when for trial in trials])
        order = np.argsort(program.robot.places)
        state = np.tile(self._start, (runs, 1))
        legs, moving = len(program.robot.legs), slice(1 + model.nq, 1 + model.nq + model.nv)
        sensors = np.zeros((runs, model.nsensordata))
        before, warm = state[:, moving].copy(), np.zeros((runs, model.nv))
        wanted, course = np.full(runs, speed), np.zeros(runs)
        fell = np.full(runs, np.inf)
        record = {key: np.zeros((runs, steps, size)) for key, size in
                  (('place', 2), ('lean', 3), ('velocity', 3), ('estimated', 3), ('turning', 3),
                   ('phase', 1), ('work', 1))}
        estimate = feedback.estimate if gains is not None else BodyState(self.geometry, runs)
        for k in range(steps):
            planned, level = pose.advance()
            senses, velocity = self._feel(state, sensors, before, order, legs)
            if gains is not None:
                angles = feedback.advance(senses, planned, pose.phase, wanted, course, dt, level)
            else:
                angles = planned
                estimate.update(senses, dt)
            angles = pose.confine(angles)
            control[:, 0, :model.nu] = angles[:, program.robot.places]
            force[:] = np.where(((k * dt >= begins) & (k * dt < begins + PUSH))[:, None],
                                impulse, 0.0)
            before = state[:, moving].copy()
            after, sensed = self._pool.rollout(models, self._data, state, control,
                                               control_spec=spec, initial_warmstart=warm)
            state, sensors = after[:, 0], sensed[:, 0]
            warm = (state[:, moving] - before) / dt
            down = (upward(senses.lean)[:, 2] < math.cos(FALLEN)) | (sensors[:, 3 * legs] > 0.0)
            fell = np.where(down & np.isinf(fell), k * dt, fell)
            for key, value in (('place', state[:, 1 + self.parts.pose[:2]]),
                               ('lean', senses.lean), ('velocity', velocity),
                               ('estimated', estimate.velocity), ('turning', senses.turning),
                               ('phase', pose.phase[:, None]),
                               ('work', self._work(control[:, 0], senses, order))):
                record[key][:, k] = value
            if not np.isinf(fell).any():
                break
        late = slice(min(round(BEGINNING / dt), steps // 2), None)
        way = np.abs((record['velocity'][:, late, 0]).sum(axis=1) * dt)
        work = record.pop('work')[:, late, 0].sum(axis=1) * dt
        phase = record.pop('phase')[:, :, 0]
        return Outcome(fell=fell, cost=work / (self.geometry.weight * np.maximum(way, 1e-3)),
                       phase=phase, **record)

    def _feel(self, state: np.ndarray, sensors: np.ndarray, before: np.ndarray,
              order: np.ndarray, legs: int) -> tuple[Senses, np.ndarray]:
        """Return what robots feel, and their true velocities in their own frames."""
        model, parts = self.body.model, self.parts
        moving = state[:, 1 + model.nq:1 + model.nq + model.nv]
        free = int(model.jnt_dofadr[model.body_jntadr[parts.base]])
        return felt(state[:, 1 + parts.angles[order]], moving[:, parts.speeds[order]],
                    -sensors[:, :3 * legs].reshape(-1, legs, 3)[:, :, 2],
                    state[:, 1 + parts.pose[3:]], moving[:, free:free + 6],
                    before[:, free:free + 6], self.timestep)

    def _work(self, control: np.ndarray, senses: Senses, order: np.ndarray) -> np.ndarray:
        """Power of the motors, none regained, W, shape (runs, 1)."""
        model = self.body.model
        stiffness, damping = model.actuator_gainprm[order, 0], -model.actuator_biasprm[order, 2]
        limits = np.where(model.actuator_forcelimited.astype(bool)[:, None],
                          model.actuator_forcerange, [-np.inf, np.inf])[order]
        torque = np.clip(stiffness * (control[:, order] - senses.angles) - damping * senses.rates,
                         *limits.T)
        return np.maximum(torque * senses.rates, 0.0).sum(axis=1, keepdims=True)

    def _model(self, trial: Scenario) -> Any:
        key = (trial.friction, trial.terrain)
        if key not in self._models:
            model = copy.copy(self.body.model)
            ground = model.geom_bodyid == 0
            sliding = model.geom_friction[:, 0]
            sliding[:] = np.where(ground, trial.friction, np.minimum(sliding, trial.friction))
            if trial.terrain is not None:
                lay(model, trial.terrain)
            self._models[key] = model
        return self._models[key]


class _Pattern:
    """The patterns of all runs: the gait's orbit looked up, ramped in, steered, held to limits.

    Attributes:
        phase: of the first leg, cycles, shape (runs,).

    """

    def __init__(self, program: Program, feedback: Feedback, trials: Sequence[Scenario],
                 speed: float, dt: float) -> None:
        robot = program.robot
        self._program, self._feedback, self._dt = program, feedback, dt
        self._leg, self._offset = robot.leg_of_joint, robot.column('offset')
        self._limits = robot.column('lower'), robot.column('upper'), robot.column('velocity')
        self._asked, self._pace = np.ones(len(robot.legs)), 1.0
        if program.motion.steering is not None:
            self._asked, self._pace = program.steer(speed, 0.0)
        self.phase = np.array([trial.phase for trial in trials])
        self._stride = np.tile(self._asked, (len(trials), 1))
        self._rate = np.zeros_like(self._stride)
        self._last = np.tile(self._offset, (len(trials), 1))
        self._time = 0.0

    def advance(self) -> tuple[np.ndarray, float]:
        """Return the planned angles, rad, shape (runs, joints), and the level of the ramp."""
        dt, table = self._dt, self._feedback.timetable
        self._time += dt
        hurry = self._feedback.hurry
        self.phase = (self.phase + self._program.frequency * self._pace * hurry * dt) % 1.0
        # As of motion.steering.Drive.
        target = np.clip(self._asked + self._feedback.stride, -1.0, 1.0)
        gap, decay = self._stride - target, np.exp(-hurry * dt / TIME_CONSTANT)[:, None]
        pull = (self._rate + gap / TIME_CONSTANT) * (hurry * dt)[:, None]
        self._stride = target + (gap + pull) * decay
        self._rate = (self._rate - pull / TIME_CONSTANT) * decay
        place = self.phase * len(table.angles)
        low, on = place.astype(int), (place % 1.0)[:, None]
        high = (low + 1) % len(table.angles)
        full, still = ((1.0 - on) * one[low] + on * one[high]
                       for one in (table.angles, table.in_place))
        level = smoothstep(min(1.0, self._time / RAMP))[0]
        stride = self._stride[:, self._leg]
        return self._offset + level * (still + stride * (full - still)), level

    def confine(self, angles: np.ndarray) -> np.ndarray:
        """Hold angles to the joints' limits and speeds."""
        lower, upper, speed = self._limits
        reach = speed * self._dt
        self._last = np.clip(np.clip(angles, self._last - reach, self._last + reach),
                             lower, upper)
        return self._last

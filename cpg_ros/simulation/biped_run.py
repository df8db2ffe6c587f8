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

"""Runs of a biped with its feedback in simulation: commands and pushes in, metrics out."""

from dataclasses import dataclass, field
import math

from cpg_ros.common.errors import ShortRepr
from cpg_ros.feedback.biped.feedback import BipedFeedback, gait_plan
from cpg_ros.feedback.estimate import SensorData
from cpg_ros.feedback.kinematics import GRAVITY
from cpg_ros.motion.core import confine
from cpg_ros.motion.pattern import GaitRunner
from cpg_ros.motion.robot import Robot
from cpg_ros.simulation.body import Body
from cpg_ros.simulation.run_metrics import cost_of_transport, motor_power
from cpg_ros.simulation.scenario import PUSH_DURATION, SensorNoise
from cpg_ros.simulation.sensors import fill_sensor_data, NoisySenses
from cpg_ros.simulation.terrain import add_ground, lay, set_friction, Terrain
import numpy as np

#: MIN_HEIGHT: height of the centre of mass, as a fraction of the commanded one, below which the
#: robot has fallen.
MIN_HEIGHT = 0.6
#: START_UP_TIME: time after the first step from which on a run is measured, s.
START_UP_TIME = 3.0


@dataclass(eq=False, repr=False)
class BipedOutcome(ShortRepr):
    """Results of a biped's run.

    Attributes:
        fell: when it fell, s, infinite if it did not.
        speed: mean velocity forward and left, heading's axes, m/s, after START_UP_TIME.
        tilt: largest angle of the base to the vertical, rad.
        steps: touchdowns by the clock.
        flight: fraction of the time after START_UP_TIME in which no foot touches the ground.
        cost: of transport: mechanical work of the motors, those of the arms too and none
            regained, per weight and metre.
        path: time, place of the base (x y z) and its yaw, every 10 ms, shape (n, 5).
        poses: all of ``qpos`` at these times, shape (n, ...), as ``recorder.shoot`` takes it.

    """

    fell: float = math.inf
    speed: tuple[float, float] = (0.0, 0.0)
    tilt: float = 0.0
    steps: int = 0
    flight: float = 0.0
    cost: float = math.inf
    path: np.ndarray = field(default_factory=lambda: np.zeros((0, 5)))
    poses: np.ndarray = field(default_factory=lambda: np.zeros((0, 0)))


class BipedRun:
    """One simulated biped whose servos follow its feedback at every step of the physics.

    Targets keep to the joints' limits of position and speed, as those of a `BalancedPattern` do.

    """

    def __init__(self, model: str, robot: Robot, noise: SensorNoise | None = None,
                 friction: float = 0.6, timestep: float = 0.002,
                 terrain: Terrain | None = None) -> None:
        """Load a model, as of ``robot_model.load``, of a robot with the part ``biped``.

        Without ``noise`` sensors are exact, without ``terrain`` the ground is flat; ``timestep``
        is that of physics and feedback, s.
        """
        self.body = Body(model, robot, timestep=timestep, add=add_ground if terrain else None)
        if terrain is not None:
            lay(self.body.model, terrain)
        self.robot, self.noise, self.dt = robot, noise or SensorNoise(), timestep
        set_friction(self.body.model, friction)
        biped = robot.biped
        order = list(biped.links) if biped is not None else []
        joints = [self.body.model.joint(name).id for name in order]
        self._angles = self.body.model.jnt_qposadr[joints]
        self._speeds = self.body.model.jnt_dofadr[joints]
        self.senses = SensorData.zeros(1, 2, len(order))
        self._velocity = np.zeros((1, 3))
        self._limits = np.stack([robot.column(name)[robot.order_indices]
                                 for name in ('lower', 'upper', 'velocity')])
        self._target, self._rate = np.zeros((2, len(robot.order)))
        self._behind = np.zeros(len(robot.order), dtype=bool)

    def measure(self, before: np.ndarray) -> SensorData:
        """Return the true sensor data; before is the base's motion a step ago, shape (1, 6)."""
        body, senses = self.body, self.senses
        senses.joint_positions[0] = body.data.qpos[self._angles]
        senses.joint_velocities[0] = body.data.qvel[self._speeds]
        senses.foot_forces[0] = body.feet
        fill_sensor_data(senses, body.quaternion[None], body.rates[None], before, self.dt,
                         self._velocity)
        return senses

    def _command(self, target: np.ndarray) -> None:
        confine(target, (target - self._target) / self.dt, self._limits, self.dt, self._target,
                self._rate, self._behind)
        self.body.command(self._target)

    def run(self, duration: float, commands: tuple[tuple[float, float, float, float], ...] = (),
            pushes: tuple[tuple[float, float, float], ...] = (),
            feedback: BipedFeedback | None = None, seed: int = 0,
            gaits: tuple[tuple[float, str], ...] = ()) -> BipedOutcome:
        """Stand up and follow commands.

        Args:
            duration: s.
            commands: each (s, m/s forward, m/s left, rad/s); with NaN as a speed it stands.
            pushes: each (s, N forward, N left) on the base for PUSH_DURATION seconds.
            feedback: of the robot, not used before; one with its own gains if not given.
            seed: of the noise.
            gaits: each (s, gait) to change to then; the first one is the feedback's own.

        """
        body, dt = self.body, self.dt
        body.reset()
        self._target[:] = body.stand
        feedback = feedback or BipedFeedback(self.robot)
        senses = NoisySenses(SensorNoise(**{**vars(self.noise), 'seed': seed}), 1, 2, dt)
        before, outcome = body.rates[None].copy(), BipedOutcome()
        path, poses, work, moved, began = [], [], 0.0, np.zeros(2), math.inf
        count = flown = 0
        wishes, forces = sorted(commands), sorted(pushes)
        changes = [(when, GaitRunner(gait_plan(self.robot, gait), 0.0))
                   for when, gait in sorted(gaits, key=lambda change: change[0])]
        was = feedback.memory.swinging.copy()
        for k in range(round(duration / dt)):
            time = k * dt
            while wishes and wishes[0][0] <= time:
                _, forward, left, turn = wishes.pop(0)
                if math.isnan(forward):
                    feedback.stand()
                else:
                    feedback.walk(forward, left, turn)
                    began = min(began, time)
            while changes and changes[0][0] <= time:
                feedback.set_gait(changes.pop(0)[1])
            while forces and forces[0][0] <= time:
                body.push(np.array([*forces.pop(0)[1:], 0.0]), PUSH_DURATION)
            true = self.measure(before)
            before[0] = body.rates
            self._command(feedback.advance(senses(true), dt))
            body.hold(feedback.arms.positions)
            body.step()
            outcome.steps += int((was & ~feedback.memory.swinging).sum())
            was[:] = feedback.memory.swinging
            up = body.axes[2, 2]
            outcome.tilt = max(outcome.tilt, math.acos(min(max(up, -1.0), 1.0)))
            _, held_speeds, held_torques = body.held
            work += dt * float(motor_power(body.torque, body.velocity)
                               + motor_power(held_torques, held_speeds))
            if time > began + START_UP_TIME:
                c, s = math.cos(feedback.memory.heading), math.sin(feedback.memory.heading)
                x, y = body.rates[:2]
                moved += c * x + s * y, c * y - s * x
                count += 1
                flown += not body.feet.any()
            if k % round(0.01 / dt) == 0:
                path.append((time, *body.base, body.yaw))
                poses.append(body.data.qpos.copy())
            height = feedback.memory.center[0, 2] - feedback.pose.soles[:, 2].min()
            if body.fallen or height < MIN_HEIGHT * feedback.gains.height:
                outcome.fell = time
                break
        outcome.path, outcome.poses = np.array(path), np.array(poses)
        if count:
            outcome.speed = float(moved[0] / count), float(moved[1] / count)
            outcome.flight = flown / count
        way = float(np.linalg.norm(outcome.path[-1, 1:3] - outcome.path[0, 1:3]))
        if way > 0.5:
            outcome.cost = float(cost_of_transport(work, GRAVITY * body.mass, way))
        return outcome

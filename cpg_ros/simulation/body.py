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

"""A robot's body in MuJoCo: target angles in, its motion and measurements out."""

from collections.abc import Callable
import math
from typing import Any

from cpg_ros.motion.robot import Robot
from cpg_ros.motion.rotations import rpy_of
from cpg_ros.motion.strides import smoothstep
from cpg_ros.simulation.robot_model import engine, load, SimulationError
import numpy as np

#: MAX_LEAN: lean of the base above which the robot has fallen, rad.
MAX_LEAN = math.radians(60.0)
#: A robot sits on the floor. MAX_SEATED_LEAN: of its base, rad; MAX_SEATED_HEIGHT: of the base
#: over the feet by the joints' targets, as a fraction of the stand's.
MAX_SEATED_LEAN, MAX_SEATED_HEIGHT = 0.35, 0.6


def add_payload(model: Any, base: int, mass: float) -> None:
    """Put a mass in kg on the base of a model, where its own is; ``mj_setConst`` is to follow."""
    own = float(model.body_mass[base])
    model.body_mass[base] = own + mass
    model.body_inertia[base] *= (own + mass) / own


class Body:
    """One robot on a floor; joints in ``robot.order``, legs in that of its file.

    Arrays that properties return are the body's own: read them, or copy what is to be kept.

    Attributes:
        robot: whose body it is.
        model: ``mujoco.MjModel``.
        data: ``mujoco.MjData``.
        stand: the robot file's offsets, rad, shape (joints,).

    """

    def __init__(self, name: str, robot: Robot, kp: float | None = None,
                 kd: float | None = None, timestep: float = 0.002,
                 add: Callable[[Any], None] | None = None,
                 say: Callable[[str], None] = lambda line: None) -> None:
        """Load a model and stand it up; arguments as of ``robot_model.load``.

        Raises:
            SimulationError: MuJoCo is missing, or the model cannot be used.

        """
        mujoco = engine()
        self.robot = robot
        self.model: Any = load(name, robot, kp, kd, timestep, add=add, say=say)
        self.data: Any = mujoco.MjData(self.model)
        #: The joints at their targets.
        self._posed: Any = mujoco.MjData(self.model)
        self._step = mujoco.mj_step
        self.stand = robot.column('offset')[robot.order_indices]
        self._kp, self._kp_scale = self.model.actuator_gainprm[:, 0].copy(), 1.0
        self._added: np.ndarray | float = 0.0
        count, n = len(robot.legs), len(robot.order)
        joints = self.model.actuator_trnid[:n, 0]
        self._held = list(robot.held.values())
        self._held_angles = self.model.jnt_qposadr[self.model.actuator_trnid[n:, 0]]
        self._held_speeds = self.model.jnt_dofadr[self.model.actuator_trnid[n:, 0]]
        self._angles = self.model.jnt_qposadr[joints]
        self._speeds = self.model.jnt_dofadr[joints]
        self._base = int(self.model.body_rootid[self.model.jnt_bodyid[joints[0]]])
        free = self.model.body_jntadr[self._base]
        self._at = slice(self.model.jnt_qposadr[free], self.model.jnt_qposadr[free] + 7)
        self._moving = slice(self.model.jnt_dofadr[free], self.model.jnt_dofadr[free] + 6)
        self._control = self.data.ctrl[:n]
        self._pose, self._rates = self.data.qpos[self._at], self.data.qvel[self._moving]
        self._pushed = 0
        self._forces = self.data.sensordata[:3 * count].reshape(count, 3)[:, 2]
        self._trunk = self.data.sensordata[3 * count:]
        self._feet = np.zeros(count)
        self._position, self._velocity, self._torque = np.zeros((3, n))
        self._rotation, self._twist = np.zeros(9), np.zeros(6)
        self._height: float | None = None
        self.reset()

    def reset(self) -> None:
        """Put the body upright at the origin, still, in its stand.

        Its lowest point just touches the floor, as it was when the body was made.

        Raises:
            SimulationError: nothing of it could.

        """
        mujoco, data = engine(), self.data
        mujoco.mj_resetData(self.model, data)
        self._pushed = 0
        data.qpos[self._angles] = self.stand
        data.qpos[self._held_angles] = data.ctrl[len(self.stand):] = self._held
        self._pose[:] = 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0
        if self._height is None:
            mujoco.mj_kinematics(self.model, data)
            self._height = -self._clearance(data)
        self._pose[2] = self._height
        self.command(self.stand)
        mujoco.mj_forward(self.model, data)

    def _clearance(self, data: Any) -> float:
        """Height of the body's lowest point above the floor, m, by an MjData."""
        mujoco, model = engine(), self.model
        planes = [geom for geom in range(model.ngeom) if model.geom_bodyid[geom] == 0
                  and model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_PLANE]
        own = [geom for geom in range(model.ngeom)
               if model.body_rootid[model.geom_bodyid[geom]] == self._base
               and (model.geom_contype[geom] or model.geom_conaffinity[geom])]
        if not planes or not own:
            raise SimulationError(f"the model of '{self.robot.name}' has no "
                                  + ('shapes that could touch the floor' if planes else 'floor'))
        return min(mujoco.mj_geomDistance(model, data, plane, geom, 100.0, None)
                   for plane in planes for geom in own)

    def command(self, angles: np.ndarray, torque: np.ndarray | float = 0.0) -> None:
        """Set the target angles of the joints, rad, and torques to add, N m, shape (joints,)."""
        # As part of the motor's force, which its limits confine.
        self._added = torque / (self._kp_scale * self._kp[:len(angles)])
        self._control[:] = angles + self._added

    @property
    def torque_limits(self) -> np.ndarray:
        """Largest torques of the motors, N m, shape (joints,); inf for those without a limit."""
        motors, n = self.model, len(self.stand)
        return np.where(motors.actuator_forcelimited[:n], abs(motors.actuator_forcerange[:n]).min(
            axis=1), math.inf)

    def hold(self, angles: np.ndarray) -> None:
        """Set the target angles of joints of no leg, rad, in the order of ``robot.held``."""
        self.data.ctrl[len(self.stand):] = angles

    def scale_kp(self, scale: float) -> None:
        """Scale the proportional gains of the joints by a factor."""
        if scale != self._kp_scale:
            self._kp_scale = scale
            self.model.actuator_gainprm[:, 0] = scale * self._kp
            self.model.actuator_biasprm[:, 1] = -scale * self._kp

    def load(self, mass: float) -> None:
        """Put a mass in kg on the base, where its own is."""
        if mass:
            add_payload(self.model, self._base, mass)
            engine().mj_setConst(self.model, self.data)
            self.reset()

    def push(self, force: np.ndarray, duration: float) -> None:
        """Push the base at its centre of mass with a force (N, x y z, world) for some seconds."""
        self.data.xfrc_applied[self._base, :3] = force
        self._pushed = max(1, round(duration / self.model.opt.timestep))

    def step(self) -> None:
        """Move on by one time step."""
        self._step(self.model, self.data)
        if self._pushed:
            self._pushed -= 1
            if not self._pushed:
                self.data.xfrc_applied[self._base, :3] = 0.0

    @property
    def gains(self) -> tuple[float, float]:
        """Proportional and damping gain of the joints, N m / rad and N m s / rad."""
        return float(self.model.actuator_gainprm[0, 0]), -float(self.model.actuator_biasprm[0, 2])

    @property
    def mass(self) -> float:
        """Mass of the robot, kg."""
        return float(self.model.body_mass.sum())

    @property
    def time(self) -> float:
        """Since the reset, s."""
        return self.data.time

    @property
    def diverged(self) -> bool:
        """Whether the physics has run away since the reset; MuJoCo then begins anew by itself."""
        mujoco, warning = engine(), self.data.warning
        return any(warning[int(kind)].number for kind in (
            mujoco.mjtWarning.mjWARN_BADQPOS, mujoco.mjtWarning.mjWARN_BADQVEL,
            mujoco.mjtWarning.mjWARN_BADQACC))

    @property
    def position(self) -> np.ndarray:
        """Angles of the joints, rad."""
        return np.take(self.data.qpos, self._angles, out=self._position)

    @property
    def velocity(self) -> np.ndarray:
        """Speeds of the joints, rad/s."""
        return np.take(self.data.qvel, self._speeds, out=self._velocity)

    @property
    def torque(self) -> np.ndarray:
        """Torques of the motors in the last step, N m."""
        return np.take(self.data.qfrc_actuator, self._speeds, out=self._torque)

    @property
    def held(self) -> np.ndarray:
        """Angles, speeds and torques of the joints that are held, rad, rad/s, N m: (3, joints)."""
        data, speeds = self.data, self._held_speeds
        return np.array([data.qpos[self._held_angles], data.qvel[speeds],
                         data.qfrc_actuator[speeds]])

    @property
    def feet(self) -> np.ndarray:
        """Upward force of the floor on each leg in the last step, N."""
        return np.negative(self._forces, out=self._feet)

    @property
    def base(self) -> np.ndarray:
        """Position of the base, m."""
        return self._pose[:3]

    @property
    def quaternion(self) -> np.ndarray:
        """Orientation of the base, w x y z."""
        return self._pose[3:]

    @property
    def rates(self) -> np.ndarray:
        """Velocity in the world's frame, m/s, then angular velocity in the base's, rad/s."""
        return self._rates

    @property
    def twist(self) -> np.ndarray:
        """Velocity in m/s (x y z), then angular velocity in rad/s, both in the base's frame."""
        np.matmul(self._rates[:3], self.axes, out=self._twist[:3])
        self._twist[3:] = self._rates[3:]
        return self._twist

    @property
    def yaw(self) -> float:
        """Heading, rad, from -pi to pi."""
        return float(rpy_of(self.quaternion)[2])

    @property
    def fallen(self) -> bool:
        """Whether the base leans more than MAX_LEAN or lies on the floor."""
        return self._upright < math.cos(MAX_LEAN) or self._trunk[0] > 0.0

    @property
    def sits(self) -> bool:
        """Whether the base lies level on the floor, and the legs are to be folded."""
        if self._trunk[0] <= 0.0 or self._upright < math.cos(MAX_SEATED_LEAN):
            return False
        assert self._height is not None
        mujoco, posed = engine(), self._posed
        posed.qpos[self._at] = 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0
        posed.qpos[self._angles] = self._control - self._added
        mujoco.mj_kinematics(self.model, posed)
        return -self._clearance(posed) < MAX_SEATED_HEIGHT * self._height

    @property
    def _upright(self) -> float:
        """Cosine of the base's lean."""
        _, x, y, _ = self.quaternion
        return 1.0 - 2.0 * (x * x + y * y)

    @property
    def axes(self) -> np.ndarray:
        """Rotation from the base's frame to the world's, shape (3, 3)."""
        engine().mju_quat2Mat(self._rotation, self.quaternion)
        return self._rotation.reshape(3, 3)


# Indices of a robot's parts in its model: base, joints and feet.

class Anatomy:
    """Indices into the arrays of a body's model.

    Attributes:
        base: body of the free joint.
        pose: the base's position and quaternion in qpos.
        angles: joints in qpos, in the order of controllers, shape (joints,).
        speeds: joints in qvel.
        feet: the geom of each leg that is lowest in the stand, as the file orders legs.
        bodies: of these geoms, shape (legs,).
        soles: the middle of a foot that is a ball, else its lowest point in the stand, m, in the
            frames of these bodies, shape (legs, 3).

    """

    def __init__(self, body: Body) -> None:
        mujoco, model, data = engine(), body.model, body.data
        joints = model.actuator_trnid[:, 0]
        self.angles, self.speeds = model.jnt_qposadr[joints], model.jnt_dofadr[joints]
        self.base = int(model.body_rootid[model.jnt_bodyid[joints[0]]])
        start = int(model.jnt_qposadr[model.body_jntadr[self.base]])
        self.pose = np.arange(start, start + 7)

        body.reset()
        floor = int(np.flatnonzero(model.geom_type == mujoco.mjtGeom.mjGEOM_PLANE)[0])
        self.feet, soles = [], []
        for leg in body.robot.legs:
            own = {model.joint(joint.name).bodyid[0] for joint in body.robot.legs[leg]}
            geoms = [geom for geom in range(model.ngeom)
                     if (model.geom_contype[geom] or model.geom_conaffinity[geom])
                     and own & set(_ancestors(model, model.geom_bodyid[geom]))]
            if not geoms:
                raise SimulationError(f'model: leg {leg} has no shape that could touch the floor')
            foot = min(geoms, key=lambda geom: mujoco.mj_geomDistance(
                model, data, floor, geom, 100.0, None))
            self.feet.append(foot)
            ends = np.zeros(6)
            mujoco.mj_geomDistance(model, data, floor, foot, 100.0, ends)
            if model.geom_type[foot] == mujoco.mjtGeom.mjGEOM_SPHERE:
                ends[3:] = data.geom_xpos[foot]
            body_id = model.geom_bodyid[foot]
            rotation = data.xmat[body_id].reshape(3, 3)
            soles.append((ends[3:] - data.xpos[body_id]) @ rotation)
        self.bodies, self.soles = model.geom_bodyid[self.feet], np.array(soles)

    def sole_positions(self, data: Any) -> np.ndarray:
        """Return the positions of the soles in a ``mujoco.MjData``, m, shape (legs, 3)."""
        rotations = data.xmat[self.bodies].reshape(-1, 3, 3)
        return data.xpos[self.bodies] + (rotations @ self.soles[:, :, None])[:, :, 0]


def _ancestors(model: object, body: int) -> list[int]:
    bodies = [body]
    while bodies[-1]:
        bodies.append(model.body_parentid[bodies[-1]])  # type: ignore[attr-defined]
    return bodies


# Soft start: the path to commanded angles that are far from the joints, or already moving.

#: FOLLOWED_DISTANCE: distance up to which commanded angles are followed at once, rad.
FOLLOWED_DISTANCE = 0.05


class Approach:
    """Leads joints from their present angles to commanded ones, each leg in a smooth step.

    A gait that is in full swing grows out of the stand without a jerk. Commands that begin where a
    leg is are followed at once, as those of a generator that ramps in from the stand. A leg may be
    commanded earlier than another.
    """

    def __init__(self, steps: int, angles: np.ndarray, legs: np.ndarray) -> None:
        """Be at ``angles``, rad; an approach takes ``steps`` calls of ``towards``.

        ``legs`` has the index from 0 of each joint's leg; arrays have shape (joints,).
        """
        self._steps, self._legs = steps, legs
        self.begin(angles)

    def begin(self, angles: np.ndarray) -> None:
        """Be at these angles, rad; the next ones that differ are approached."""
        self._start = np.array(angles, dtype=float)
        self._done = np.zeros(self._legs.max() + 1, dtype=int)
        self._there = False

    def towards(self, commanded: np.ndarray) -> np.ndarray:
        """Return the target angles of this step, rad, shape (joints,)."""
        if self._there:
            return commanded
        way, done, steps = commanded - self._start, self._done, self._steps
        far = np.zeros(len(done))
        np.maximum.at(far, self._legs, np.abs(way))
        done[(done == 0) & (far > 0.0) & (far <= FOLLOWED_DISTANCE)] = steps
        done[((done > 0) | (far > 0.0)) & (done < steps)] += 1
        self._there = bool((done == steps).all())
        fraction = smoothstep(done / steps)
        return np.where((done == steps)[self._legs], commanded,
                        self._start + fraction[self._legs] * way)

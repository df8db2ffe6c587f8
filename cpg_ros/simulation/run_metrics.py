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

"""Metrics of a run of a body."""

from dataclasses import dataclass
import math
from typing import Any

from cpg_ros.feedback.kinematics import GRAVITY
from cpg_ros.fitting.gaits.steady_stretch import true_runs
from cpg_ros.motion.rotations import rpy_of
from cpg_ros.simulation.body import Anatomy, Body, MAX_LEAN
from cpg_ros.simulation.robot_model import engine
import numpy as np

#: SETTLING_TIME: first part of a run that metrics of the steady gait ignore, s.
SETTLING_TIME = 2.0
#: SAMPLE_PERIOD: time between samples of the feet's positions, s.
SAMPLE_PERIOD = 0.01
#: MIN_FLIGHT_TIME: least time with all feet off the floor that counts as a hop, s.
MIN_FLIGHT_TIME = 0.02


@dataclass(frozen=True)
class RunMetrics:
    """Metrics of one run; those marked * exclude its first SETTLING_TIME seconds.

    Attributes:
        distance: forward, along the initial heading, m.
        drift: to the left of it, m.
        heading: at the end, positive to the left, degrees.
        speed: * mean over ground, along the body's own heading, m/s.
        turn: * mean yaw rate, rad/s.
        height: * mean of the base, m.
        bob: * standard deviation of the height, m.
        roll, pitch: * largest absolute angle, degrees.
        sway: * root mean square of roll and pitch together, degrees.
        fell: time of the fall, s; infinite if there was none.
        hops: number of times that all feet left the floor.
        duty: * fraction of the time that a foot is on the floor, mean of all.
        cost: * of transport: mechanical work of the motors, none regained, per weight and metre.
        saturation: fraction of time and motors at the torque limit.
        slip: * distance that feet slide on the floor per metre that the body moves.
        lift: * height that a foot exceeds for a tenth of the time, minimum over legs, m.

    """

    distance: float
    drift: float
    heading: float
    speed: float
    turn: float
    height: float
    bob: float
    roll: float
    pitch: float
    sway: float
    fell: float
    hops: int
    duty: float
    cost: float
    saturation: float
    slip: float
    lift: float

    @property
    def upright(self) -> bool:
        """Whether the robot did not fall."""
        return math.isinf(self.fell)


def metrics_of(body: Body, parts: Anatomy, target: np.ndarray, own: Any,
               states: np.ndarray, sensors: np.ndarray) -> RunMetrics:
    """Return the metrics of a run.

    Args:
        body: of the robot.
        parts: of its model.
        target: target angles of the joints, rad, shape (steps, joints).
        own: model of the run, with its masses and servos' gains.
        states: after each step, as of mjSTATE_FULLPHYSICS, shape (steps, states).
        sensors: after each step, as of ``model.load``, shape (steps, sensors).

    """
    model, dt = body.model, body.model.opt.timestep
    position, angles, rates = states[:, 1:1 + model.nq], parts.angles, parts.speeds
    moving = states[:, 1 + model.nq:1 + model.nq + model.nv]
    pose = position[:, parts.pose]
    _, x, y, _ = pose[:, 3:].T
    roll, pitch, yaw = rpy_of(pose[:, 3:]).T
    yaw = np.unwrap(yaw)
    legs = len(body.robot.legs)
    force = -sensors[:, :3 * legs].reshape(len(sensors), legs, 3)[:, :, 2]
    touching: np.ndarray = force > 1.0
    down = (1.0 - 2.0 * (x * x + y * y) < math.cos(MAX_LEAN)) | (sensors[:, 3 * legs] > 0.0)
    fell = float(states[down.argmax(), 0]) if down.any() else math.inf

    later = slice(min(round(SETTLING_TIME / dt), len(states) // 2), None)
    every = max(1, round(SAMPLE_PERIOD / dt))
    feet = _feet(body, parts, position[later][::every])
    path = np.diff(pose[later, :2], axis=0)
    middle = 0.5 * (yaw[later][1:] + yaw[later][:-1])
    way = float((path[:, 0] * np.cos(middle) + path[:, 1] * np.sin(middle)).sum())
    time = dt * len(path)
    speeds = moving[:, rates]
    torque, applied = torques(own, target, position[:, angles], speeds)
    work = float(motor_power(applied, speeds)[later].sum()) * dt
    return RunMetrics(
        distance=float(pose[-1, 0]), drift=float(pose[-1, 1]),
        heading=math.degrees(yaw[-1]), speed=way / time,
        turn=float(yaw[later][-1] - yaw[later][0]) / time,
        height=float(pose[later, 2].mean()), bob=float(pose[later, 2].std()),
        roll=math.degrees(np.abs(roll[later]).max()),
        pitch=math.degrees(np.abs(pitch[later]).max()),
        sway=math.degrees(math.sqrt(float((roll[later]**2 + pitch[later]**2).mean()))),
        fell=fell, hops=_hops(np.any(touching, axis=1), dt), duty=float(touching[later].mean()),
        cost=float(cost_of_transport(work, GRAVITY * float(own.body_mass.sum()), way)),
        saturation=float((torque != applied).mean()),
        slip=_slide(feet, touching[later][::every]) / max(abs(way), 1e-3),
        lift=float(np.subtract(*np.percentile(feet[:, :, 2], [90.0, 10.0], axis=0)).min()))


def motor_power(torque: np.ndarray, speed: np.ndarray) -> np.ndarray:
    """Return the mechanical power of all motors, none regained, W: the sum over the last axis."""
    return np.maximum(torque * speed, 0.0).sum(axis=-1)


def cost_of_transport(work: float | np.ndarray, weight: float, distance: float | np.ndarray
                      ) -> np.ndarray:
    """Return work in J per weight in N and distance in m."""
    return work / (weight * np.maximum(np.abs(distance), 1e-3))


def torques(model: Any, target: np.ndarray, angles: np.ndarray, speeds: np.ndarray,
            kp_scale: float | np.ndarray = 1.0, kd_scale: float | np.ndarray = 1.0
            ) -> tuple[np.ndarray, np.ndarray]:
    """Return the torques that servos request, and those within their limits, N m.

    Args:
        model: of the body.
        target: target angles of the joints, rad, shape (n, joints), controllers' order.
        angles: of the joints, rad, the same shape.
        speeds: of the joints, rad/s, the same shape.
        kp_scale: factor of the proportional gains, for each row if an array, shape (n,).
        kd_scale: the same of the damping gains.

    """
    stiffness, damping = model.actuator_gainprm[:, 0], -model.actuator_biasprm[:, 2]
    torque = (stiffness * np.reshape(kp_scale, (-1, 1)) * (target - angles)
              - damping * np.reshape(kd_scale, (-1, 1)) * speeds)
    limits = np.where(model.actuator_forcelimited.astype(bool)[:, None],
                      model.actuator_forcerange, [-np.inf, np.inf])
    return torque, np.clip(torque, *limits.T)


def _hops(touching: np.ndarray, dt: float) -> int:
    """Count the stretches without any foot on the floor that last MIN_FLIGHT_TIME."""
    first, last = true_runs(~touching).T
    return int(((last - first + 1) * dt >= MIN_FLIGHT_TIME).sum())


def _feet(body: Body, parts: Anatomy, poses: np.ndarray) -> np.ndarray:
    """Return the positions of the feet, m, shape (poses, legs, 3)."""
    mujoco, data = engine(), engine().MjData(body.model)
    feet = np.empty((len(poses), len(parts.soles), 3))
    for row, position in zip(feet, poses, strict=True):
        data.qpos[:] = position
        mujoco.mj_kinematics(body.model, data)
        row[:] = parts.sole_positions(data)
    return feet


def _slide(feet: np.ndarray, touching: np.ndarray) -> float:
    """Sum the distances that feet slide while they touch the floor, mean of all legs, m."""
    ways = np.linalg.norm(np.diff(feet[:, :, :2], axis=0), axis=2)
    return float((ways * (touching[1:] & touching[:-1])).sum()) / feet.shape[1]

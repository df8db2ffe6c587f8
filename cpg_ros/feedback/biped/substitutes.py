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

"""Substitutes for missing measurements of a biped, for the time that it needs to stop.

For a few ticks measured values go on as their rates say. Later the sole that bears more stands for
the inertial unit: it is level and still, so the joints say how the base leans and turns. The force
that the legs were to exert accelerates the centre of mass, and from it and the joints follows how
the base accelerates. Loads on the feet are those that the clock gives them. Joints move as they
must for soles that stand to be still and those that swing to be on their paths, while the base
moves as the inertial unit says.
"""

import math
from typing import NamedTuple

from cpg_ros.dynamics.integration.compilation import jit
from cpg_ros.feedback.biped.gains import WALK
from cpg_ros.feedback.biped.links import (
    blank_pose,
    carry,
    center_velocity,
    column,
    Links,
    place,
    Pose,
    sole_velocity,
)
from cpg_ros.feedback.biped.stepping import WALKS
from cpg_ros.feedback.estimate import SensorData
from cpg_ros.feedback.kinematics import cross, GRAVITY
import numpy as np

#: Inputs in the order of their ages.
IMU, JOINTS, FEET = range(3)
#: MAX_EXTRAPOLATION: age, s, up to which a measurement is extrapolated by its rate; later it is
#: replaced.
MAX_EXTRAPOLATION = 0.05
#: MIN_EXTRAPOLATION: age, s, above which a measurement that has just arrived is extrapolated, too.
MIN_EXTRAPOLATION = 0.008
#: PATH_GAIN: rate at which a predicted sole approaches its path, 1/s; DAMPING: damping of the
#: least squares that give the rates of the joints.
PATH_GAIN, DAMPING = 20.0, 1e-3
#: MAX_JOINT_SPEED: largest rate of a predicted joint, rad/s.
MAX_JOINT_SPEED = 15.0
#: MAX_IMU_AGE: age of the inertial unit, s, from which on a sole stands for it, where joints are
#: known.
MAX_IMU_AGE = 0.025
#: ADOPTION_TIME: duration of the transition to orientation and angular velocity from the sole, s.
ADOPTION_TIME = 0.02


#: NUM_TICKS: ticks that are kept of the last stride; PHASE_TOLERANCE: largest difference of a kept
#: tick's phase from the present one, cycles.
NUM_TICKS, PHASE_TOLERANCE = 512, 0.02


class LastStride(NamedTuple):
    """Commands of the last stride of a walk, repeated when no measurement arrives.

    A steady walk is periodic: its own last commands hold the torques that legs and body need of
    each other, which no prediction of a moment later does.

    Attributes:
        commands: of the legs' joints in ``robot.order``, rad, shape (NUM_TICKS, joints).
        phases: of the first leg at these, cycles, infinite for none, shape (NUM_TICKS,).
        row: that comes next, shape (1,).

    """

    commands: np.ndarray
    phases: np.ndarray
    row: np.ndarray

    @classmethod
    def empty(cls, joints: int) -> 'LastStride':
        """Return one without any command."""
        return cls(np.zeros((NUM_TICKS, joints)), np.full(NUM_TICKS, math.inf),
                   np.zeros(1, dtype=np.int64))


@jit
def record(stride, mode, kind, phase, position, indices):
    """Store the command of one tick of a walk.

    Args:
        stride: LastStride, changed in place.
        mode: of the feedback.
        kind: of its gait.
        phase: of the first leg, cycles.
        position: of all joints, rad.
        indices: of the legs' joints among these, in ``robot.order``, shape (joints,).

    """
    if mode != WALK or kind != WALKS:
        stride.phases[:] = math.inf
        return
    row = stride.row[0]
    for k in range(len(indices)):
        stride.commands[row, k] = position[indices[k]]
    stride.phases[row] = phase
    stride.row[0] = (row + 1) % NUM_TICKS


@jit
def replay(stride, phase, command):
    """Replace a command, rad, shape (joints,), by the stored one nearest in phase, cycles."""
    nearest, row = PHASE_TOLERANCE, -1
    for k in range(NUM_TICKS):
        if math.isfinite(stride.phases[k]):
            off = abs((stride.phases[k] - phase + 0.5) % 1.0 - 0.5)
            if off < nearest:
                nearest, row = off, k
    if row >= 0:
        command[:] = stride.commands[row]


class Substitutes(NamedTuple):
    """Measurements of one biped, with substitutes for missing ones, and scratch memory.

    Attributes:
        sensors: measurements with the gaps filled.
        angles: of the joints as they are predicted, rad, shape (joints,).
        pose: of the links, scratch.
        center: velocity of the centre of mass, scratch, shape (3,).
        sole: velocity of a sole, scratch, shape (6,).
        rpy: of the base, scratch, shape (3,).
        columns: of a leg's Jacobian, scratch, shape (joints of a leg, 6).
        system: of equations, scratch, shape (6, 7).

    """

    sensors: SensorData
    angles: np.ndarray
    pose: Pose
    center: np.ndarray
    sole: np.ndarray
    rpy: np.ndarray
    columns: np.ndarray
    system: np.ndarray

    @classmethod
    def empty(cls, links: Links) -> 'Substitutes':
        """Return those of a robot that was not measured yet."""
        joints, (legs, size) = len(links.masses) - 1, links.chains.shape
        return cls(SensorData.zeros(1, legs, joints), np.zeros(joints), blank_pose(links),
                   np.zeros(3), np.zeros(6), np.zeros(3), np.zeros((size, 6)), np.zeros((6, 7)))


@jit
def fill(links, measured, known, memory, own, dt):
    """Fill the present measurements, with substitutes for late ones.

    Args:
        links: Links of the robot.
        measured: SensorData, the last valid ones.
        known: of them: used: time since those of inertial unit, joints and feet arrived, s,
            shape (3,); latencies: time since they were measured, s, shape (3,); suspect: the joint
            whose own measurement is not to be used, -1 for none.
        memory: BipedMemory at the last tick.
        own: Substitutes, of which the sensors are filled.
        dt: of a tick, s; younger measurements are taken as they are.

    """
    laws, ages, latencies = memory.laws[0], known.used, known.latencies
    sensors = own.sensors
    sensors.joint_positions[:], sensors.joint_velocities[:] = (measured.joint_positions,
                                                               measured.joint_velocities)
    sensors.foot_forces[:], sensors.rpy[:] = measured.foot_forces, measured.rpy
    sensors.angular_velocity[:] = measured.angular_velocity
    sensors.acceleration[:] = measured.acceleration
    late_imu, late_joints = ages[IMU] > 1.5 * dt, ages[JOINTS] > 1.5 * dt
    if late_joints:
        _move(links, memory, own, dt)
    else:
        _take_joints(links, latencies[JOINTS], memory, known.suspect, measured, own, dt)
    time = max(ages[IMU], latencies[IMU])
    if late_imu or time > MIN_EXTRAPOLATION:
        _turn(measured, sensors.rpy[0], min(time, MAX_EXTRAPOLATION))
    begins = MAX_EXTRAPOLATION if late_joints else MAX_IMU_AGE
    if ages[IMU] > begins:
        # In a stand, one that arrives but is not believed may be that of a robot on its edges.
        pushed = latencies[IMU] < MAX_IMU_AGE and not (laws.swinging[0] or laws.swinging[1])
        _lean_on_sole(links, memory, own, min((ages[IMU] - begins) / ADOPTION_TIME, 1.0), dt,
                      pushed)
    if late_imu and late_joints:
        # Neither input tells how the base turns: let its angular velocity fade.
        fading = max(1.0 - min(ages[IMU], ages[JOINTS], ages[FEET]) / MAX_EXTRAPOLATION, 0.0)
        for k in range(3):
            sensors.angular_velocity[0, k] *= fading
    if ages[FEET] > MAX_EXTRAPOLATION:
        weight = GRAVITY * memory.pose.carried[0]
        for leg in range(2):
            sensors.foot_forces[0, leg] = (0.0 if laws.swinging[leg]
                                           else weight * laws.fractions[leg])


@jit
def sole_tilts(links, sensors, own, tilts):
    """Fill how far each sole leans forward and left by IMU and joints, rad, shape (2, 2)."""
    rpy = own.rpy
    rpy[0], rpy[1], rpy[2] = sensors.rpy[0, 0], sensors.rpy[0, 1], 0.0
    place(links, rpy, sensors.joint_positions[0], own.pose)
    for leg in range(2):
        turn = own.pose.rotations[links.chains[leg, -1]]
        tilts[leg, 0], tilts[leg, 1] = turn[0, 2], turn[1, 2]


@jit
def _take_joints(links, latency, memory, suspect, measured, own, dt):
    """Use the joints as measured a latency in s ago, except the suspect."""
    angles, rates = own.sensors.joint_positions[0], own.sensors.joint_velocities[0]
    ahead = min(latency, MAX_EXTRAPOLATION) if latency > MIN_EXTRAPOLATION else 0.0
    predicted, rate = 0.0, 0.0
    if suspect >= 0:
        _move(links, memory, own, dt)
        predicted, rate = own.angles[suspect], rates[suspect]
    for k in range(len(rates)):
        rates[k] = measured.joint_velocities[0, k]
        angles[k] = measured.joint_positions[0, k] + ahead * rates[k]
    if suspect >= 0:
        angles[suspect], rates[suspect] = predicted, rate
    own.angles[:] = angles


@jit
def _solve(system):
    """Solve a symmetric positive definite system in place; the solution is its last column."""
    size = len(system)
    for k in range(size):
        for row in range(size):
            if row != k:
                factor = system[row, k] / system[k, k]
                for entry in range(k, size + 1):
                    system[row, entry] -= factor * system[k, entry]
    for k in range(size):
        system[k, size] /= system[k, k]


@jit
def _move(links, memory, own, dt):
    """Predict the leg joints dt in s ahead."""
    laws = memory.laws[0]
    pose, rates, columns, system = (memory.pose, own.sensors.joint_velocities[0], own.columns,
                                    own.system)
    rates[:] = 0.0
    for leg in range(2):
        chain, sole = links.chains[leg], pose.soles[leg]
        turned = cross(laws.turning, sole)
        for k in range(3):
            system[k, 6], system[3 + k, 6] = -(laws.velocity[k] + turned[k]), -laws.turning[k]
            if laws.swinging[leg]:
                system[k, 6] += laws.path[1, k] + PATH_GAIN * (laws.path[0, k] - sole[k])
        for j in range(len(chain)):
            moved, axis = column(pose, chain[j], sole), pose.axes[chain[j]]
            for k in range(3):
                columns[j, k], columns[j, 3 + k] = moved[k], axis[k]
        for row in range(6):
            for k in range(6):
                system[row, k] = DAMPING if row == k else 0.0
                for j in range(len(chain)):
                    system[row, k] += columns[j, row] * columns[j, k]
        _solve(system)
        for j in range(len(chain)):
            rate = 0.0
            for k in range(6):
                rate += columns[j, k] * system[k, 6]
            rates[chain[j] - 1] = rate
    for k in range(len(rates)):
        own.angles[k] += dt * min(max(rates[k], -MAX_JOINT_SPEED), MAX_JOINT_SPEED)
    own.sensors.joint_positions[0] = own.angles


@jit
def _turn(measured, rpy, time):
    """Extrapolate roll, pitch and yaw, rad, by the angular velocity for a time in s."""
    roll, pitch, turning = measured.rpy[0, 0], measured.rpy[0, 1], measured.angular_velocity[0]
    c, s, cosine = math.cos(roll), math.sin(roll), max(math.cos(pitch), 0.1)
    about = (s * turning[1] + c * turning[2]) / cosine
    rpy[0] += time * (turning[0] + math.sin(pitch) * about)
    rpy[1] += time * (c * turning[1] - s * turning[2])
    rpy[2] += time * about


@jit
def _lean_on_sole(links, memory, own, fraction, dt, pushed):
    """Set lean and rates of the base from the joints of the more loaded leg."""
    laws = memory.laws[0]
    sensors, pose, still = own.sensors, own.pose, own.rpy
    joints, rates, rpy = sensors.joint_positions[0], sensors.joint_velocities[0], sensors.rpy[0]
    angular = sensors.angular_velocity[0]
    still[:] = 0.0
    place(links, still, joints, pose)
    # By the loads, as a foot that is late is not level yet when the clock has it land.
    leg = 1 if laws.loads[1] > laws.loads[0] else 0
    sole_velocity(links, pose, leg, still, rates, own.sole)
    # The base seen from the sole: the sole's rotation from the base, transposed.
    turned = pose.rotations[links.chains[leg, -1]]
    # As the inertial unit would measure it, whose roll error the laws subtract.
    rpy[0] += fraction * (math.atan2(turned[1, 2], turned[2, 2]) + laws.roll_error - rpy[0])
    rpy[1] += fraction * (math.asin(-min(max(turned[0, 2], -1.0), 1.0)) - rpy[1])
    rpy[2] = laws.heading
    for k in range(3):
        angular[k] += fraction * (-own.sole[3 + k] - angular[k])
    # The centre of mass goes as the force of the last tick moves it, and the base as it has to
    # while legs move against it.
    turn, turning = memory.pose.rotations[0], own.sole
    for k in range(3):
        turning[k] = carry(turn, angular, k)
    place(links, rpy, joints, pose)
    center_velocity(pose, turning, rates, own.center)
    mass, moved = pose.carried[0], own.center
    for k in range(3):
        moved[k] = laws.force[k] / mass - (moved[k] - laws.center[1, k] + laws.velocity[k]) / dt
    moved[2] += GRAVITY - laws.force[2] / mass
    if pushed:
        # Feet on their edges do not exert that force: it topples about the middle of a sole.
        foot = 1 if laws.fractions[1] > laws.fractions[0] else 0
        center, sole = laws.center[0], memory.pose.soles[foot]
        pull = GRAVITY / max(center[2] - sole[2], 0.1)
        moved[0], moved[1] = pull * (center[0] - sole[0]), pull * (center[1] - sole[1])
        moved[2] = GRAVITY
    for k in range(3):
        sensors.acceleration[0, k] = turn[0, k] * moved[0] + turn[1, k] * moved[1] + (
            turn[2, k] * moved[2])

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

"""Velocity of a biped's base, its arms, and the forces of the stance legs.

The laws request one force and one moment of the ground. The horizontal force points from the
centre of pressure to the centre of mass, so that it does not turn the body; the moment is added.
The legs share both, and each leg's joints get the torques J' F.
"""

import math
from typing import NamedTuple

from cpg_ros.dynamics.integration.compilation import jit
from cpg_ros.dynamics.integration.memory import number_at
from cpg_ros.feedback.biped.links import carry
from cpg_ros.feedback.kinematics import GRAVITY
from cpg_ros.feedback.laws.law import Gain
from cpg_ros.motion.plan import GaitPlan
from cpg_ros.motion.robot import Robot
import numpy as np

# Velocity of a biped's base, from the soles that stand and the accelerometer.

VELOCITY_GAINS = {'velocity_time': Gain(0.03, 1.0, 's',
                                        'in which the soles that stand correct the '
                               "accelerometer's velocity")}
#: A sole begins to count at a load of MIN_LOAD, and counts in full at MIN_LOAD + LOAD_RANGE,
#: fractions of the weight.
MIN_LOAD, LOAD_RANGE = 0.06, 0.18
#: SLIP_SPEED: speed of a sole at which it counts half, m/s; ROLL_SPEED: angular speed with the
#: same effect, rad/s.
SLIP_SPEED, ROLL_SPEED = 0.2, 1.0


@jit
def update(turn, acceleration, soles, loads, dt, gains, velocity):
    """Update the base's velocity, world's axes, m/s, shape (3,), in place.

    Args:
        turn: rotation of the base, shape (3, 3).
        acceleration: as an accelerometer measures it, m/s^2, shape (3,).
        soles: velocities of the soles relative to the base, m/s and rad/s, shape (2, 6).
        loads: fraction of the weight on each foot, shape (2,).
        dt: since the last time, s.
        gains: BipedGains.
        velocity: changed.

    """
    for k in range(3):
        velocity[k] += dt * (carry(turn, acceleration, k) - (GRAVITY if k == 2 else 0.0))
    first, second = _trust(soles[0], loads[0], velocity), _trust(soles[1], loads[1], velocity)
    total = first + second
    if total > 0.0:
        pull = (1.0 - math.exp(-dt * min(total, 1.0) / max(gains.velocity_time, 1e-4))) / total
        for k in range(3):
            # A sole that stands is still in the world: the base moves opposite to its relative
            # velocity.
            velocity[k] -= pull * (first * (soles[0, k] + velocity[k])
                                   + second * (soles[1, k] + velocity[k]))


# Roll error of an inertial unit that is tilted, or whose filter is biased.

#: ROLL_TIME_WALK, ROLL_TIME_STAND: time constants in a walk and in a stand, s; MAX_ROLL_ERROR:
#: largest error, rad.
ROLL_TIME_WALK, ROLL_TIME_STAND, MAX_ROLL_ERROR = 2.0, 0.7, 0.06
#: MAX_LOAD_ERROR: by how much the loads of two feet may differ from the weight, as a fraction of
#: it; MIN_FOOT_LOAD: least fraction on each.
MAX_LOAD_ERROR, MIN_FOOT_LOAD = 0.1, 0.1


@jit
def show_balance(loads):
    """Return whether the measured loads, fractions of the weight, are those of two feet."""
    whole = abs(loads[0] + loads[1] - 1.0) < MAX_LOAD_ERROR
    return whole and min(loads[0], loads[1]) > MIN_FOOT_LOAD


@jit
def roll_error(error, lean, faster, step):
    """Return the roll error of the inertial unit, rad, a tick later.

    The centre of mass moves as c'' = g (c - p) / h by the centre of pressure p. A roll measured
    too large by e puts it to the right by h e: e' = (c'' / g - (c - p) / h) / time approaches e.

    Args:
        error: a tick earlier, rad.
        lean: (c - p) / h to the left, with that error subtracted.
        faster: change of the centre of mass's speed to the left, m/s.
        step: duration of the tick, s, and the time constant, s.

    """
    dt, time = step
    return min(max(error + (faster / GRAVITY - dt * lean) / time, -MAX_ROLL_ERROR), MAX_ROLL_ERROR)


@jit
def _trust(sole, load, velocity):
    """Return the weight of a sole in the velocity, 0 to 1: 1 if it bears load and is still.

    One that turns rolls over an edge or strikes the ground; one that moves at this velocity of the
    base slips. It still counts a little, since integrated accelerations drift.
    """
    off = turned = 0.0
    for k in range(3):
        off += (sole[k] + velocity[k])**2
        turned += sole[3 + k]**2
    return min(max((load - MIN_LOAD) / LOAD_RANGE, 0.0), 1.0) / (
        (1.0 + off / SLIP_SPEED**2) * (1.0 + turned / ROLL_SPEED**2))


# Arms of a biped: joints of no leg that swing with the waveforms of the network's cells.

#: ARM_RAMP: duration of the ramp from rest to the full swing of the arms, and back, s.
ARM_RAMP = 1.0
#: MAX_JOINT_SPEED: largest speed of a joint, rad/s, also while gaits change.
MAX_JOINT_SPEED = 10.0
#: SAMPLES: number of points of an orbit from which the range of a cell is read.
SAMPLES = 256


class Arms(NamedTuple):
    """Target angles of the joints that a robot file holds, which may swing with the cells.

    One with a cell and a swing goes by that many radians about its angle as the cell's last
    variable goes from its mean to its peak; the others stay where they are held. Of a Morris-Lecar
    cell that is the recovery variable, a quarter of a stride behind the voltage: an arm that is
    driven by the other leg's flexor is fastest forward as that leg is, which takes the yaw of the
    swing.

    Attributes:
        rest: where they are held, rad, shape (joints,), in the order of the robot file.
        swings: how far they go from there, rad, the same.
        cells: index of the cell of each, the same.
        indices: index of that variable in the state of each gait's network, shape (gaits, joints).
        middle, half: of its range, the same.
        waves: of the variables, -1 to 1, shape (joints,).
        level: 0 at rest to 1 in full swing, shape (1,).
        positions: where they are to be driven, rad, shape (joints,).

    """

    rest: np.ndarray
    swings: np.ndarray
    cells: np.ndarray
    indices: np.ndarray
    middle: np.ndarray
    half: np.ndarray
    waves: np.ndarray
    level: np.ndarray
    positions: np.ndarray

    @classmethod
    def of(cls, robot: Robot, gaits: int) -> 'Arms':
        """Return those of a robot at rest, with room for a number of gaits."""
        links = robot.biped.links if robot.biped is not None else {}
        rest, room = np.array(list(robot.held.values())), (gaits, len(robot.held))
        return cls(rest, np.array([links[name].swing for name in robot.held]),
                   np.array([max(links[name].cell - 1, 0) for name in robot.held], dtype=np.int64),
                   np.zeros(room, dtype=np.int64), np.zeros(room), np.ones(room),
                   np.zeros(rest.size), np.zeros(1), rest.copy())

    def learn(self, slot: int, plan: GaitPlan) -> None:
        """Read the range of the cells from a gait's orbit, and store it in the gait's slot."""
        orbit = plan.orbit
        network = orbit.network
        indices = self.cells + network.cells * (len(network.states) - 1)
        waves = orbit(np.arange(SAMPLES) / SAMPLES * orbit.period)[:, indices]
        low, high = waves.min(axis=0), waves.max(axis=0)
        self.indices[slot], self.middle[slot] = indices, 0.5 * (low + high)
        self.half[slot] = 0.5 * (high - low)


@jit
def swing_arms(arms, slot, state, moving, dt):
    """Advance the arms' positions by dt in s.

    Args:
        arms: Arms, changed in place.
        slot: place of the gait among the gaits.
        state: address of its network's state; 0 where it does not move.
        moving: whether arms are to swing; where they are not, they return to rest.
        dt: s.

    """
    arms.level[0] = min(max(arms.level[0] + (dt if moving else -dt) / ARM_RAMP, 0.0), 1.0)
    for k in range(len(arms.rest)):
        if state:
            value = number_at(state + 8 * arms.indices[slot, k])
            arms.waves[k] = (value - arms.middle[slot, k]) / arms.half[slot, k]
        target = arms.rest[k] + arms.level[0] * arms.swings[k] * arms.waves[k]
        step = MAX_JOINT_SPEED * dt
        arms.positions[k] += min(max(target - arms.positions[k], -step), step)


STANCE_GAINS = {
    'height': Gain(0.647, 3.0, 'm', 'of the centre of mass over the soles'),
    'height_kp': Gain(4186.0, 5e4, 'N/m', 'proportional gain of the upward force on the height'),
    'height_kd': Gain(246.0, 5e3, 'N s/m', 'derivative gain of the same'),
    'roll_kp': Gain(59.8, 5e3, 'N m/rad', 'proportional gain on roll'),
    'roll_kd': Gain(35.7, 500.0, 'N m s/rad', 'derivative gain of the same'),
    'pitch_kp': Gain(207.6, 5e3, 'N m/rad', 'proportional gain on pitch'),
    'pitch_kd': Gain(15.5, 500.0, 'N m s/rad', 'derivative gain of the same'),
    'yaw_kp': Gain(121.4, 5e3, 'N m/rad', 'proportional gain on the heading'),
    'yaw_kd': Gain(18.7, 500.0, 'N m s/rad', 'derivative gain of the same'),
    'lean': Gain(0.0662, 0.5, 'rad', 'pitch that the base is to have, positive forward',
                 low=-0.5),
    'cop_x': Gain(2.60, 10.0, '', 'shift of the centre of pressure by the DCM error'),
    'cop_y': Gain(0.769, 10.0, '', 'the same sideways'),
    'cop_reach_x': Gain(0.0566, 0.3, 'm', 'its largest shift from the middle of a sole'),
    'cop_reach_y': Gain(0.0247, 0.3, 'm', 'the same sideways'),
    'stand': Gain(2.5, 10.0, '', 'centre of pressure by the capture point while standing'),
    'stance_damping': Gain(1.63, 20.0, 'N m s/rad', 'of the joints of a leg that stands'),
    'reaction': Gain(0.0032, 1.5, '',
                     "fraction of the swing leg's moment that the stance leg gives"),
    'reaction_yaw': Gain(0.684, 1.5, '', 'the same about the vertical'),
    'friction': Gain(0.55, 2.0, '', 'largest horizontal force by the upward one'),
    'twist': Gain(14.0, 200.0, 'N m', 'largest moment about the vertical')}
#: MIN_FORCE, MAX_FORCE: limits of the upward force, as multiples of the weight.
MIN_FORCE, MAX_FORCE = 0.3, 1.8


@jit
def cop_shift(dcm_error, half, gains):
    """Return the centre of pressure's shift in the sole's axes, m.

    Args:
        dcm_error: forward and left, m.
        half: half the length and width of a sole, m.
        gains: BipedGains.

    """
    reach_x = min(gains.cop_reach_x, half[0])
    reach_y = min(gains.cop_reach_y, half[1])
    return (min(max(gains.cop_x * dcm_error[0], -reach_x), reach_x),
            min(max(gains.cop_y * dcm_error[1], -reach_y), reach_y))


@jit
def upward_force(target, height, rise, mass, gains):
    """Return the upward force that holds the body at a height, N.

    Args:
        target: height of the centre of mass over the soles that bear, m.
        height: that it has, m.
        rise: its upward speed, m/s.
        mass: of the robot, kg.
        gains: BipedGains.

    """
    weight = mass * GRAVITY
    up = weight + gains.height_kp * (target - height) - gains.height_kd * rise
    return min(max(up, MIN_FORCE * weight), MAX_FORCE * weight)


@jit
def ground_force(center, cop, up, moment, gains):
    """Return the requested force of the ground, N.

    Args:
        center: of mass, m.
        cop: centre of pressure, m.
        up: the upward force, N.
        moment: that is to turn the body, about x and y, N m.
        gains: BipedGains.

    """
    arm = max(center[2] - cop[2], 0.3)
    x = ((center[0] - cop[0]) * up - moment[1]) / arm
    y = ((center[1] - cop[1]) * up + moment[0]) / arm
    size, most = math.sqrt(x * x + y * y), gains.friction * up
    if size > most:
        x, y = x * most / size, y * most / size
    return x, y, up


@jit
def attitude_moment(rpy, turning, heading_error, reaction, gains):
    """Return the righting moment of the body, world axes, N m.

    Args:
        rpy: of the base, rad.
        turning: angular velocity, world's axes, rad/s.
        heading_error: rad.
        reaction: moment that the leg that swings takes, N m, (3,).
        gains: BipedGains.

    """
    about_x, about_y = -gains.roll_kp * rpy[0], -gains.pitch_kp * (rpy[1] - gains.lean)
    c, s = math.cos(rpy[2]), math.sin(rpy[2])
    about_z = (gains.yaw_kp * heading_error - gains.yaw_kd * turning[2]
               + gains.reaction_yaw * reaction[2])
    return (c * about_x - s * about_y - gains.roll_kd * turning[0] + gains.reaction * reaction[0],
            s * about_x + c * about_y - gains.pitch_kd * turning[1] + gains.reaction * reaction[1],
            min(max(about_z, -gains.twist), gains.twist))

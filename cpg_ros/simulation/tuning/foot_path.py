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

"""From a foot's path to a gait's readout: legs of a model, inverse kinematics, fit.

A few lengths and times describe a gait, the same for the left and right leg of a pair. Legs move
in the plane of their last two joints, and the first ones are held; or they extend sideways. The
joints' motion is fitted for a duty factor of one half, which a few harmonics can represent; the
readout's duty factor makes the stance longer.
"""

from dataclasses import dataclass, replace
import math

from cpg_ros.dynamics.orbit import Orbit
from cpg_ros.feedback.efference_copy import periodic
from cpg_ros.feedback.kinematics import foot_of, geometry_of, joints_of
from cpg_ros.motion.body_file import BodyGeometry, leg_axes, LEG_KINDS
from cpg_ros.motion.phase_readout import joint_readout, standing
from cpg_ros.motion.readout import Duty
from cpg_ros.motion.robot import Joint, JointMotion, Robot
from cpg_ros.simulation.body import Anatomy, Body
from cpg_ros.simulation.robot_model import SimulationError
from cpg_ros.simulation.robot_setup.model_reading import geometry_from, load_description
import numpy as np

#: CENTER_TOLERANCE: distance of the centre of mass from the middle of the feet, as a fraction of
#: half the distance from hind to fore feet, that is ignored.
CENTER_TOLERANCE = 0.1


def centre_ahead(body: Body, parts: Anatomy) -> float:
    """Return how far the centre of mass is ahead of the middle of the feet in the stand, m.

    It is 0 if it is below CENTER_TOLERANCE of half the distance from hind to fore feet.
    """
    body.reset()
    feet = parts.sole_positions(body.data)[:, 0]
    ahead = float(body.data.subtree_com[parts.base, 0] - feet.mean())
    return ahead if abs(ahead) > 0.5 * CENTER_TOLERANCE * np.ptp(feet) else 0.0


#: POINTS: points of a cycle at which curves are fitted.
POINTS = 128
#: Fraction of the cycle that a leg stands by the weights alone, without a duty factor.
DEFAULT_DUTY = 0.5
#: Weight of the curves' slopes in a fit, in units of half of the distance of two points.
SLOPE_WEIGHT = 6.4
#: DIGITS: decimals of weights and offsets, rad, in the file.
DIGITS = 4


@dataclass(frozen=True)
class FootTrajectory:
    """Path of a foot relative to its thigh joint; lengths in m.

    Attributes:
        stride: distance on the floor, 0 for steps in place.
        duty: fraction of the cycle on the floor, from phase 0.
        lift: largest height above the floor.
        height: of the joint above the foot on the floor.
        ahead: of the joint, middle of the path on the floor.
        push: largest additional stretch of the leg during stance.
        late: time of that stretch: 1 in the middle of the stance, more if later.
        lead: of the command on the foot, cycles.

    """

    stride: float
    duty: float
    lift: float
    height: float
    ahead: float
    push: float
    late: float = 1.0
    lead: float = 0.0

    def __call__(self, phase: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the foot's positions forward and upward of the joint, m, at phases in cycles."""
        phase = (phase + self.lead) % 1.0
        s = phase / self.duty
        r = (phase - self.duty) / (1.0 - self.duty)
        # On the floor at constant speed; in the air a cubic takes over place and speed.
        slope = -(1.0 - self.duty) / self.duty
        back = (-0.5 + slope * r + (3.0 - 3.0 * slope) * r**2 - (2.0 - 2.0 * slope) * r**3)
        floor = phase < self.duty
        x = self.ahead + self.stride * np.where(floor, 0.5 - s, back)
        z = np.where(floor, -self.push * np.sin(math.pi * np.clip(s, 0.0, 1.0)**self.late)**2,
                     self.lift * np.sin(math.pi * r)**2)
        return x, z - self.height


class Leg:
    """Joints of a leg that move its foot in a stride, from the robot's geometry.

    They are thigh and calf of a leg that moves in a vertical plane, or coxa, femur and tibia of
    one that extends sideways.

    Attributes:
        joints: from the base outwards.
        length: from the thigh joint to the foot in the stand, or height of the femur's axis above
            the foot, m.

    """

    def __init__(self, robot: Robot, body: BodyGeometry, leg: str) -> None:
        """Read a leg.

        Raises:
            SimulationError: the geometry does not have it.

        """
        if leg not in body.legs:
            raise SimulationError(f'leg {leg} cannot be tuned: it is not {LEG_KINDS}')
        own = body.legs[leg]
        names = own.joints if own.yaw is not None else own.joints[-2:]
        by_name = {joint.name: joint for joint in robot.legs[leg]}
        self.joints: tuple[Joint, ...] = tuple(by_name[name] for name in names)
        axes, origin = leg_axes(None, own.roll), (0.0, 0.0, 0.0)
        own = replace(own, joints=names, turns=own.turns[-len(names):], hip=origin, roll=None,
                      thigh=origin if own.yaw is None else own.thigh,
                      calf=tuple(own.calf @ axes), foot=tuple(own.foot @ axes))
        geometry = geometry_of(robot, BodyGeometry(body.mass, 0.0, {leg: own}))
        self._row = geometry.rows[list(robot.legs).index(leg)]
        x, y, z = foot_of(self._row, *[0.0] * (3 - len(names)),
                          *(joint.offset for joint in self.joints))
        self._origin = (0.0, 0.0, 0.0) if own.yaw is None else (x, y, own.thigh[2])
        self.length = math.hypot(x, z) if own.yaw is None else own.thigh[2] - z

    def angles(self, x: np.ndarray, z: np.ndarray) -> np.ndarray:
        """Return the joints' angles for foot positions, rad, shape (joints, n).

        A point out of reach is moved to the nearest one along its line to the thigh joint.

        Args:
            x: forward of the thigh joint, or of the foot in the stand if the leg extends sideways,
                m, shape (n,).
            z: above the axis of the thigh or femur, m, shape (n,).

        """
        forward, left, up = self._origin
        return np.array([joints_of(self._row, forward + dx, left, up + dz)
                         for dx, dz in zip(x, z, strict=True)]).T[-len(self.joints):]


def basis(orbit: Orbit, cell: int, harmonics: int, path: FootTrajectory) -> np.ndarray:
    """Evaluate x, y, x^2, x y, x^3, x^2 y of a cell over its leg's cycle, shape (6, POINTS).

    Args:
        orbit: the gait.
        cell: from 0.
        harmonics: number of harmonics of a relaxation oscillator's waveform that joints follow.
        path: with the leg's duty factor.

    """
    cells = np.array([cell])
    # Phase 0 of a leg is where x peaks.
    peak = standing(orbit, cells, harmonics)[0]
    duty = Duty(orbit, cells, peak - path.lead, np.array([DEFAULT_DUTY]), np.array([path.duty]))
    psi = joint_readout(orbit, np.full(6, cell), np.eye(6), cells, harmonics,
                        np.repeat(duty.of_cells(np.zeros(1, int), cells), 6, axis=0)).angles
    phase = peak + np.arange(POINTS) / POINTS
    return np.array([periodic(row, phase) for row in psi])


def fit(curves: np.ndarray, psi: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
    """Fit a common offset and the weights of several curves, by least squares.

    Their slopes are fitted, too, so that joints are not faster than a foot's path needs.

    Args:
        curves: of one joint, at full stride and in place, rad, shape (2, POINTS).
        psi: the monomials, shape (6, POINTS).

    Returns:
        Offset, weights of both curves, shape (2, 6), and residuals, rad, shape (2, POINTS).

    """
    ones, none = np.ones((psi.shape[1], 1)), np.zeros((psi.shape[1], 6))
    table = np.block([[ones, psi.T, none], [ones, none, psi.T]])
    both = [np.stack([columns,
                      SLOPE_WEIGHT * (np.roll(columns, -1, -2) - np.roll(columns, 1, -2))])
            for columns in (table.reshape(2, -1, 13), curves[:, :, None])]
    terms = np.linalg.lstsq(both[0].reshape(-1, 13), both[1].ravel(), rcond=None)[0]
    rest = (table @ terms - curves.ravel()).reshape(curves.shape)
    return float(terms[0]), terms[1:].reshape(2, 6), rest


class FootTrajectoryFit:
    """Motions of a robot's joints that move its feet along given trajectories."""

    def __init__(self, robot: Robot, model: str) -> None:
        """Read all legs, from the robot file or else from the model; errors as of Leg."""
        self.robot = robot
        geometry = robot.geometry or geometry_from(robot, load_description(model))
        self.legs = {leg: Leg(robot, geometry, leg) for leg in robot.legs}

    @property
    def length(self) -> float:
        """Mean length of the legs in the stand, m."""
        return float(np.mean([leg.length for leg in self.legs.values()]))

    def joints(self, orbit: Orbit, paths: dict[str, FootTrajectory]) -> dict[str, JointMotion]:
        """Return the motion of the joints that move the feet along paths, by leg."""
        phase = np.arange(POINTS) / POINTS
        joints = {}
        for name, leg in self.legs.items():
            path = paths[name]
            curves = np.array([leg.angles(*trajectory(phase))
                               for trajectory in (path, replace(path, stride=0.0))])
            psi = {cell: basis(orbit, cell - 1, self.robot.harmonics, path)
                   for cell in {joint.cell for joint in leg.joints}}
            for joint, curve in zip(leg.joints, curves.swapaxes(0, 1), strict=True):
                offset, weights, _ = fit(curve, psi[joint.cell])
                full, still = (tuple(float(w) for w in row) for row in weights.round(DIGITS))
                joints[joint.name] = JointMotion(round(offset, DIGITS), full, still)
        return joints

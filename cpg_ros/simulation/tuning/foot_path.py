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

"""From the way of a foot to a gait's readout: path, inverse kinematics, fit.

A gait is described by a few lengths and times, the same for the left and right leg of a pair.
Legs move in the plane of their last two joints, and the first ones hold still; or they reach to
the side (see sprawled_leg). What joints do in a cycle is fitted as if legs stood half of it, which
a few harmonics can do; that they stand longer is the duty factor's.
"""

from dataclasses import dataclass, replace
import math
from typing import Any

from cpg_ros.dynamics.orbit import Orbit
from cpg_ros.feedback.efference_copy import periodic
from cpg_ros.feedback.kinematics import bend_of
from cpg_ros.motion.body_file import body_geometry, BodyGeometry, LegChain
from cpg_ros.motion.description import outward, sprawls
from cpg_ros.motion.phase_readout import joint_readout, standing
from cpg_ros.motion.readout import Duty
from cpg_ros.motion.robot import Joint, JointMotion, Robot
from cpg_ros.simulation.body import Anatomy, Body
from cpg_ros.simulation.robot_model import engine, legs, SimulationError
import numpy as np

# The geometry of a robot's legs, read off its model, and the angles of two links.

#: Share up to which the centre of mass counts as above the middle of the feet.
CENTRED = 0.1


def at_zero(body: Body) -> Any:
    """Return a ``mujoco.MjData`` with all joints at 0, kinematics done."""
    data = engine().MjData(body.model)
    engine().mj_kinematics(body.model, data)
    return data


def chain_of(body: Body, leg: str) -> tuple[list[Joint], list[int]]:
    """Return a leg's joints from the base outwards, and their indices in the model."""
    chain = sorted(body.robot.legs[leg],
                   key=lambda joint: body.model.joint(joint.name).bodyid[0])
    return chain, [body.model.joint(joint.name).id for joint in chain]


def two_link_angles(upper: complex, lower: complex, bend: float, place: np.ndarray
                    ) -> tuple[np.ndarray, np.ndarray]:
    """Return by how much two links in a plane are turned, rad, to end at places of it.

    A place out of reach is taken to the nearest one along its line to the first joint.

    Args:
        upper: from the first joint to the second where neither is turned, m.
        lower: from there to the end, m.
        bend: 1 or -1, the side to which the second joint is bent.
        place: of the end, from the first joint, m, any shape.

    """
    a, b = abs(upper), abs(lower)
    cosine = np.clip((np.abs(place)**2 - a * a - b * b) / (2.0 * a * b), -1.0, 1.0)
    second = bend * np.arccos(cosine) - np.angle(lower / upper)
    return np.angle(place / (upper + lower * np.exp(1j * second))), second


def wrapped(angle: np.ndarray) -> np.ndarray:
    """Return angles from -pi to pi, rad."""
    return (angle + math.pi) % (2.0 * math.pi) - math.pi


def centre_ahead(body: Body, parts: Anatomy) -> float:
    """Return how far the centre of mass is ahead of the middle of the feet in the stand, m.

    It is 0 where that is less than CENTRED of half the distance from hind to fore feet.
    """
    body.reset()
    feet = parts.places(body.data)[:, 0]
    ahead = float(body.data.subtree_com[parts.base, 0] - feet.mean())
    return ahead if abs(ahead) > 0.5 * CENTRED * np.ptp(feet) else 0.0


def read_geometry(body: Body, parts: Anatomy) -> BodyGeometry:
    """Read the geometry of the legs that feedback can displace off a model."""
    data, chains = at_zero(body), {}
    base = data.xpos[parts.base]
    for foot, leg in zip(parts.feet, legs(body.robot), strict=True):
        chain, ids = chain_of(body, leg)
        chains[leg] = LegChain([joint.name for joint in chain], data.xaxis[ids],
                               data.xanchor[ids] - base, data.geom_xpos[foot] - base,
                               body.model.geom_size[foot, 0])
    return body_geometry(body.mass, chains)


def feet_at_zero(name: str, robot: Robot) -> dict[str, np.ndarray]:
    """Return where each leg's foot is from its last joint with all joints at 0, m, shape (3,).

    It is the middle of a ball, or else the furthest that what the last joint moves reaches.

    Args:
        name: of the model, as of ``find_model``.
        robot: whose legs' joints count, not its stand.

    Raises:
        SimulationError: MuJoCo is missing, the model cannot be used, or a leg has no shape.

    """
    body = Body(name, robot)
    model, data, found = body.model, at_zero(body), {}
    for leg in legs(robot):
        last = chain_of(body, leg)[1][-1]
        points = [data.geom_xpos[geom] + _ends(model, geom) @ data.geom_xmat[geom].reshape(3, 3).T
                  for geom in range(model.ngeom) if model.geom_contype[geom]
                  and model.body_weldid[model.geom_bodyid[geom]] == model.jnt_bodyid[last]]
        if not points:
            raise SimulationError(f'model: leg {leg} has no shape that could touch the floor')
        balls = [point for point in points if len(point) == 1]
        reach = np.concatenate(balls or points) - data.xanchor[last]
        found[leg] = reach[np.linalg.norm(reach, axis=1).argmax()]
    return found


def _ends(model: Any, geom: int) -> np.ndarray:
    """Return a ball's middle, a mesh's vertices, or both ends of another shape, in its frame."""
    mujoco, kind = engine(), model.geom_type[geom]
    if kind == mujoco.mjtGeom.mjGEOM_SPHERE:
        return np.zeros((1, 3))
    if kind == mujoco.mjtGeom.mjGEOM_MESH:
        mesh = model.geom_dataid[geom]
        return model.mesh_vert[model.mesh_vertadr[mesh]:][:model.mesh_vertnum[mesh]]
    middle, half = np.split(model.geom_aabb[geom], 2)
    longest = np.where(half == half.max(), half, 0.0)
    return np.array([middle - longest, middle + longest])


# A leg that reaches to the side (see robots.sprawled_stand): its angles, read off a model.

#: How far a joint or the foot may be beside the leg's plane, as a share of the leg's length.
BESIDE = 0.1


class SprawledLeg:
    """Three links: an upright axis, then two links in a plane that goes through it.

    Attributes:
        joints: that move them, coxa, femur and tibia.
        length: height of the femur's axis above the foot in the stand, m.

    """

    def __init__(self, body: Body, parts: Anatomy, leg: str) -> None:
        """Look at a leg with all joints at 0.

        Raises:
            SimulationError: its foot is far beside the plane that the coxa turns.

        """
        data, (chain, ids) = at_zero(body), chain_of(body, leg)
        self.joints: tuple[Joint, ...] = tuple(chain[-3:])
        ids = ids[-3:]
        foot = parts.places(data)[legs(body.robot).index(leg)]
        corners = np.stack([*data.xanchor[ids], foot]) - data.xanchor[ids[0]]
        out = outward(data.xaxis[ids[1]], corners[3])
        beside = np.abs(corners[:, :2] @ np.array([-out[1], out[0]])).max()
        if beside > BESIDE * np.linalg.norm(np.diff(corners, axis=0), axis=1).sum():
            raise SimulationError(f'leg {leg}: its foot is {100.0 * beside:.1f} cm beside the '
                                  f'plane in which {self.joints[1].name} and '
                                  f'{self.joints[2].name} move it')
        # As complex numbers out + i up; turns of femur and tibia by what they do to out.
        points = corners[:, :2] @ out + 1j * corners[:, 2]
        self._coxa, self._upper, self._lower = np.diff(points)
        across = np.array([out[0], out[1], 0.0])
        self._turns = np.array([data.xaxis[ids[0], 2],
                                *(np.cross(data.xaxis[one], across)[2] for one in ids[1:])])
        self._heading = math.atan2(out[1], out[0])
        stand = np.array([joint.offset for joint in self.joints])
        self._bend = bend_of(self._upper, self._lower, self._turns[2] * stand[2])
        self._x, self._y, height = (float(one[0]) for one in self._foot(*stand[:, None]))
        self.length = -height

    def _foot(self, coxa: np.ndarray, femur: np.ndarray, tibia: np.ndarray
              ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the foot's places forward, to the left and upward of the femur's height, m."""
        plane = np.exp(1j * self._turns[1] * femur) * (
            self._upper + self._lower * np.exp(1j * self._turns[2] * tibia))
        reach = self._coxa.real + plane.real
        way = self._heading + self._turns[0] * coxa
        return reach * np.cos(way), reach * np.sin(way), plane.imag

    def angles(self, x: np.ndarray, z: np.ndarray) -> tuple[np.ndarray, ...]:
        """Return the joints' angles, rad, that put the foot there, the tibia bent as it is.

        Args:
            x: forward of where the foot is in the stand, m.
            z: upward of the femur's axis, m.

        A place out of reach is taken to the nearest one along its line to the femur's axis.
        """
        x = self._x + x
        way = np.arctan2(self._y, x)
        place = np.hypot(x, self._y) - self._coxa.real + 1j * z
        femur, tibia = two_link_angles(self._upper, self._lower, self._bend, place)
        return tuple(wrapped(turn * angle) for turn, angle in zip(
            self._turns, (way - self._heading, femur, tibia), strict=True))


#: Points of a cycle at which curves are fitted.
POINTS = 128
#: Share of the cycle that weights make a leg stand by themselves.
OWN = 0.5
#: Digits of weights and offsets, rad, in the file.
DIGITS = 4


@dataclass(frozen=True)
class FootTrajectory:
    """The way of a foot relative to its thigh joint; lengths in m.

    Attributes:
        stride: way on the floor, 0 for steps in place.
        duty: share of the cycle on the floor, from phase 0 on.
        lift: largest height above the floor.
        height: of the joint above the foot on the floor.
        ahead: of the joint, middle of the way on the floor.
        push: by how much more the leg is stretched at most while it is on the floor.
        late: 1 if that is in the middle of this time, more if later.
        lead: by how much the command leads the foot, cycles.

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
        """Return the foot's places forward and upward of the joint, m, at phases in cycles."""
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


class FootTrajectoryFit:
    """Two links in a vertical plane, read off a model.

    Attributes:
        thigh, calf: the joints that move them.
        length: from thigh joint to foot in the stand, m.

    """

    def __init__(self, body: Body, parts: Anatomy, leg: str) -> None:
        """Look at a leg with all joints at 0.

        Raises:
            SimulationError: its last two joints do not turn about parallel axes across the body.

        """
        data, (chain, ids) = at_zero(body), chain_of(body, leg)
        if len(chain) < 2:
            raise SimulationError(f'leg {leg} has fewer than two joints')
        self.thigh, self.calf = chain[-2:]
        ids = ids[-2:]
        self._turns = data.xaxis[ids, 1]
        if np.abs(self._turns).min() < 0.99:
            raise SimulationError(f'leg {leg}: {self.thigh.name} and {self.calf.name} do not both '
                                  'turn about an axis across the body')
        foot = parts.places(data)[legs(body.robot).index(leg)]
        corners = np.stack([*data.xanchor[ids], foot])[:, [0, 2]]
        upper, lower = np.diff(corners, axis=0)
        # As complex numbers z + i x a positive turn about y multiplies by exp(i angle).
        self._upper, self._lower = complex(upper[1], upper[0]), complex(lower[1], lower[0])
        self._bend = bend_of(self._upper, self._lower, self._turns[1] * self.calf.offset)
        self.joints: tuple[Joint, ...] = (self.thigh, self.calf)
        self.length = float(np.hypot(*self.foot(np.array(self.thigh.offset),
                                                np.array(self.calf.offset))))

    def foot(self, thigh: np.ndarray, calf: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the foot's places forward and upward of the thigh joint, m."""
        turn = np.exp(1j * self._turns[0] * thigh)
        place = turn * (self._upper + self._lower * np.exp(1j * self._turns[1] * calf))
        return place.imag, place.real

    def angles(self, x: np.ndarray, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return thigh and calf angles, rad, that put the foot there, the knee bent as it is.

        A place out of reach is taken to the nearest one along its line to the joint.
        """
        thigh, calf = two_link_angles(self._upper, self._lower, self._bend, z + 1j * x)
        return self._turns[0] * thigh, wrapped(self._turns[1] * calf)


def basis(orbit: Orbit, cell: int, harmonics: int, path: FootTrajectory) -> np.ndarray:
    """Evaluate x, y, x^2, x y, x^3, x^2 y of a cell over its leg's cycle, shape (6, POINTS).

    Args:
        orbit: the gait.
        cell: from 0.
        harmonics: of a cell with two variables that joints follow.
        path: whose duty the leg is to have.

    """
    cells = np.array([cell])
    # Phase 0 of a leg is where x peaks.
    peak = standing(orbit, cells, harmonics)[0]
    duty = Duty(orbit, cells, peak - path.lead, np.array([OWN]), np.array([path.duty]))
    psi = joint_readout(orbit, np.full(6, cell), np.eye(6), cells, harmonics,
                        np.repeat(duty.of_cells(np.zeros(1, int), cells), 6, axis=0)).angles
    phase = peak + np.arange(POINTS) / POINTS
    return np.array([periodic(row, phase) for row in psi])


def fit(curves: np.ndarray, psi: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
    """Fit a common offset and the weights of several curves, by least squares.

    Args:
        curves: of one joint, at full stride and in place, rad, shape (2, POINTS).
        psi: the monomials, shape (6, POINTS).

    Returns:
        The offset, the weights of both curves, shape (2, 6), and what is left, rad, shape
        (2, POINTS).

    """
    one, none = np.ones((psi.shape[1], 1)), np.zeros((psi.shape[1], 6))
    table = np.block([[one, psi.T, none], [one, none, psi.T]])
    found = np.linalg.lstsq(table, curves.ravel(), rcond=None)[0]
    rest = (table @ found - curves.ravel()).reshape(curves.shape)
    return float(found[0]), found[1:].reshape(2, 6), rest


class Feet:
    """The feet of a robot: the joint motions for given paths."""

    def __init__(self, body: Body, parts: Anatomy) -> None:
        """Look at all legs; errors as of Leg."""
        self.robot = body.robot
        self.legs: dict[str, FootTrajectoryFit | SprawledLeg] = {
            leg: (SprawledLeg if sprawls(at_zero(body).xaxis[chain_of(body, leg)[1]])
                  else FootTrajectoryFit)(body, parts, leg) for leg in legs(body.robot)}

    @property
    def length(self) -> float:
        """Of the legs in the stand, their mean, m."""
        return float(np.mean([leg.length for leg in self.legs.values()]))

    def joints(self, orbit: Orbit, paths: dict[str, FootTrajectory]) -> dict[str, JointMotion]:
        """Return the motion of the joints that move the feet in a gait.

        Args:
            orbit: of the gait.
            paths: leg -> the way of its foot.

        """
        phase = np.arange(POINTS) / POINTS
        found = {}
        for name, leg in self.legs.items():
            path = paths[name]
            curves = np.array([leg.angles(*one(phase))
                               for one in (path, replace(path, stride=0.0))])
            psi = {cell: basis(orbit, cell - 1, self.robot.harmonics, path)
                   for cell in {joint.cell for joint in leg.joints}}
            for joint, curve in zip(leg.joints, curves.swapaxes(0, 1), strict=True):
                offset, weights, _ = fit(curve, psi[joint.cell])
                full, still = (tuple(float(w) for w in row) for row in weights.round(DIGITS))
                found[joint.name] = JointMotion(round(offset, DIGITS), full, still)
        return found

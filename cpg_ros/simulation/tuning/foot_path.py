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

A gait is described by a few lengths and times, the same for the left and right leg of a pair.
Legs move in the plane of their last two joints, and the first ones hold still; or they reach to
the side. What joints do in a cycle is fitted as if legs stood half of it, which
a few harmonics can do; that they stand longer is the duty factor's.
"""

from dataclasses import dataclass, replace
import math
from typing import Any

from cpg_ros.dynamics.orbit import Orbit
from cpg_ros.feedback.efference_copy import periodic
from cpg_ros.feedback.kinematics import foot_of, geometry_of, joints_of
from cpg_ros.motion.body_file import body_geometry, BodyGeometry, LegChain, LegGeometry
from cpg_ros.motion.description import outward, sprawls
from cpg_ros.motion.phase_readout import joint_readout, standing
from cpg_ros.motion.readout import Duty
from cpg_ros.motion.robot import Joint, JointMotion, Robot
from cpg_ros.simulation.body import Anatomy, Body
from cpg_ros.simulation.robot_model import engine, legs, SimulationError
import numpy as np

# The geometry of a robot's legs, read off its model.

#: CENTRED: distance of the centre of mass from the middle of the feet, as a share of half the
#: distance from hind to fore feet, that is ignored.
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


#: POINTS: points of a cycle at which curves are fitted.
POINTS = 128
#: OWN: share of the cycle that a leg stands by the weights alone, without a duty factor.
OWN = 0.5
#: DIGITS: decimals of weights and offsets, rad, in the file.
DIGITS = 4


@dataclass(frozen=True)
class FootTrajectory:
    """The way of a foot relative to its thigh joint; lengths in m.

    Attributes:
        stride: way on the floor, 0 for steps in place.
        duty: fraction of the cycle on the floor, from phase 0 on.
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


#: BESIDE: largest distance of a joint or the foot from a sprawled leg's plane, over its length.
BESIDE = 0.1


class Leg:
    """The joints of a leg that move its foot in a stride, read off a model.

    They are the last two of a leg that moves in a vertical plane, or coxa, femur and tibia of one
    that reaches to the side (see description.sprawls).

    Attributes:
        joints: from the base outwards.
        length: from the thigh joint to the foot in the stand, or the height of the femur's axis
            above the foot, m.

    """

    def __init__(self, body: Body, parts: Anatomy, leg: str) -> None:
        """Read a leg with all joints at 0.

        Raises:
            SimulationError: its last two joints do not turn about parallel axes across the body,
                or its foot is far beside the plane that the coxa turns.

        """
        data, (chain, ids) = at_zero(body), chain_of(body, leg)
        if len(chain) < 2:
            raise SimulationError(f'leg {leg} has fewer than two joints')
        sprawled, yaw = sprawls(data.xaxis[ids]), None
        count = 3 if sprawled else 2
        self.joints: tuple[Joint, ...] = tuple(chain[-count:])
        axes, anchors = data.xaxis[ids[-count:]], data.xanchor[ids[-count:]]
        foot = parts.places(data)[legs(body.robot).index(leg)]
        across, names = np.array([0.0, 1.0, 0.0]), [joint.name for joint in self.joints]
        if sprawled:
            out = outward(axes[1], foot - anchors[0])
            yaw, across = math.atan2(out[1], out[0]), np.array([-out[1], out[0], 0.0])
            corners = np.stack([*anchors, foot]) - anchors[0]
            beside = np.abs(corners @ across).max()
            if beside > BESIDE * np.linalg.norm(np.diff(corners, axis=0), axis=1).sum():
                raise SimulationError(f'leg {leg}: its foot is {100.0 * beside:.1f} cm beside the '
                                      f'plane in which {names[1]} and {names[2]} move it')
        turns = np.array([*axes[:-2, 2], *axes[-2:] @ across])
        if np.abs(turns).min() < 0.99:
            raise SimulationError(f'leg {leg}: {names[0]} and {names[1]} do not both turn about '
                                  'an axis across the body')
        # From the first of these joints.
        thigh = anchors[-2] - anchors[0]
        shape = LegGeometry(tuple(names), tuple(np.sign(turns)), (0.0, 0.0, 0.0), tuple(thigh),
                            tuple(anchors[-1] - anchors[-2]), tuple(foot - anchors[-1]), yaw)
        geometry = geometry_of(body.robot, BodyGeometry(body.mass, 0.0, {leg: shape}))
        self._row = geometry.rows[list(body.robot.legs).index(leg)]
        angles = [0.0] * (3 - count) + [joint.offset for joint in self.joints]
        x, y, z = foot_of(self._row, *angles)
        self._origin = (x, y, thigh[2]) if sprawled else (0.0, 0.0, 0.0)
        self.length = thigh[2] - z if sprawled else math.hypot(x, z)

    def angles(self, x: np.ndarray, z: np.ndarray) -> np.ndarray:
        """Return the joints' angles that put the foot there, rad, shape (joints, n).

        A point out of reach is moved to the nearest one along its line to the thigh joint.

        Args:
            x: forward of the thigh joint, or of the foot in the stand if the leg reaches to the
                side, m, shape (n,).
            z: upward of the axis of the thigh or femur, m, shape (n,).

        """
        forward, left, up = self._origin
        return np.array([joints_of(self._row, forward + dx, left, up + dz)
                         for dx, dz in zip(x, z, strict=True)]).T[-len(self.joints):]


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


class FootTrajectoryFit:
    """The motions of a robot's joints that move its feet along given trajectories."""

    def __init__(self, body: Body, parts: Anatomy) -> None:
        """Read all legs; errors as of Leg."""
        self.robot = body.robot
        self.legs = {leg: Leg(body, parts, leg) for leg in legs(body.robot)}

    @property
    def length(self) -> float:
        """Mean length of the legs in the stand, m."""
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

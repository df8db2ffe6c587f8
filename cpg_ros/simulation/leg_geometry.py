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

"""The geometry of a robot's legs, read off its model, and the angles of two links."""

import math
from typing import Any

from cpg_ros.robots.body_keys import body_geometry, BodyGeometry, LegChain
from cpg_ros.robots.robot import Joint, Robot
from cpg_ros.simulation.body import Body
from cpg_ros.simulation.model_indices import Anatomy
from cpg_ros.simulation.robot_model import engine, legs, SimulationError
import numpy as np

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

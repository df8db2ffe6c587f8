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

"""Where a robot's parts are in its model: indices of base, joints and feet."""

from typing import Any

from cpg_ros.simulation.body import Body
from cpg_ros.simulation.robot_model import engine, legs, SimulationError
import numpy as np


class Anatomy:
    """Indices into the arrays of a body's model.

    Attributes:
        base: body of the free joint.
        pose: the base's position and quaternion in qpos.
        angles: joints in qpos, in the order of controllers, shape (joints,).
        speeds: joints in qvel.
        feet: the geom of each leg that is lowest in the stand, legs as of ``robot_model.legs``.
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
        for leg in legs(body.robot):
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
            turn = data.xmat[body_id].reshape(3, 3)
            soles.append((ends[3:] - data.xpos[body_id]) @ turn)
        self.bodies, self.soles = model.geom_bodyid[self.feet], np.array(soles)

    def places(self, data: Any) -> np.ndarray:
        """Where the soles are in a ``mujoco.MjData``, m, shape (legs, 3)."""
        turn = data.xmat[self.bodies].reshape(-1, 3, 3)
        return data.xpos[self.bodies] + (turn @ self.soles[:, :, None])[:, :, 0]


def _ancestors(model: object, body: int) -> list[int]:
    found = [body]
    while found[-1]:
        found.append(model.body_parentid[found[-1]])  # type: ignore[attr-defined]
    return found

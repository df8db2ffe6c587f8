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

"""The geometry of a robot's legs, read off its model."""

from cpg_ros.robots.body_keys import BodyGeometry, leg_of
from cpg_ros.simulation.body import Body
from cpg_ros.simulation.model_indices import Anatomy
from cpg_ros.simulation.robot_model import engine, legs


def read_geometry(body: Body, parts: Anatomy) -> BodyGeometry:
    """Look at all legs with all joints at 0.

    Legs are left out that are not a hip about x, if any, then two joints about y.
    """
    mujoco, model, robot = engine(), body.model, body.robot
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    base, shapes = data.xpos[parts.base], {}
    for foot, leg in zip(parts.feet, legs(robot), strict=True):
        chain = sorted((joint.name for joint in robot.legs[leg]),
                       key=lambda name: model.joint(name).bodyid[0])
        ids = [model.joint(name).id for name in chain]
        found = leg_of(chain, data.xaxis[ids], data.xanchor[ids] - base,
                       data.geom_xpos[foot] - base)
        if found is not None:
            shapes[leg] = found
    return BodyGeometry(round(float(model.body_mass.sum()), 6),
                        float(model.geom_size[parts.feet[0], 0]), shapes)

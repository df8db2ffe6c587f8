"""A leg that reaches to the side, as those of insects: coxa, femur and tibia, read off a model.

The coxa turns the leg about a vertical axis, femur and tibia move the foot in the leg's plane.
The foot goes along the body at the distance from it that it has in the stand.
"""

import math

import numpy as np

from cpg_ros.robots.robot import Joint
from cpg_ros.simulation.body import Body
from cpg_ros.simulation.model_indices import Anatomy
from cpg_ros.simulation.robot_model import SimulationError, engine, legs


def sprawls(body: Body, leg: str) -> bool:
    """Tell whether a leg's last three joints turn about an upright and two level axes."""
    mujoco, model = engine(), body.model
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    chain = sorted(body.robot.legs[leg], key=lambda joint: model.joint(joint.name).bodyid[0])
    if len(chain) < 3:
        return False
    axes = data.xaxis[[model.joint(joint.name).id for joint in chain[-3:]]]
    return bool(abs(axes[0, 2]) > 0.99 and np.abs(axes[1:, 2]).max() < 0.01
                and abs(axes[1] @ axes[2]) > 0.99)


class SprawledLeg:
    """Three links: an upright axis, then two links in a plane that goes through it.

    Attributes:
        joints: that move them, coxa, femur and tibia.
        length: height of the femur's axis above the foot in the stand, m.

    """

    def __init__(self, body: Body, parts: Anatomy, leg: str) -> None:
        """Look at a leg with all joints at 0.

        Raises:
            SimulationError: its foot is not in the plane that the coxa turns.

        """
        mujoco, model = engine(), body.model
        data = mujoco.MjData(model)
        mujoco.mj_kinematics(model, data)
        chain = sorted(body.robot.legs[leg], key=lambda joint: model.joint(joint.name).bodyid[0])
        self.joints: tuple[Joint, ...] = tuple(chain[-3:])
        ids = [model.joint(joint.name).id for joint in self.joints]
        foot = parts.places(data)[legs(body.robot).index(leg)]
        corners = np.stack([*data.xanchor[ids], foot]) - data.xanchor[ids[0]]
        # The plane's level direction, away from the body.
        axis = data.xaxis[ids[1]]
        out = np.array([-axis[1], axis[0]]) / math.hypot(axis[0], axis[1])
        out = out if corners[3, :2] @ out >= 0.0 else -out
        if np.abs(corners[:, :2] @ np.array([-out[1], out[0]])).max() > 1e-3:
            raise SimulationError(f'leg {leg}: its foot is not in the plane in which '
                                  f'{self.joints[1].name} and {self.joints[2].name} move it')
        # As complex numbers out + i up; turns of femur and tibia by what they do to out.
        points = corners[:, :2] @ out + 1j * corners[:, 2]
        self._coxa, self._upper, self._lower = np.diff(points)
        across = np.array([out[0], out[1], 0.0])
        self._turns = np.array([data.xaxis[ids[0], 2],
                                *(np.cross(data.xaxis[one], across)[2] for one in ids[1:])])
        self._heading = math.atan2(out[1], out[0])
        stand = np.array([joint.offset for joint in self.joints])
        bend = self._turns[2] * stand[2] + np.angle(self._lower / self._upper)
        self._bend = math.copysign(1.0, math.remainder(bend, 2.0 * math.pi))
        self._x, self._y, height = (float(one[0]) for one in self._foot(*stand[:, None]))
        self.length = -height

    def _foot(self, coxa: np.ndarray, femur: np.ndarray, tibia: np.ndarray
              ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the foot's places forward, to the left and upward of the femur's height, m."""
        plane = np.exp(1j * self._turns[1] * femur) * (
            self._upper + self._lower * np.exp(1j * self._turns[2] * tibia))
        reach = self._coxa.real + plane.real
        way = self._heading + self._turns[0] * coxa
        return reach * np.cos(way), reach * np.sin(way), plane.imag

    def angles(self, x: np.ndarray, z: np.ndarray) -> tuple[np.ndarray, ...]:
        """Return the joints' angles, rad, that put the foot there, the tibia bent as it is.

        Args:
            x: forward of where the foot is in the stand, m.
            z: upward of the femur's axis, m.

        A place out of reach is taken to the nearest one along its line to the femur's axis.
        """
        x = self._x + x
        way = np.arctan2(self._y, x)
        place = np.hypot(x, self._y) - self._coxa.real + 1j * z
        a, b = abs(self._upper), abs(self._lower)
        cosine = np.clip((np.abs(place)**2 - a * a - b * b) / (2.0 * a * b), -1.0, 1.0)
        tibia = self._bend * np.arccos(cosine) - np.angle(self._lower / self._upper)
        femur = np.angle(place / (self._upper + self._lower * np.exp(1j * tibia)))
        return tuple((turn * angle + math.pi) % (2.0 * math.pi) - math.pi for turn, angle in zip(
            self._turns, (way - self._heading, femur, tibia), strict=True))

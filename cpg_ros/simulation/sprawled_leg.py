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

"""A leg that reaches to the side (see robots.sprawled_stand): its angles, read off a model.

Femur and tibia move the foot in the leg's plane, which the coxa turns. The foot goes along the
body at the distance from it that it has in the stand.
"""

import math

from cpg_ros.feedback.kinematics import bend_of
from cpg_ros.robots.robot import Joint
from cpg_ros.robots.sprawled_stand import outward
from cpg_ros.simulation.body import Body
from cpg_ros.simulation.leg_geometry import at_zero, chain_of, two_link_angles, wrapped
from cpg_ros.simulation.model_indices import Anatomy
from cpg_ros.simulation.robot_model import legs, SimulationError
import numpy as np

#: How far a joint or the foot may be beside the leg's plane, as a share of the leg's length.
BESIDE = 0.1


class SprawledLeg:
    """Three links: an upright axis, then two links in a plane that goes through it.

    Attributes:
        joints: that move them, coxa, femur and tibia.
        length: height of the femur's axis above the foot in the stand, m.

    """

    def __init__(self, body: Body, parts: Anatomy, leg: str) -> None:
        """Look at a leg with all joints at 0.

        Raises:
            SimulationError: its foot is far beside the plane that the coxa turns.

        """
        data, (chain, ids) = at_zero(body), chain_of(body, leg)
        self.joints: tuple[Joint, ...] = tuple(chain[-3:])
        ids = ids[-3:]
        foot = parts.places(data)[legs(body.robot).index(leg)]
        corners = np.stack([*data.xanchor[ids], foot]) - data.xanchor[ids[0]]
        out = outward(data.xaxis[ids[1]], corners[3])
        beside = np.abs(corners[:, :2] @ np.array([-out[1], out[0]])).max()
        if beside > BESIDE * np.linalg.norm(np.diff(corners, axis=0), axis=1).sum():
            raise SimulationError(f'leg {leg}: its foot is {100.0 * beside:.1f} cm beside the '
                                  f'plane in which {self.joints[1].name} and '
                                  f'{self.joints[2].name} move it')
        # As complex numbers out + i up; turns of femur and tibia by what they do to out.
        points = corners[:, :2] @ out + 1j * corners[:, 2]
        self._coxa, self._upper, self._lower = np.diff(points)
        across = np.array([out[0], out[1], 0.0])
        self._turns = np.array([data.xaxis[ids[0], 2],
                                *(np.cross(data.xaxis[one], across)[2] for one in ids[1:])])
        self._heading = math.atan2(out[1], out[0])
        stand = np.array([joint.offset for joint in self.joints])
        self._bend = bend_of(self._upper, self._lower, self._turns[2] * stand[2])
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
        femur, tibia = two_link_angles(self._upper, self._lower, self._bend, place)
        return tuple(wrapped(turn * angle) for turn, angle in zip(
            self._turns, (way - self._heading, femur, tibia), strict=True))

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

"""From the way of a foot to a gait's readout: path, inverse kinematics, fit.

A gait is described by a few lengths and times, the same for the left and right leg of a pair.
Legs move in the plane of their last two joints, and the first ones hold still; or they reach to
the side (see sprawled_leg). What joints do in a cycle is fitted as if legs stood half of it, which
a few harmonics can do; that they stand longer is the duty factor's.
"""

from dataclasses import dataclass, replace
import math

from cpg_ros.dynamics.periodic import Orbit
from cpg_ros.feedback.interpolation import periodic
from cpg_ros.feedback.kinematics import bend_of
from cpg_ros.motion.duty import Duty
from cpg_ros.motion.joint_readout import joint_readout, standing
from cpg_ros.robots.robot import Joint, JointMotion
from cpg_ros.robots.sprawled_stand import sprawls
from cpg_ros.simulation.body import Body
from cpg_ros.simulation.leg_geometry import at_zero, chain_of, two_link_angles, wrapped
from cpg_ros.simulation.model_indices import Anatomy
from cpg_ros.simulation.robot_model import legs, SimulationError
from cpg_ros.simulation.sprawled_leg import SprawledLeg
import numpy as np

#: Points of a cycle at which curves are fitted.
POINTS = 128
#: Share of the cycle that weights make a leg stand by themselves.
OWN = 0.5
#: Digits of weights and offsets, rad, in the file.
DIGITS = 4


@dataclass(frozen=True)
class Path:
    """The way of a foot relative to its thigh joint; lengths in m.

    Attributes:
        stride: way on the floor, 0 for steps in place.
        duty: share of the cycle on the floor, from phase 0 on.
        lift: largest height above the floor.
        height: of the joint above the foot on the floor.
        ahead: of the joint, middle of the way on the floor.
        push: by how much more the leg is stretched at most while it is on the floor.
        late: 1 if that is in the middle of this time, more if later.
        lead: by how much the command leads the foot, cycles.

    """

    stride: float
    duty: float
    lift: float
    height: float
    ahead: float
    push: float
    late: float = 1.0
    lead: float = 0.0

    def __call__(self, phase: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the foot's places forward and upward of the joint, m, at phases in cycles."""
        phase = (phase + self.lead) % 1.0
        s = phase / self.duty
        r = (phase - self.duty) / (1.0 - self.duty)
        # On the floor at constant speed; in the air a cubic takes over place and speed.
        slope = -(1.0 - self.duty) / self.duty
        back = (-0.5 + slope * r + (3.0 - 3.0 * slope) * r**2 - (2.0 - 2.0 * slope) * r**3)
        floor = phase < self.duty
        x = self.ahead + self.stride * np.where(floor, 0.5 - s, back)
        z = np.where(floor, -self.push * np.sin(math.pi * np.clip(s, 0.0, 1.0)**self.late)**2,
                     self.lift * np.sin(math.pi * r)**2)
        return x, z - self.height


class LegPath:
    """Two links in a vertical plane, read off a model.

    Attributes:
        thigh, calf: the joints that move them.
        length: from thigh joint to foot in the stand, m.

    """

    def __init__(self, body: Body, parts: Anatomy, leg: str) -> None:
        """Look at a leg with all joints at 0.

        Raises:
            SimulationError: its last two joints do not turn about parallel axes across the body.

        """
        data, (chain, ids) = at_zero(body), chain_of(body, leg)
        if len(chain) < 2:
            raise SimulationError(f'leg {leg} has fewer than two joints')
        self.thigh, self.calf = chain[-2:]
        ids = ids[-2:]
        self._turns = data.xaxis[ids, 1]
        if np.abs(self._turns).min() < 0.99:
            raise SimulationError(f'leg {leg}: {self.thigh.name} and {self.calf.name} do not both '
                                  'turn about an axis across the body')
        foot = parts.places(data)[legs(body.robot).index(leg)]
        corners = np.stack([*data.xanchor[ids], foot])[:, [0, 2]]
        upper, lower = np.diff(corners, axis=0)
        # As complex numbers z + i x a positive turn about y multiplies by exp(i angle).
        self._upper, self._lower = complex(upper[1], upper[0]), complex(lower[1], lower[0])
        self._bend = bend_of(self._upper, self._lower, self._turns[1] * self.calf.offset)
        self.joints: tuple[Joint, ...] = (self.thigh, self.calf)
        self.length = float(np.hypot(*self.foot(np.array(self.thigh.offset),
                                                np.array(self.calf.offset))))

    def foot(self, thigh: np.ndarray, calf: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the foot's places forward and upward of the thigh joint, m."""
        turn = np.exp(1j * self._turns[0] * thigh)
        place = turn * (self._upper + self._lower * np.exp(1j * self._turns[1] * calf))
        return place.imag, place.real

    def angles(self, x: np.ndarray, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return thigh and calf angles, rad, that put the foot there, the knee bent as it is.

        A place out of reach is taken to the nearest one along its line to the joint.
        """
        thigh, calf = two_link_angles(self._upper, self._lower, self._bend, z + 1j * x)
        return self._turns[0] * thigh, wrapped(self._turns[1] * calf)


def basis(orbit: Orbit, cell: int, harmonics: int, path: Path) -> np.ndarray:
    """Evaluate x, y, x^2, x y, x^3, x^2 y of a cell over its leg's cycle, shape (6, POINTS).

    Args:
        orbit: the gait.
        cell: from 0.
        harmonics: of a cell with two variables that joints follow.
        path: whose duty the leg is to have.

    """
    cells = np.array([cell])
    # Phase 0 of a leg is where x peaks.
    peak = standing(orbit, cells, harmonics)[0]
    duty = Duty(orbit, cells, peak - path.lead, np.array([OWN]), np.array([path.duty]))
    psi = joint_readout(orbit, np.full(6, cell), np.eye(6), cells, harmonics,
                        np.repeat(duty.of_cells(np.zeros(1, int), cells), 6, axis=0)).angles
    phase = peak + np.arange(POINTS) / POINTS
    return np.array([periodic(row, phase) for row in psi])


def fit(curves: np.ndarray, psi: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
    """Fit a common offset and the weights of several curves, by least squares.

    Args:
        curves: of one joint, at full stride and in place, rad, shape (2, POINTS).
        psi: the monomials, shape (6, POINTS).

    Returns:
        The offset, the weights of both curves, shape (2, 6), and what is left, rad, shape
        (2, POINTS).

    """
    one, none = np.ones((psi.shape[1], 1)), np.zeros((psi.shape[1], 6))
    table = np.block([[one, psi.T, none], [one, none, psi.T]])
    found = np.linalg.lstsq(table, curves.ravel(), rcond=None)[0]
    rest = (table @ found - curves.ravel()).reshape(curves.shape)
    return float(found[0]), found[1:].reshape(2, 6), rest


class Feet:
    """The feet of a robot: the joint motions for given paths."""

    def __init__(self, body: Body, parts: Anatomy) -> None:
        """Look at all legs; errors as of Leg."""
        self.robot = body.robot
        self.legs: dict[str, LegPath | SprawledLeg] = {
            leg: (SprawledLeg if sprawls(at_zero(body).xaxis[chain_of(body, leg)[1]])
                  else LegPath)(body, parts, leg) for leg in legs(body.robot)}

    @property
    def length(self) -> float:
        """Of the legs in the stand, their mean, m."""
        return float(np.mean([leg.length for leg in self.legs.values()]))

    def joints(self, orbit: Orbit, paths: dict[str, Path]) -> dict[str, JointMotion]:
        """Return the motion of the joints that move the feet in a gait.

        Args:
            orbit: of the gait.
            paths: leg -> the way of its foot.

        """
        phase = np.arange(POINTS) / POINTS
        found = {}
        for name, leg in self.legs.items():
            path = paths[name]
            curves = np.array([leg.angles(*one(phase))
                               for one in (path, replace(path, stride=0.0))])
            psi = {cell: basis(orbit, cell - 1, self.robot.harmonics, path)
                   for cell in {joint.cell for joint in leg.joints}}
            for joint, curve in zip(leg.joints, curves.swapaxes(0, 1), strict=True):
                offset, weights, _ = fit(curve, psi[joint.cell])
                full, still = (tuple(float(w) for w in row) for row in weights.round(DIGITS))
                found[joint.name] = JointMotion(round(offset, DIGITS), full, still)
        return found

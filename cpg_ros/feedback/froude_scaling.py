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

"""Gains of a robot of another size than the Go2 for which the usual ones were found.

Legged bodies of one shape move alike at one Froude number v^2/(g l) (Alexander and Jayes 1983):
as gravity is the same, lengths go with the length l of the legs, and times with sqrt(l/g). Forces
are shares of the weight in all laws of a quadruped, so mass does not matter there; a biped's gains
go with it. What a gain is a multiple of follows from its unit.
"""

from functools import cache
import math

from cpg_ros.errors import InputError
from cpg_ros.feedback.gains import GAINS, Gains, LAWS
from cpg_ros.feedback.kinematics import Geometry, geometry_of, GRAVITY
from cpg_ros.robots.robot import Robot
import numpy as np

#: Of the Go2's outstretched legs, from the thigh joints to the feet, m.
LENGTH = 0.426
#: Powers of the legs' length, of sqrt(l/g) and of the mass that each unit is.
POWERS = {'m': (1, 0, 0), 's': (0, 1, 0), 's^2': (0, 2, 0), 'Hz': (0, -1, 0), 'kg': (0, 0, 1),
          'N': (1, -2, 1), 'rad': (0, 0, 0), '1': (0, 0, 0), '': (0, 0, 0)}
#: Scaled gains have so many digits.
DIGITS = 3


def leg_length(geometry: Geometry) -> float:
    """Return the mean length of the outstretched legs, m; that of a Go2 for no legs.

    Unlike the height of the stand, it does not depend on how far a file bends the knees.
    """
    known = geometry.turns[:, 1] != 0.0
    lengths = (np.abs(geometry.uppers) + np.abs(geometry.lowers))[known]
    return float(lengths.mean()) if known.any() else LENGTH


@cache
def _powers(unit: str) -> tuple[int, ...]:
    over, *under = unit.split('/')
    found = np.zeros(3, dtype=int)
    for part in over.split(' '):
        found += POWERS[part]
    for part in under:
        found -= POWERS[part]
    return tuple(found.tolist())


def scale_of(unit: str, length: float, mass: float = 1.0) -> float:
    """Return how much 1 of a dimensionless gain is in its unit, as sqrt(g l) for 'm/s'.

    Args:
        unit: of the gain.
        length: of the legs, m.
        mass: of the robot, kg.

    """
    lengths, times, masses = _powers(unit)
    return float(length**lengths * math.sqrt(length / GRAVITY)**times * mass**masses)


def scaled_gains(length: float) -> Gains:
    """Return the usual gains for legs of a length, m, held to their limits."""
    found = {}
    for name, gain in GAINS.items():
        ratio = scale_of(gain.unit, length) / scale_of(gain.unit, LENGTH)
        if ratio != 1.0:
            scaled = float(f'{gain.default * ratio:.{DIGITS}g}')
            found[name] = min(max(scaled, gain.low), gain.high)
    return Gains()._replace(**found)


def dimensionless(gains: Gains, length: float) -> dict[str, float]:
    """Return gains by name as a robot file has them; length of the legs, m."""
    return {name: float(f'{getattr(gains, name) / scale_of(gain.unit, length):.{DIGITS + 1}g}')
            for name, gain in GAINS.items()}


def robot_gains(robot: Robot) -> Gains:
    """Return a robot's gains: the usual ones for legs of its length, and its file's own.

    Raises:
        InputError: the file names a law or a gain that does not exist, or one beyond its limits.

    """
    if robot.geometry is None:
        return Gains()
    length = leg_length(geometry_of(robot))
    gains, own = scaled_gains(length), robot.feedback
    if own is None:
        return gains
    for part, names, known in (('laws', own.laws, [law.name for law in LAWS]),
                               ('gains', own.gains, list(GAINS))):
        for name in names:
            if name not in known:
                raise InputError(f"robot file '{robot.name}': feedback.{part} has '{name}', which "
                                 f'is not one of {", ".join(known)}')
    gains = gains._replace(**own.laws, **{
        name: value * scale_of(GAINS[name].unit, length) for name, value in own.gains.items()})
    try:
        gains.check()
    except InputError as error:
        raise InputError(f"robot file '{robot.name}', feedback.gains, for legs of {length:.3g} m: "
                         f'{error}') from error
    return gains

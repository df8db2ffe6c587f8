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

"""Feedback laws of quadrupeds: list, gains and memory; gains for robots of any size.

Legged bodies of one shape move alike at one Froude number v^2/(g l) (Alexander and Jayes 1983): as
gravity is the same, lengths scale with the leg length l, and times with sqrt(l/g). Forces are
fractions of the weight in all laws of a quadruped, so mass does not matter there; a biped's gains
are proportional to it. The unit of a gain determines how it scales. The default gains were found
on a Unitree Go2.
"""

from collections.abc import Sequence
from functools import cache
from importlib import import_module
import math
from typing import Any

from cpg_ros.common.errors import InputError
from cpg_ros.feedback.efference_copy import SIGNALS
from cpg_ros.feedback.kinematics import Geometry, geometry_of, GRAVITY
from cpg_ros.feedback.laws.law import Gain, Law, named_tuple, StateVariable
from cpg_ros.motion.robot import Robot
import numpy as np

# The list of the feedback laws, and the switches and gains of all of them.

#: All laws, in the order in which parameters and the reference list them.
LAWS: Sequence[Law] = [import_module(f'cpg_ros.feedback.laws.{name}').LAW for name in (
    'posture', 'placement', 'pace', 'stiffen', 'virtual_stiffness', 'servo_gains', 'reflexes',
    'clearance', 'slope', 'heading', 'speed', 'sidestep')]
#: Gains that all laws share.
COMMON = {'smooth': Gain(0.008, 0.08, 's',
                         'time constant with which every displacement is smoothed')}
#: All gains, by name.
GAINS: dict[str, Gain] = {name: gain for gains in (*(law.gains for law in LAWS), COMMON)
                          for name, gain in gains.items()}
_DEFAULTS = {**{law.name: law.on for law in LAWS},
             **{name: gain.default for name, gain in GAINS.items()}}
_Fields: Any = named_tuple('Gains', _DEFAULTS, _DEFAULTS.values())


class Gains(_Fields):  # type: ignore[misc]
    """Switches of the laws, and their gains in SI units.

    The fields are the switches of LAWS by name, then GAINS.
    """

    __slots__ = ()

    def check(self) -> None:
        """Raise InputError if a gain is outside its limits."""
        for name, gain in GAINS.items():
            value = getattr(self, name)
            if not gain.low <= value <= gain.high:
                raise InputError(f"gain '{name}' is {value:g}, but must be from {gain.low:g} to "
                                 f'{gain.high:g}' + (f' {gain.unit}' if gain.unit else ''))


# Memory of the feedback from tick to tick: the estimate, the laws' state, its output.

#: State that all laws share.
COMMON_MEMORY = {
    'velocity': StateVariable('of the base in its own frame [m/s]', (3,)),
    'contact': StateVariable('whether each foot is on the ground', ('legs',), False),
    'doubt': StateVariable('for how long the legs on the ground have disagreed with the velocity '
                           '[s]'),
    'displacement': StateVariable('of each foot, smoothed [m]', ('legs', 3)),
    'stride': StateVariable("to be added to each leg's stride", ('legs',)),
    'frequency_scale': StateVariable('factor of the stride frequency', (), 1.0),
    'last_phase': StateVariable('of the first leg at the last tick [cycles]'),
    'wanted_velocity': StateVariable('forward and to the left as it is approached [m/s], and in a '
                                     'second row its rate [m/s^2]', (2, 2))}
VARIABLES = {name: variable for part in (COMMON_MEMORY, *(law.memory for law in LAWS))
             for name, variable in part.items()}
#: Arrays that pass values on within a tick; they have no axis for the runs.
SCRATCH = {
    'leg_velocities': StateVariable("see estimate.update; then the planned feet's places [m]",
                                    ('legs', 4)),
    'scratch': StateVariable('see estimate.update', (4, 3)),
    'expected': StateVariable('signals of the efference copy', (SIGNALS,))}
_MemoryFields: Any = named_tuple('Memory', [*VARIABLES, *SCRATCH])


class Memory(_MemoryFields):  # type: ignore[misc]
    """Arrays of VARIABLES, whose first axis is the run, and of SCRATCH."""

    __slots__ = ()

    @classmethod
    def empty(cls, runs: int, legs: int) -> 'Memory':
        """Return the memory of robots that have not moved yet."""
        def array(variable: StateVariable, *first: int) -> np.ndarray:
            shape = [legs if size == 'legs' else int(size) for size in variable.shape]
            return np.full((*first, *shape), variable.initial)

        return cls(*(array(dimensions, runs) for dimensions in VARIABLES.values()),
                   *(array(dimensions) for dimensions in SCRATCH.values()))


# Gains of a robot of another size than the Go2.

#: GO2_LEG_LENGTH: length of the Go2's outstretched legs, from the thigh joints to the feet, m.
GO2_LEG_LENGTH = 0.426
#: EXPONENTS: unit -> exponents of the legs' length l, of the time sqrt(l/g) and of the mass.
EXPONENTS = {'m': (1, 0, 0), 's': (0, 1, 0), 's^2': (0, 2, 0), 'Hz': (0, -1, 0), 'kg': (0, 0, 1),
          'N': (1, -2, 1), 'rad': (0, 0, 0), '1': (0, 0, 0), '': (0, 0, 0)}
#: DIGITS: significant digits of scaled gains.
DIGITS = 3


def leg_length(geometry: Geometry) -> float:
    """Return the mean length of the outstretched legs, m; a Go2's for no legs.

    Unlike the height of the stand, it does not depend on how far a file bends the knees.
    """
    turning = geometry.turns[:, 1] != 0.0
    lengths = (np.abs(geometry.uppers) + np.abs(geometry.lowers))[turning]
    return float(lengths.mean()) if turning.any() else GO2_LEG_LENGTH


def shorter_times(length: float) -> float:
    """Return the factor of times for legs of a length in m that are shorter than a Go2's, else 1.

    Sensors may be late by a fraction of the time in which a body falls.
    """
    return min(math.sqrt(length / GO2_LEG_LENGTH), 1.0)


@cache
def _powers(unit: str) -> tuple[int, ...]:
    over, *under = unit.split('/')
    powers = np.zeros(3, dtype=int)
    for part in over.split(' '):
        powers += EXPONENTS[part]
    for part in under:
        powers -= EXPONENTS[part]
    return tuple(powers.tolist())


def scale_of(unit: str, length: float, mass: float = 1.0) -> float:
    """Return the value in a unit of a dimensionless gain of 1, such as sqrt(g l) for 'm/s'.

    Args:
        unit: of the gain.
        length: of the legs, m.
        mass: of the robot, kg.

    """
    lengths, times, masses = _powers(unit)
    return float(length**lengths * math.sqrt(length / GRAVITY)**times * mass**masses)


def scaled_gains(length: float) -> Gains:
    """Return the default gains for legs of a length, m, within their limits."""
    result = {}
    for name, gain in GAINS.items():
        ratio = scale_of(gain.unit, length) / scale_of(gain.unit, GO2_LEG_LENGTH)
        if ratio != 1.0:
            scaled = float(f'{gain.default * ratio:.{DIGITS}g}')
            result[name] = min(max(scaled, gain.low), gain.high)
    return Gains()._replace(**result)


def dimensionless(gains: Gains, length: float) -> dict[str, float]:
    """Return gains by name as in a robot file; length of the legs, m."""
    return {name: float(f'{getattr(gains, name) / scale_of(gain.unit, length):.{DIGITS + 1}g}')
            for name, gain in GAINS.items()}


def robot_gains(robot: Robot) -> Gains:
    """Return a robot's gains: defaults for the length of its legs, and those of its file.

    Raises:
        InputError: the file names an unknown law or gain, or a gain beyond its limits.

    """
    if robot.geometry is None:
        return Gains()
    length = leg_length(geometry_of(robot))
    gains, own = scaled_gains(length), robot.feedback
    if own is None:
        return gains
    for part, names, allowed in (('laws', own.laws, [law.name for law in LAWS]),
                               ('gains', own.gains, list(GAINS))):
        for name in names:
            if name not in allowed:
                raise InputError(f"robot file '{robot.name}': feedback.{part} has '{name}', which "
                                 f'is not one of {", ".join(allowed)}')
    gains = gains._replace(**own.laws, **{
        name: value * scale_of(GAINS[name].unit, length) for name, value in own.gains.items()})
    try:
        gains.check()
    except InputError as error:
        raise InputError(f"robot file '{robot.name}', feedback.gains, for legs of {length:.3g} m: "
                         f'{error}') from error
    return gains

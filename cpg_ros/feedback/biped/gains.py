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

"""Memory, outputs and gains of a biped's feedback: the gains of all its laws, for each gait."""

from collections.abc import Mapping
from typing import Any, NamedTuple

from cpg_ros.common.errors import InputError
from cpg_ros.feedback.biped.links import blank_pose, Links, Pose
from cpg_ros.feedback.biped.stepping import (
    CLOCK_GAINS,
    FLIGHT_GAINS,
    PLACEMENT_GAINS,
    SWING_GAINS,
)
from cpg_ros.feedback.biped.support import STANCE_GAINS, VELOCITY_GAINS
from cpg_ros.feedback.gains import scale_of
from cpg_ros.feedback.kinematics import GRAVITY
from cpg_ros.feedback.laws.law import Gain, named_tuple
from cpg_ros.motion.body_file import BipedBody
import numpy as np

# Memory and outputs of a biped's feedback.

#: Modes. STAND: stand on both legs; SHIFT: shift the weight to the second foot; WALK: follow the
#: clock, in any gait.
STAND, SHIFT, WALK = 0, 1, 2


#: What the laws remember; world axes, places from the base unless stated otherwise. velocity: of
#: the base, m/s; center: of mass, m, then its velocity, m/s; turning: angular velocity of the
#: base, rad/s; soles: velocities of the soles from the base's, m/s and rad/s; loads: fraction of
#: the weight on each foot; wanted: velocity forward and left as it is approached, m/s; heading:
#: wanted, rad; integral: of the missing speed, m; phases, before: of the legs from their lift-off
#: on, now and at the last tick, cycles; swinging, landed: whether each leg swings and has landed
#: early; lift_off: where each swing began, from the other sole, or, in gaits with flight, from the
#: base, m; target: where it is to end, likewise; ground: height of the ground, m; fractions: of
#: the weight that each leg is to bear; dcm_error: of the capture point, forward and left, m;
#: force: that the ground is to exert on all feet, N; reaction: moment that the swing leg takes, N
#: m; path: of a swinging foot, scratch; clock: factor of the clock, and by how much it is to leap,
#: cycles; crouch: how much lower than usual the centre of mass is to be, m; rpy: roll, pitch and
#: yaw of the base, rad; roll_error: of the measured roll, rad; left_speed: of the centre of mass,
#: m/s.
LAWS = np.dtype([
    *((name, float, shape) for name, shape in (
        ('velocity', 3), ('center', (2, 3)), ('turning', 3), ('soles', (2, 6)), ('loads', 2),
        ('wanted', 2), ('phases', 2), ('before', 2), ('lift_off', (2, 3)), ('target', (2, 3)),
        ('fractions', 2), ('dcm_error', 2), ('force', 3), ('reaction', 3), ('path', (3, 3)),
        ('clock', 2), ('rpy', 3))),
    *((name, float) for name in ('heading', 'integral', 'ground', 'crouch', 'roll_error',
                                 'left_speed')),
    ('swinging', np.int8, 2), ('landed', np.int8, 2)])


class BipedMemory(NamedTuple):
    """State and outputs of the laws.

    Attributes:
        pose: of the links.
        laws: LAWS, shape (1,).
        torque: of the legs' joints, N m, shape (2, joints of a leg).

    """

    pose: Pose
    laws: np.ndarray
    torque: np.ndarray

    @classmethod
    def empty(cls, links: Links) -> 'BipedMemory':
        """Return the memory of a biped that has not moved yet."""
        laws = np.zeros(1, LAWS).view(np.recarray)
        laws.fractions[:], laws.clock[0, 0] = 0.5, 1.0
        laws.force[0, 2] = GRAVITY * links.masses.sum()
        return cls(blank_pose(links), laws, np.zeros((2, links.chains.shape[1])))


GAINS: Mapping[str, Gain] = {**CLOCK_GAINS, **FLIGHT_GAINS, **PLACEMENT_GAINS, **STANCE_GAINS,
                             **SWING_GAINS, **VELOCITY_GAINS}
#: A gait as compiled code takes it: its gains by their names, slow and fast: range of its speed
#: forward, m/s; kind: WALKS, RUNS or HOPS; name: its place in KINDS; track: address of its
#: network's struct in the core.
GAIT = np.dtype([*((name, float) for name in (*GAINS, 'slow', 'fast')),
                 *((name, np.int64) for name in ('kind', 'name', 'track'))])
#: Gains that differ from the walk's, by gait; found on a simulated Unitree G1.
_HOP = {
    'frequency': 2.626, 'duty': 0.597, 'lift': 0.0535, 'swing_end': 0.8685,
    'height_kp': 3979.0, 'height_kd': 354.5, 'roll_kp': 879.3, 'roll_kd': 50.2,
    'pitch_kp': 820.6, 'pitch_kd': 25.3, 'yaw_kp': 40.9, 'yaw_kd': 5.52, 'lean': -0.0216,
    'swing_kp': 3104.0, 'swing_kd': 126.8, 'swing_mass': 4.613, 'sole_kp': 130.1,
    'sole_kd': 1.558, 'stance_damping': 0.3, 'speed_integral': 0.318, 'place_offset': 0.02,
    'reaction': 0.2228, 'reaction_yaw': 0.681, 'flight_height': 0.9914, 'flight_kp': 5162.0,
    'flight_kd': 353.6, 'flight_width': 0.898, 'flight_ahead': 0.488, 'flight_x': 0.1152,
    'flight_y': 0.03}
GAIT_GAINS: Mapping[str, Mapping[str, float]] = {
    'run': {
        'frequency': 2.206, 'duty': 0.353, 'lift': 0.0792, 'swing_end': 0.9576,
        'height_kp': 3979.0, 'height_kd': 354.5, 'roll_kp': 271.4, 'roll_kd': 81.5,
        'pitch_kp': 133.7, 'pitch_kd': 16.3, 'yaw_kp': 32.4, 'yaw_kd': 6.78, 'lean': -0.0174,
        'swing_kp': 2610.0, 'swing_kd': 151.5, 'swing_mass': 2.115, 'sole_kp': 68.0,
        'sole_kd': 0.33, 'stance_damping': 0.3, 'speed_integral': 0.793, 'place_offset': 0.0082,
        'reaction': 0.0689, 'reaction_yaw': 0.639},
    'two_legged_hop': _HOP, 'two_legged_jump': _HOP}
#: FLIGHT_LIMITS: limits of gains in gaits with flight that are lower than in a walk.
FLIGHT_LIMITS: Mapping[str, float] = {'duty': 0.2}
_Fields: Any = named_tuple('BipedGains', GAINS, (gain.default for gain in GAINS.values()))


class BipedGains(_Fields):  # type: ignore[misc]
    """Gains in SI units, by the names of GAINS; defaults were found on a simulated Unitree G1."""

    __slots__ = ()

    @classmethod
    def of_body(cls, body: BipedBody, gait: str = 'walk') -> 'BipedGains':
        """Return a gait's gains from a robot file, or the usual ones for the robot's size.

        Raises:
            InputError: as of `of`.

        """
        for gait_name, changes in body.gait_gains.items():
            _check(changes, f'biped.gains.{gait_name}',
                   FLIGHT_LIMITS if gait_name in GAIT_GAINS else {})
        return cls.of(body.gains, gait, body.scale)._replace(**body.gait_gains.get(gait, {}))

    @classmethod
    def of(cls, changes: Mapping[str, float], gait: str = 'walk',
           scale: tuple[float, float] = (1.0, 1.0)) -> 'BipedGains':
        """Return a gait's usual gains with changes; gains that only this gait has stay.

        Args:
            changes: gains by name, in their units.
            gait: one of those that have laws.
            scale: length and mass of the robot over those of the G1, by which the usual gains are
                scaled and held to their limits (see froude_scaling).

        Raises:
            InputError: no gain has this name, or it is not within its limits.

        """
        _check(changes, 'biped.gains', {})
        of_gait = GAIT_GAINS.get(gait, {})
        usual = {**{name: gain.default for name, gain in GAINS.items()}, **of_gait}
        own = {name: value for name, value in changes.items() if name not in of_gait}
        return cls(**{name: float(own[name] if name in own else _scaled(GAINS[name], value, scale))
                      for name, value in usual.items()})


def _check(changes: Mapping[str, float], where: str, lowest: Mapping[str, float]) -> None:
    for name, value in changes.items():
        if name not in GAINS:
            raise InputError(f"{where}: '{name}' is not one of {', '.join(GAINS)}")
        gain = GAINS[name]
        low = lowest.get(name, gain.low)
        if not low <= value <= gain.high:
            raise InputError(f'{where}.{name}: {value:g} is not from {low:g} to '
                             f'{gain.high:g} {gain.unit}'.rstrip())


def _scaled(gain: Gain, value: float, scale: tuple[float, float]) -> float:
    if scale == (1.0, 1.0):
        return value
    ratio = scale_of(gain.unit, *scale) / scale_of(gain.unit, 1.0)
    return min(max(value * ratio, gain.low), gain.high)

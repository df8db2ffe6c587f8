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

"""A robot as the generator sees it: legs, joints, cells that drive them, limits.

A joint's angle is ``offset + amplitude * sum_k w_k psi_k(x, y)``: x is its cell's waveform (for a
Morris-Lecar cell its first harmonics), from -1 to 1, y the derivative of x by phase (in radians),
psi = x, y, x^2, x y, x^3, x^2 y (docs/theory_orbits.md, section Readout), weights in rad. A
gait's motion can replace offsets and weights. Strides from -1 to 1 make the weights ``in_place +
stride (w - in_place)``.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
import math
from typing import Annotated

from cpg_ros.common.errors import InputError, short, ShortRepr
from cpg_ros.common.yaml_reader import positive, within
from cpg_ros.motion.body_file import BipedBody, BodyGeometry, EfferenceTable, OwnFeedback
from cpg_ros.networks.registry import NETWORKS
import numpy as np

#: Default number of harmonics of a Morris-Lecar cell that joints follow.
NUM_HARMONICS = 3

#: WEIGHT_COUNTS: numbers of weights of the readouts: of a bare scale, and of the orders 1, 2 and
#: 3.
WEIGHT_COUNTS = (1, 2, 4, 6)


@dataclass(frozen=True)
class Joint:
    """One joint: name, leg, cell from 1; offset, weights, lower, upper in rad; velocity rad/s.

    ``invented`` names those of lower, upper and velocity that are guesses, as the URDF has no
    limit.
    """

    name: str
    leg: str
    cell: int
    offset: float
    weights: tuple[float, ...]
    lower: float
    upper: float
    velocity: Annotated[float, positive]
    invented: tuple[str, ...] = ()


@dataclass(frozen=True)
class SteeringTable:
    """Measured speed and yaw rate of a robot by stride, by ascending speed.

    Attributes:
        speed: forward, m/s.
        stride: factor of all legs' strides, -1 to 1.
        frequency: of the strides, Hz.
        turn: yaw rate, rad/s, for each unit by which the right stride exceeds the left one.
        stiffness: factor of the servos' proportional gain; empty for 1 at all speeds.

    """

    speed: tuple[float, ...]
    stride: Annotated[tuple[float, ...], None, within(-1.0, 1.0, '-1 to 1')]
    frequency: tuple[float, ...]
    turn: Annotated[tuple[float, ...], None, within(1e-3, 1e3, '0.001 to 1000 rad/s')]
    stiffness: Annotated[tuple[float, ...], None, within(1.0, 4.0, '1 to 4')] = ()

    def ask(self, speed: float, turn: float) -> tuple[float, float, float]:
        """Return the strides of the left and right legs, and the frequency in Hz.

        Args:
            speed: wanted, forward, m/s; limited to the table's range.
            turn: wanted yaw rate, rad/s, positive to the left; it takes precedence over speed
                where a stride would exceed 1.

        """
        stride, frequency, rate = (float(np.interp(speed, self.speed, column))
                                   for column in (self.stride, self.frequency, self.turn))
        half = min(max(0.5 * turn / rate, -1.0), 1.0)
        stride = min(max(stride, abs(half) - 1.0), 1.0 - abs(half))
        return stride - half, stride + half, frequency


@dataclass(frozen=True)
class JointMotion:
    """A joint in one gait: offset, weights, and weights at a stride of 0, rad."""

    offset: float
    weights: tuple[float, ...]
    in_place: tuple[float, ...] = ()


@dataclass(frozen=True, repr=False)
class Motion(ShortRepr):
    """A robot in one gait, where it differs from the robot's joints.

    Attributes:
        frequency: for which it was made, strides per second (Hz); None for any.
        joints: by name.
        steering: None if not measured.
        duty: wanted fraction of the stride that legs stand, None for that of the cells.
        verdict: of a trial in simulation, which begins with good or poor; '' if there was none.
        stance: touchdown as a phase of the leg's cell, and duty factor, of the weights, cycles;
            None if a leg stands while its cell falls.
        efference: the base's own motion, None if not measured.

    """

    frequency: Annotated[float | None, within(0.01, 10.0, '0.01 to 10 Hz')] = None
    joints: dict[str, JointMotion] = field(default_factory=dict)
    steering: SteeringTable | None = None
    efference: EfferenceTable | None = None
    duty: Annotated[float | None, within(0.3, 0.9, '0.3 to 0.9')] = None
    stance: tuple[float, float] | None = None
    verdict: str = ''


@dataclass(frozen=True, repr=False)
class Robot(ShortRepr):
    """Legs and joints of a robot, joints grouped by leg in the order of the file.

    Attributes:
        name: stem of the file.
        networks: names of the networks that can drive it; all have the same legs.
        assignment: of cells to legs, see NetworkDefinition.legs.
        harmonics: number of harmonics of a Morris-Lecar cell's waveform that joints follow.
        legs: leg -> its joints.
        order: names of all joints in the order of controllers.
        motions: gait or preset -> motion.
        sides: leg -> left or right, from the file or the network.
        girdles: leg -> fore or hind, likewise.
        geometry: of its legs, None if the file has none.
        biped: links, soles and servos of a biped with soles, or None.
        feedback: settings that differ from the defaults, or None.

    """

    name: str
    networks: tuple[str, ...]
    assignment: str
    harmonics: int
    legs: dict[str, tuple[Joint, ...]]
    order: tuple[str, ...]
    motions: dict[str, Motion] = field(default_factory=dict)
    sides: dict[str, str] = field(default_factory=dict)
    girdles: dict[str, str] = field(default_factory=dict)
    geometry: BodyGeometry | None = None
    biped: BipedBody | None = None
    feedback: OwnFeedback | None = None

    def __post_init__(self) -> None:
        for key in ('sides', 'girdles'):
            stated = {leg: word for name in self.networks
                      for leg, word in getattr(NETWORKS[name], key).items()}
            object.__setattr__(self, key, {**stated, **getattr(self, key)})

    def _summary(self) -> str:
        return (f'{self.name}: {len(self.legs)} legs, {len(self.order)} joints, driven by '
                f'{short(self.networks)}')

    @property
    def left(self) -> np.ndarray:
        """Whether each leg is on the left, shape (legs,).

        Raises:
            ValueError: neither network nor robot file states the side of each leg.

        """
        for leg in self.legs:
            if leg not in self.sides:
                raise InputError(f"robot file '{self.name}' does not say on which side the leg "
                                 f'{leg} is (legs.{leg}.side)')
        return np.array([self.sides[leg] == 'left' for leg in self.legs])

    @property
    def joints(self) -> tuple[Joint, ...]:
        """All joints, leg by leg."""
        return tuple(joint for leg in self.legs.values() for joint in leg)

    @property
    def held(self) -> dict[str, float]:
        """Held joint that belongs to no leg -> angle, rad."""
        return {} if self.biped is None else self.biped.held

    @property
    def order_indices(self) -> np.ndarray:
        """Index into ``joints`` of each name in ``order``, shape (joints,)."""
        names = [joint.name for joint in self.joints]
        return np.array([names.index(name) for name in self.order])

    @property
    def cells(self) -> np.ndarray:
        """Cell of each joint, from 0, shape (joints,)."""
        return np.array([joint.cell - 1 for joint in self.joints])

    def motion(self, preset: str, gait: str) -> Motion:
        """Return the motion of a preset, or else of its gait, or else an empty one."""
        return self.motions.get(preset) or self.motions.get(gait) or Motion()

    def networks_with(self, gait: str) -> tuple[str, ...]:
        """Return the names of the robot's networks that have a gait or preset."""
        return tuple(name for name in self.networks if gait in NETWORKS[name].presets())

    def shift(self, motion: Motion) -> np.ndarray:
        """Return a motion's offsets less those of the stand, rad, shape (joints,)."""
        return np.array([motion.joints[joint.name].offset - joint.offset
                         if joint.name in motion.joints else 0.0 for joint in self.joints])

    def weights(self, motion: Motion | None = None, in_place: bool = False) -> np.ndarray:
        """Return readout weights, rad, shape (joints, 6), zero above a joint's own order.

        Args:
            motion: of a gait; by default the joints' own weights.
            in_place: return the weights at a stride of 0.

        """
        table = np.zeros((len(self.joints), WEIGHT_COUNTS[-1]))
        for row, joint in zip(table, self.joints, strict=True):
            moved = (motion or Motion()).joints.get(joint.name)
            listed = moved or JointMotion(joint.offset, joint.weights)
            weights = listed.in_place if in_place else listed.weights
            row[:len(weights)] = weights
        return table

    def column(self, key: str) -> np.ndarray:
        """Return a number of every joint (offset, lower, upper or velocity), shape (joints,)."""
        return np.array([getattr(joint, key) for joint in self.joints], dtype=float)

    @property
    def leg_cells(self) -> np.ndarray:
        """Cell that gives each leg's phase, from 0, shape (legs,)."""
        cells = NETWORKS[self.networks[0]].legs[self.assignment]
        return np.array([cells[leg][0] - 1 for leg in self.legs])

    @property
    def leg_of_joint(self) -> np.ndarray:
        """Leg of each joint, from 0, shape (joints,)."""
        return np.repeat(np.arange(len(self.legs)), [len(leg) for leg in self.legs.values()])


# A gait's readout as one list for each joint: its offset, then its weights, rad.

#: READOUT_PREFIX: prefix of the generator's parameters of readouts; the joint's name follows.
READOUT_PREFIX = 'readout.'


def gait_readouts(robot: Robot, motion: Motion) -> dict[str, tuple[float, ...]]:
    """Return offset and weights of every joint in one of the robot's motions, rad, by name."""
    readouts = {}
    for joint in robot.joints:
        moved = motion.joints.get(joint.name, joint)
        readouts[joint.name] = (moved.offset, *moved.weights)
    return readouts


def with_readouts(robot: Robot, preset: str, gait: str,
                  readouts: Mapping[str, Sequence[float]]) -> Robot:
    """Return a robot with other readouts in a gait.

    Weights at a stride of 0, steering and duty stay those of the file.

    Args:
        robot: returned itself if nothing changes.
        preset: whose motion is changed, or that of its gait if it has none.
        gait: of the preset.
        readouts: joint -> offset, then 1, 2, 4 or 6 weights, rad.

    Raises:
        InputError: a joint has another number of values, or one is not finite.

    """
    motion = robot.motion(preset, gait)
    if readouts == gait_readouts(robot, motion):
        return robot
    joints = {}
    for name, (offset, *weights) in ((name, [*row] or [math.nan])
                                     for name, row in readouts.items()):
        if len(weights) not in WEIGHT_COUNTS or not all(map(math.isfinite, (offset, *weights))):
            raise InputError(f'{READOUT_PREFIX}{name} must be an offset and 1, 2, 4 or 6 weights '
                             f'in rad, not {list(readouts[name])}')
        own = motion.joints.get(name)
        joints[name] = JointMotion(offset, tuple(weights), own.in_place if own else ())
    return replace(robot, motions={**robot.motions, preset: replace(motion, joints=joints)})

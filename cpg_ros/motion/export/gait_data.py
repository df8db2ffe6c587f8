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

"""Numbers of gaits as C (``gait_data.c``): tables of orbits, readouts, limits."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
import re
from typing import Any

from cpg_ros.common.command_line import printable
from cpg_ros.common.errors import InputError
from cpg_ros.dynamics.integration.c_text import braces, number
from cpg_ros.dynamics.orbit import Orbit
from cpg_ros.motion.phase_readout import PhaseReadout
from cpg_ros.motion.plan import GaitPlan
from cpg_ros.motion.readout import WaveReadout
from cpg_ros.motion.robot import WEIGHT_COUNTS
from cpg_ros.networks.equations import values_of
import numpy as np

MIN_RANGE = 1e-3
TABLE_SIZES = (16, 32, 64, 128, 256, 512, 1024, 2048, 4096)
#: WAVEFORM_SIZES: type of numbers -> entries of the tables over a waveform's angle.
WAVEFORM_SIZES = {'float32': 256, 'float64': 512}
LIMITS = ('lower', 'upper', 'velocity')


@dataclass(frozen=True)
class CFormat:
    """Settings of gaits as C.

    Attributes:
        form: ``network``, or ``table`` for the orbits alone.
        real: ``float32`` or ``float64``.
        tolerance: largest error of tables, over half the range of their values.
        steering: whether strides and pace can be changed.

    """

    form: str = 'network'
    real: str = 'float32'
    tolerance: float = 1e-4
    steering: bool = False


def c_name(name: str) -> str:
    """Return a name as an identifier of C, in capitals."""
    return re.sub(r'\W', '_', name, flags=re.ASCII).upper()


def check_names(what: str, names: Sequence[str]) -> None:
    """Check that names are distinct identifiers of C.

    Raises:
        InputError: two of them are the same identifier.

    """
    used: dict[str, str] = {}
    for name in names:
        other = used.setdefault(c_name(name), name)
        if other != name:
            raise InputError(f'{what} {other!r} and {name!r} are both {c_name(name)} in C: rename '
                             'one of them')


def comment(text: str) -> str:
    """Return a text as the content of a C comment, on one line."""
    return printable(' '.join(text.split())).replace('*/', '* /').replace('/*', '/ *')


def hermite_table(curve: Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]], tolerance: float,
                  points: Sequence[int] = TABLE_SIZES) -> np.ndarray:
    """Tabulate periodic curves with as few points as a tolerance allows.

    Args:
        curve: phases in cycles, shape (m,) -> values and slopes per cycle, (curves, m).
        tolerance: of the cubics between points, over half of each curve's range.
        points: candidate numbers of points, ascending; the last one if none suffices.

    Returns:
        Values and slopes per point, shape (curves, points, 2).

    """
    for count in points:
        grid = np.arange(count) / count
        values, slopes = curve(grid)
        slopes = slopes / count
        middle = (0.5 * (values + np.roll(values, -1, axis=1))
                  + 0.125 * (slopes - np.roll(slopes, -1, axis=1)))
        off = np.abs(middle - curve(grid + 0.5 / count)[0]).max(axis=1)
        half = 0.5 * np.ptp(values, axis=1)
        # A curve that hardly moves beside the others need not be as exact.
        if (off <= tolerance * np.maximum(half, MIN_RANGE * half.max())).all():
            break
    return np.stack([values, slopes], axis=2)


def distinct_joints(plan: GaitPlan) -> tuple[np.ndarray, np.ndarray]:
    """Return joints with distinct angles over a cycle, and for each joint the one it equals."""
    both = np.hstack([plan.readout.angles, plan.readout.rises])
    _, first, indices = np.unique(np.round(both, 12), axis=0, return_index=True,
                                return_inverse=True)
    return first, indices.ravel()


def leg_phases(plan: GaitPlan) -> np.ndarray:
    """Return the legs' phases at the orbit's phase 0, cycles, shape (legs,)."""
    cells, readout = plan.robot.leg_cells, plan.readout
    phases = plan.orbit.phases[cells]
    if isinstance(readout, PhaseReadout):
        return np.asarray(phases - readout.gait.known.crests[plan.orbit.waves[cells]])
    return np.asarray(phases)


@dataclass
class _Struct:
    """Initializer of a struct, and the arrays to which it points."""

    name: str
    real: str
    arrays: list[str] = field(default_factory=list)
    fields: list[str] = field(default_factory=list)
    numbers: int = 0
    points: int = 0

    def put(self, key: str, value: Any) -> None:
        """Add a number, or an array inside the struct."""
        if np.ndim(value):
            text = braces(value, self.real, 8)
        else:
            text = str(value) if isinstance(value, int) else number(value, self.real)
        self.numbers += np.size(value)
        self.fields.append(f'        .{key} = {text},')

    def point(self, key: str, values: np.ndarray | None) -> None:
        """Add a pointer to an array, 0 for none."""
        if values is None:
            self.fields.append(f'        .{key} = 0,')
            return
        name = f'{self.name}_{key}'
        self.numbers += values.size
        self.arrays.append(f'static CPG_ROM cpg_real {name}[] = '
                           f'{braces(values.ravel(), self.real)};')
        self.fields.append(f'        .{key} = {name},')


class GaitData:
    """Gaits of one robot and one network, as constants of C.

    Attributes:
        plans: of the gaits.
        format: settings.

    """

    def __init__(self, plans: Sequence[GaitPlan], c_format: CFormat) -> None:
        """Prepare gaits, given their plans for one robot and one network."""
        self.plans, self.format = plans, c_format
        self.network, self.robot = plans[0].orbit.network, plans[0].robot
        weights = [plan.readout.joints.weights for plan in plans]
        if c_format.steering:
            weights += [plan.in_place.joints.weights for plan in plans]
        used = np.flatnonzero(np.concatenate(weights).any(axis=0))
        highest = int(used.max()) + 1 if used.size else 1
        #: Readout weights of a joint that are exported, and whether phases are retimed.
        self.weights = next(order for order in WEIGHT_COUNTS if order >= highest)
        self.retimed = any((self.maps(plan) is not None) for plan in plans)

    def maps(self, plan: GaitPlan) -> np.ndarray | None:
        """Return the duty factor's map of each joint's phase, (joints, 3), or None."""
        readout = plan.readout
        if isinstance(readout, WaveReadout):
            return None if readout.retiming is None else readout.retiming.maps
        maps = readout.gait.maps[readout.joints.cells]
        return None if (maps[:, 0] == 1.0).all() else maps

    @cached_property
    def structs(self) -> list[_Struct]:
        """Initializers of the gaits."""
        made = []
        for plan in self.plans:
            struct = _Struct(c_name(plan.name).lower(), self.format.real)
            struct.put('frequency', plan.frequency)
            struct.put('period', plan.orbit.period)
            struct.put('start', plan.readout.start)
            struct.put('shift', plan.shift)
            struct.put('speed', plan.speed)
            (self._table if self.format.form == 'table' else self._network)(struct, plan)
            made.append(struct)
        return made

    def _table(self, struct: _Struct, plan: GaitPlan) -> None:
        readout = plan.readout
        size = readout.angles.shape[1]
        first, indices = distinct_joints(plan)

        def curve(phases: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            at = np.round(phases * size).astype(int) % size
            return readout.angles[first][:, at], readout.rises[first][:, at]

        tables = hermite_table(curve, self.format.tolerance,
                               [2**n for n in range(4, size.bit_length() - 1)])
        struct.put('joint_phase', plan.orbit.phases[self.robot.cells])
        struct.put('leg_phase', leg_phases(plan))
        struct.put('joint_table', indices)
        struct.points = tables.shape[1]
        struct.put('points', struct.points)
        struct.point('tables', tables)

    def _network(self, struct: _Struct, plan: GaitPlan) -> None:
        orbit, network = plan.orbit, plan.orbit.network
        waves = self._waves(orbit)
        struct.put('p', np.concatenate([value.ravel() for value in values_of(network)]))
        struct.put('gain', plan.gain)
        struct.put('delay', network.delay / self.step)
        basis = orbit.symmetry.basis
        struct.put('basis_rows', len(basis) if plan.gain else 0)
        struct.points = waves.shape[1]
        struct.put('points', struct.points)
        struct.point('basis', basis if plan.gain else None)
        struct.point('waves', waves)
        struct.put('phase', orbit.phases)
        struct.put('wave', orbit.waves)
        struct.put('weights', plan.readout.joints.weights[:, :self.weights])
        if self.format.steering:
            struct.put('in_place', plan.in_place.joints.weights[:, :self.weights])
        maps = self.maps(plan)
        if self.retimed:
            struct.put('maps', np.tile([1.0, 0.0, 0.0], (len(self.robot.joints), 1))
                    if maps is None else maps)
        if isinstance(plan.readout, PhaseReadout):
            phase_maps = plan.readout.gait.known
            struct.point('shapes', phase_maps.shape)
            struct.point('circles', phase_maps.circles)
            struct.point('terms', phase_maps.terms)
            struct.point('crests', phase_maps.crests)
            return
        every = len(plan.readout.wave.phase_offset) // self.angles
        struct.put('peak', orbit.peak)
        struct.point('phase_offset', plan.readout.wave.phase_offset[::every])
        if self.retimed:
            retiming = plan.readout.retiming
            struct.point('phase_offset_slope', None if retiming is None else
                      retiming.phase_offset[::every] * [1.0, every])
            struct.point('cycle', None if retiming is None else
                      retiming.cycle[::every] * [1.0, every, 1.0, every])

    def _waves(self, orbit: Orbit) -> np.ndarray:
        """Return the orbit's waveforms as tables, shape (waves * variables, points, 2)."""
        which = [(wave, variable) for wave in range(int(orbit.waves.max()) + 1)
                 for variable in range(self.network.variables)]

        def curve(phases: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
            values, slopes = (np.stack([orbit.waveform(phases, order, *indices)
                                        for indices in which])
                              for order in (0, 1))
            return values, slopes

        return hermite_table(curve, self.format.tolerance)

    @property
    def angles(self) -> int:
        """Number of entries of tables over the angle of a waveform."""
        return WAVEFORM_SIZES[self.format.real]

    @property
    def step(self) -> float:
        """Model time of a step."""
        return self.plans[0].step or self.network.step

    @property
    def points(self) -> int:
        """Largest number of points of a gait's tables."""
        return max(struct.points for struct in self.structs)

    @property
    def bytes(self) -> int:
        """Size of all constants, bytes, without pointers and small integers."""
        size = 4 if self.format.real == 'float32' else 8
        return size * (sum(struct.numbers for struct in self.structs) + 4 * len(self.robot.joints))

    def text(self) -> str:
        """Write ``gait_data.c`` without its head."""
        real, robot = self.format.real, self.robot
        lines = ['#define CPG_INTERNAL', '#include "cpg.h"', '']
        lines += [array for struct in self.structs for array in (*struct.arrays, '')]
        lines.append('CPG_ROM cpg_gait cpg_gaits[CPG_GAITS] = {')
        for struct in self.structs:
            lines += ['    {', *struct.fields, '    },']
        lines += ['};', '', 'CPG_ROM cpg_real cpg_offset[CPG_JOINTS] = '
                  f'{braces(robot.column("offset"), real)};',
                  'CPG_ROM cpg_real cpg_limits[3][CPG_JOINTS] = '
                  f'{braces([robot.column(key) for key in LIMITS], real)};']
        if self.format.form == 'network':
            if self.format.steering:
                legs = braces(robot.leg_of_joint, real)
                lines.append(f'CPG_ROM uint8_t cpg_joint_leg[CPG_JOINTS] = {legs};')
            lines += [f'CPG_ROM uint8_t cpg_joint_cell[CPG_JOINTS] = {braces(robot.cells, real)};',
                      f'CPG_ROM uint8_t cpg_leg_cell[CPG_LEGS] = {braces(robot.leg_cells, real)};']
        return '\n'.join([*lines, ''])

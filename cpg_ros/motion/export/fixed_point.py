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

"""Gaits in whole numbers, for processors of 8 bits: their orbits as tables of 256 angles
and 256 slopes.

Positions are in 2^-13 rad, phases in 2^-32 cycles, levels and shares of a fade in 2^-14. How
finely angles and rates are kept follows from how large they are in the gaits.
"""

from collections.abc import Sequence
import math
from typing import Any

from cpg_ros.common.errors import InputError
from cpg_ros.dynamics.integration.c_text import braces
from cpg_ros.motion.export.c_project import CProject
from cpg_ros.motion.export.gait_data import c_name, CFormat, distinct_joints, GaitData, leg_phases
from cpg_ros.motion.pattern import SHORTEST
from cpg_ros.motion.plan import GaitPlan
import numpy as np

POINTS = 256
POSITION = 13
#: As in pattern.c. SHIFTING: joint speed allowed in ramps and fades, 1/s, per rad from the stand
#: to the gait's mean; SHORT_OF: share of the speed bound up to which joints go.
SHIFTING, SHORT_OF = 2.0, 0.997
#: ANGLE_BITS: most bits of an angle, so that the difference of two fits, too; RATE_BITS: of a
#: rate.
ANGLE_BITS, RATE_BITS = 14, 13
LEAST_TICKS = 4
#: STILL: slope below which a joint does not move, rad per cycle.
STILL = 1e-6


def _halvings(largest: float, bits: int) -> int:
    """Return the number of halvings after which a number has some bits; negative to double it."""
    return math.ceil(math.log2(max(largest, 1e-9) / (2**bits - 1)))


def _whole(values: Any, bits: int = 0) -> np.ndarray:
    return np.rint(np.ldexp(values, bits)).astype(np.int64)


class FixedData(GaitData):
    """Gaits of one robot and one network as whole numbers, advanced tick by tick.

    Attributes:
        rate: ticks per second.

    """

    def __init__(self, plans: Sequence[GaitPlan], rate: float) -> None:
        """Prepare gaits whose plans are of one robot and one network, at some ticks per second.

        Raises:
            InputError: a gait takes more than a quarter of a stride in a tick, or a joint turns by
                more than 4 rad, or no joint moves.

        """
        super().__init__(plans, CFormat('table', 'fixed', 0.0))
        self.rate = rate
        fastest = max(plan.frequency for plan in plans)
        if fastest > rate / 4.0:
            raise InputError(f'{fastest:g} strides per second need at least {4.0 * fastest:g} '
                             f'ticks per second, not {rate:g}')
        readouts = [plan.readout for plan in plans]
        largest = max(float(np.abs(readout.angles + plan.shift[:, np.newaxis]).max())
                      for readout, plan in zip(readouts, plans, strict=True))
        reach = largest + float(np.abs(self.robot.column('offset')).max())
        if reach >= 2.0**(15 - POSITION):
            raise InputError(f'positions up to {reach:.3g} rad: whole numbers go to 4 rad')
        #: Bits that angles have beyond those of positions; and of slopes after the point.
        self.fine = max(0, -_halvings(largest * 2**POSITION, ANGLE_BITS))
        #: Bits by which a frequency of 32 bits is shortened to 16; then the bits of rates after
        #: the point, for a slope times a frequency of 16 bits.
        self.coarser = _halvings(fastest / rate * 2.0**32, 16)
        bound = max(float(bound.max()) for bound in self._bounds)
        steepest = max(float(np.abs(readout.rises).max()) for readout in readouts)
        if steepest < STILL:
            raise InputError(f'{self.robot.name}: no joint moves in '
                             f'{", ".join(plan.name for plan in plans)}, so that whole numbers '
                             'have no unit: give joints an amplitude in the robot file')
        self.slope = -max(_halvings(steepest, 15), _halvings(bound, RATE_BITS) + 16 - self.coarser)
        self._rate_unit = self.slope + 16 - self.coarser
        self._angle = POSITION + self.fine
        self._tables, self._place = [], []
        for plan in plans:
            first, indices = distinct_joints(plan)
            every = plan.readout.angles.shape[1] // POINTS
            self._tables.append(np.hstack([
                _whole(plan.readout.angles[first][:, ::every], self._angle),
                _whole(plan.readout.rises[first][:, ::every], self.slope)]))
            self._place.append(indices)

    @property
    def _bounds(self) -> list[np.ndarray]:
        """Bounds on the joints' rates while gaits fade, rad per tick."""
        fastest = self.robot.column('velocity')
        return [SHORT_OF * np.minimum(plan.speed + SHIFTING * np.abs(plan.shift), fastest)
                / self.rate for plan in self.plans]

    @property
    def points(self) -> int:
        """Points of a gait's tables."""
        return POINTS

    @property
    def bytes(self) -> int:
        """Memory of all constants, bytes."""
        joints, legs = len(self.robot.joints), len(self.robot.legs)
        return sum(8 + 8 * joints + 2 * legs + 2 * table.size
                   for table in self._tables) + 8 * joints

    def defines(self) -> dict[str, object]:
        """Return the sizes and the units that the C needs, name -> value."""
        shortest = max(LEAST_TICKS, math.ceil(SHORTEST * self.rate))
        fraction = 15 + int(math.log2(shortest / LEAST_TICKS))
        finer = self._rate_unit - self._angle
        return {'CPG_GAITS': len(self.plans), 'CPG_LEGS': len(self.robot.legs),
                'CPG_JOINTS': len(self.robot.joints), 'CPG_RATE': f'{self.rate!r}',
                'CPG_SHORTEST': shortest, 'CPG_FINE': self.fine,
                'CPG_FREQUENCY_BITS': self.coarser,
                'CPG_SHARE_BITS': fraction, 'CPG_TERM_BITS': fraction - finer}

    def text(self) -> str:
        """Write ``gait_data.c``, but for its head."""
        lines, structs = ['#define CPG_INTERNAL', '#include "cpg.h"', ''], []
        for plan, table, indices, bound in zip(self.plans, self._tables, self._place,
                                             self._bounds, strict=True):
            name = c_name(plan.name).lower()
            lines += [f'static CPG_ROM int16_t {name}_tables[] = '
                      f'{braces(table.ravel(), "fixed")};', '']
            columns = zip(
                _whole(plan.shift, self._angle),
                np.maximum(1, np.ldexp(bound, self._rate_unit).astype(int)),
                _whole(plan.orbit.phases[self.robot.cells] % 1.0, 16) % 2**16,
                [f'{name}_tables + {table.shape[1] * index}' for index in indices], strict=True)
            start = _whole(plan.readout.start % 1.0, 32) % 2**32
            legs = _whole(leg_phases(plan) % 1.0, 16) % 2**16
            structs += [f'    {{{_whole(plan.frequency / self.rate, 32)}, {start}u, '
                        f'{braces(legs, "fixed")},', _rows(columns, 5) + '},']
        column = self.robot.column
        limits = [np.rint(np.ldexp(column('offset'), POSITION)),
                  np.ceil(np.ldexp(column('lower'), POSITION)),
                  np.floor(np.ldexp(column('upper'), POSITION)),
                  np.maximum(1, np.floor(np.ldexp(column('velocity') / self.rate, POSITION)))]
        held = np.clip(limits, -2**15, 2**15 - 1).astype(int)
        return '\n'.join([
            *lines, 'CPG_ROM cpg_gait cpg_gaits[CPG_GAITS] = {', *structs, '};', '',
            f'CPG_ROM cpg_joint cpg_joints[CPG_JOINTS] = {_rows(held.T)};', ''])


def _rows(rows: Any, indent: int = 4) -> str:
    """Return an initializer of an array of structs."""
    inner = ',\n'.join(f'{" " * indent}{{{", ".join(map(str, row))}}}' for row in rows)
    return f'{" " * (indent - 1) if indent > 4 else ""}{{\n{inner}}}'


class FixedProject(CProject):
    """Gaits in whole numbers as files of C."""

    header, parts = 'fixed.h', ('fixed',)

    def __init__(self, data: FixedData, title: str) -> None:
        """Take gaits; a tick has one part."""
        super().__init__(data, title, 1.0 / data.rate)
        self._fixed = data

    @property
    def ram(self) -> int:
        """Memory of a struct cpg, bytes, to which come a few of padding."""
        return 4 * len(self.data.robot.joints) + 2 * 13 + 2 * 10 + 27

    def _sizes(self) -> dict[str, object]:
        return self._fixed.defines()

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

"""Buono & Golubitsky (2001): the six primary gaits, Tables 1, 2, 4 and 13, section 7, Figure 2.

Phases are measured on simulations of all eight cells that start off the gait and run free of any
lock; they are not prescribed to a solver.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from fractions import Fraction

from cpg_ros.analysis.papers.rhythm import (
    cell_constants,
    disturbed_start,
    primary_gaits,
    Rhythm,
    rhythm,
)
from cpg_ros.analysis.papers.row import Citation, Picture, ReproducedRow, trajectories
from cpg_ros.dynamics.floquet import multipliers
from cpg_ros.dynamics.solve_orbit import solve_orbit
from cpg_ros.networks.library.quadruped import Quadruped
from cpg_ros.networks.symmetry import label, Z4_Z2
import numpy as np

AUTHORS = 'Buono & Golubitsky 2001'
#: Periods in which a disturbed gait settles, and those usually enough.
SETTLING = {'jump': 150.0}
USUALLY = 60.0
#: Periods in which a wave turns round.
REVERSAL = 150.0

#: Table 13: alpha, beta, gamma, delta.
TABLE_13 = {'pronk': ('0.2', '0.2', '0.2', '0.2'), 'pace': ('0.2', '0.2', '-0.2', '-0.2'),
            'bound': ('-0.2', '-0.2', '0.2', '0.2'), 'trot': ('-0.6', '-0.6', '-0.6', '-0.6'),
            'jump': ('0.01', '-0.01', '0.2', '0.2'), 'walk': ('0.01', '-0.01', '-1.2', '-1.2')}
#: Table 1: t + ... of u_1 in cells 1 to 4.
TABLE_1 = {'walk': '0 1/2 1/4 3/4', 'trot': '0 1/2 1/2 0', 'pace': '0 1/2 0 1/2',
           'jump': '1/4 1/4 0 0', 'bound': '0 0 1/2 1/2', 'pronk': '0 0 0 0'}
LEGS = ('LH', 'RH', 'LF', 'RF')
#: Table 2: shifts of omega and kappa.
TABLE_2 = {'pronk': ('0', '0'), 'pace': ('0', '1/2'), 'bound': ('1/2', '0'),
           'trot': ('1/2', '1/2'), 'jump': ('1/4', '0'), 'walk': ('1/4', '1/2')}
#: Section 7: phase between the two cells of a leg. 'Reversed' in the criss-cross network.
SECTION_7 = {'zig-zag': {'walk': '1/2', 'jump': '1/2', 'pronk': '0', 'pace': '0', 'bound': '0',
                         'trot': '0'},
             'criss-cross': {'walk': '0', 'jump': '0', 'pronk': '1/2', 'pace': '1/2',
                             'bound': '1/2', 'trot': '1/2'}}
#: Cells (from 1) that share the left hind leg in Table 4.
LEFT_HIND = {'zig-zag': (1, 5), 'criss-cross': (1, 6)}
#: Erratum 9: gaits that are not as that section says of the criss-cross network, but thus.
NOT_REVERSED = {'pronk': '0', 'bound': '0', 'jump': '1/2'}
#: Constants of section 6, the current apart, which only shows together with gL vL.
SECTION_6 = {'phi': '0.2', 'v1': '0.2', 'v2': '0.4', 'v3': '0.3', 'v4': '0.2', 'gCa': '3',
             'gL': '0.6', 'gK': '1.8', 'vL': '-1.8', 'vK': '-0.8'}
CURRENT = '1'


@dataclass(frozen=True)
class SolvedGait:
    """A gait of Table 13 in the network: as it was found by simulation."""

    name: str
    network: Quadruped
    seen: Rhythm

    @property
    def phases(self) -> np.ndarray:
        """Of the eight cells against cell 1, cycles."""
        return self.seen.found.phases


def settled(name: str) -> SolvedGait:
    """Simulate a gait of Table 13 from near its orbit, with every cell disturbed."""
    network = Quadruped(*(float(value) for value in TABLE_13[name]))
    preset = Quadruped.presets()[name]
    span = SETTLING.get(name, USUALLY) * preset.period
    return SolvedGait(name, network, rhythm(network, disturbed_start(preset), span, Z4_Z2,
                                            primary_gaits(variables=2)))


def _table_13(gait: SolvedGait) -> Iterator[ReproducedRow]:
    at, name = Citation(AUTHORS, 'Table 13'), gait.name
    yield at.word('gait that is found with the couplings ' + ', '.join(TABLE_13[name]), name,
                  gait.seen.kind, note=f'period {gait.seen.found.period:.4f}; phases measured')
    yield at.stable(f'the {name} that is found',
                    multipliers(solve_orbit(gait.network, name)).leading)


def _table_1(gait: SolvedGait) -> Iterator[ReproducedRow]:
    at, name = Citation(AUTHORS, 'Table 1'), gait.name
    printed = [Fraction(part) for part in TABLE_1[name].split()]
    for cell in range(1, 4):
        wrong = name == 'walk' and cell >= 2
        yield at.phases(f'{name}: phase of u_{cell + 1} ({LEGS[cell]}) against u_1 (LH)',
                        str((printed[cell] - printed[0]) % 1), [gait.phases[cell]],
                        erratum=(10, ('3/4', '1/4')[cell - 2]) if wrong else None)


def _reversed(gait: SolvedGait) -> ReproducedRow:
    """Start the walk as Table 1 has it, with the wave run the other way, and see what lasts."""
    preset = Quadruped.presets()[gait.name]
    start = np.array(preset.start).reshape(2, -1)[:, [0, 1, 6, 7, 4, 5, 2, 3]]
    seen = rhythm(gait.network, start.ravel(), REVERSAL * preset.period, Z4_Z2,
                  primary_gaits(variables=2))
    return Citation(AUTHORS, 'Table 1').phases(
        'walk started with u_3(t) = u_1(t + 1/4): phase of u_3 (LF) in the end', '1/4',
        [seen.found.phases[2]], erratum=(10, '3/4'))


def _table_2(gait: SolvedGait) -> Iterator[ReproducedRow]:
    at, name = Citation(AUTHORS, 'Table 2'), gait.name
    how = 'with gamma U(t) = U(t - theta) as in eqs. 2.1 and 3.1'
    for symbol, cell, printed in zip(('omega', 'kappa'), (2, 1), TABLE_2[name], strict=True):
        yield at.phases(f'{name}: phase shift of {symbol}', printed, [-gait.phases[cell] % 1.0],
                        note=f'u_{cell + 1}(t) = u_1(t - theta), {how}')


def _section_7(gait: SolvedGait) -> Iterator[ReproducedRow]:
    at, name = Citation(AUTHORS, 'section 7'), gait.name
    for assignment, (first, second) in LEFT_HIND.items():
        wrong = assignment == 'criss-cross' and name in NOT_REVERSED
        yield at.phases(f'{name}: phase between the two cells of a leg, {assignment} network',
                        SECTION_7[assignment][name],
                        [gait.phases[second - 1] - gait.phases[first - 1]],
                        erratum=(9, NOT_REVERSED[name]) if wrong else None,
                        note=f'cells {first} and {second}')


def _figure_2(gait: SolvedGait) -> Iterator[ReproducedRow | Picture]:
    order = ' '.join(f'u_{cell + 1}' for cell in np.argsort(-gait.phases[:4] % 1.0,
                                                            kind='stable'))
    where = 'top' if gait.name == 'walk' else 'bottom'
    if gait.name == 'walk':
        yield Citation(AUTHORS, 'Figure 2').word('order in which the cells peak in the walk',
                                                 'u_1 u_3 u_2 u_4', order)
    run, period = gait.seen.run, gait.seen.found.period
    drawn = run.t >= run.t[-1] - 4.0 * period
    cells = gait.network.cells
    yield Picture(AUTHORS, f'Figure 2, {where}', f'The {gait.name} of Table 13, four periods.',
                  trajectories(f'{AUTHORS}, Figure 2, {where}: {gait.name}',
                               run.t[drawn] - run.t[drawn][0], run.x[drawn, :cells][:, :4],
                               [f'$u_{cell + 1}$ ({leg})' for cell, leg in enumerate(LEGS)],
                               variable='v'))


def _gaits(*names: str) -> Iterator[ReproducedRow | Picture]:
    for name in names:
        gait = settled(name)
        for part in (_table_1, _table_2, _table_13, _section_7):
            yield from part(gait)
        if name == 'walk':
            yield _reversed(gait)
        if name in ('walk', 'trot'):
            yield from _figure_2(gait)
        if name == 'trot':
            at = Citation(AUTHORS, 'section 2.1')
            h, k = gait.seen.found.h, gait.seen.found.k
            yield at.number('order of H of the trot, Z4 x Z2', '8', len(h))
            yield at.word('K of the trot is generated by', '<omega kappa>', label(Z4_Z2, k))
            yield at.number('order of K of the trot, Z2(omega kappa)', '2', len(k),
                            erratum=(14, '4'))


def fast_gaits() -> Iterator[ReproducedRow | Picture]:
    """Pronk, pace, bound and jump."""
    return _gaits('pronk', 'pace', 'bound', 'jump')


def slow_gaits() -> Iterator[ReproducedRow | Picture]:
    """Walk and trot."""
    return _gaits('walk', 'trot')


def constants() -> Iterator[ReproducedRow | Picture]:
    """Yield the cell of section 6, read off the compiled rates."""
    at = Citation(AUTHORS, 'section 6')
    found = cell_constants(Quadruped(0.0, 0.0, 0.0, 0.0), float(CURRENT))
    for name, printed in SECTION_6.items():
        yield at.number(name, printed, found[name], within=1e-8,
                        note=f'read off the compiled rates, with i = {CURRENT}')
    yield at.formula('tau ten widths v4 from v3, over its least', 'cosh(5)', np.cosh(5.0),
                     found['tau_far'])

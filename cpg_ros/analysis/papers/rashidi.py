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

"""Rashidi, Noorani & Shoaran (2016), Optimization of coupling weights in a 4-cell CPG network."""

from collections.abc import Iterator
from functools import cache
from importlib.util import find_spec
from typing import cast

from cpg_ros.analysis.nsga2 import Epoch, evolve, non_dominated, SearchSetup
from cpg_ros.analysis.objectives import evaluate
from cpg_ros.analysis.papers.row import (
    cell_constants,
    Citation,
    disturbed_start,
    Paper,
    PHASE_TOLERANCE,
    Picture,
    printed_values,
    ReproducedRow,
    Rhythm,
    rhythm,
    trajectories,
)
from cpg_ros.dynamics.floquet import multipliers
from cpg_ros.dynamics.solve_orbit import solve_orbit
from cpg_ros.fitting.gaits.recognition import lag, shape_difference
from cpg_ros.networks.library.biped import Biped, GAITS, PRIMARY
from cpg_ros.networks.symmetry import admissible_pairs, D2, Symmetry
import numpy as np
from scipy.integrate import solve_ivp

AUTHORS = 'Rashidi et al. 2016'
NAMES = ('left flexor', 'right flexor', 'left extensor', 'right extensor')

PRINTED = printed_values('rashidi')
#: Model time in which a gait settles; objective that counts as 0, degrees.
SETTLING, OBJECTIVE_TOLERANCE = 1500.0, 1.0
#: Difference in shape, over the RMS, up to which two waveforms are one.
SIGNAL_TOLERANCE = 0.02
#: POPULATION, GENERATIONS: of the search; the paper prints none.
POPULATION, GENERATIONS = 24, 4


@cache
def simulated(network: Biped, start: tuple[float, ...]) -> Rhythm:
    """Simulate from a state until the gait has settled."""
    return rhythm(network, start, SETTLING, D2,
                  {gait: Symmetry.of(D2, shifts) for gait, shifts in GAITS.items()})


def disturbed(gait: str) -> tuple[float, ...]:
    """Return a state near the orbit of a shipped preset, every variable disturbed."""
    return tuple(disturbed_start(Biped.presets()[gait]).tolist())


def named(gait: str) -> str:
    """Return a gait's name as the paper writes it."""
    return gait.replace('_legged', '-legged').replace('_', ' ')


def printed(gait: str) -> Biped:
    """Return the network with a row of Table 2."""
    return Biped.symmetric(*PRINTED['table_2'][gait])


def settled(gait: str) -> Rhythm:
    """Return a gait: primary ones by Table 2, the others by the shipped presets."""
    return simulated(printed(gait), disturbed(gait)) if gait in PRIMARY else after(gait, gait)


def after(before: str, gait: str) -> Rhythm:
    """Return what the weights of a shipped preset make of a gait."""
    return simulated(cast(Biped, Biped.presets()[gait].network), disturbed(before))


def signals(result: Rhythm) -> list[str]:
    """Name the cells' signals as Table 5 does: y1 and y2 for waveforms, +0.5 for a shift.

    Measured on the mean cycle: cells whose waveforms agree after the best shift have one name.
    """
    cycle = result.cycle.signals[:, :4]
    first: list[int] = []
    names = []
    for cell in range(4):
        like = next((n for n, other in enumerate(first)
                     if shape_difference(cycle[:, cell], cycle[:, other]) < SIGNAL_TOLERANCE
                     ), None)
        if like is None:
            first.append(cell)
            names.append(f'y{len(first)}')
            continue
        shift = float(lag(cycle[:, cell], cycle[:, first[like]])) % 1.0
        half = round(2.0 * shift) / 2.0 % 1.0
        exact = abs((shift - half + 0.5) % 1.0 - 0.5) <= PHASE_TOLERANCE
        shown = half if exact else round(shift, 3)
        names.append(f'y{like + 1}' + (f'+{shown:g}' if shown else ''))
    return names


def _written(elements: tuple[str, ...]) -> str:
    """Return a subgroup of D2 as Table 5 writes it."""
    others = [name for name in elements if name != '1']
    return 'D' if len(others) == 3 else others[0].replace(' ', '-') if others else 'I'


def cell() -> Iterator[ReproducedRow | Picture]:
    """Table 1, and equations 1 and 2."""
    network = printed('walk')
    values = cell_constants(network, network.current)
    at = Citation(AUTHORS, 'Table 1')
    for name, value in PRINTED['table_1'].items():
        yield at.number(name, value, values[name], within=1e-8, note='read off the compiled rates')
    yield Citation(AUTHORS, 'eq. 2').formula('tau ten widths V4 from V3, over its least',
                                             '(1 + cosh(5))/2', {}, values['tau_far'])
    at = Citation(AUTHORS, 'eq. 1')
    yield at.holds("the walk's cells oscillate with u' = -phi tau(v) (n(v) - u), as printed",
                   _oscillates(-1.0), erratum=8, note='u runs away')
    yield at.holds("they do with u' = phi tau(v) (n(v) - u)", _oscillates(1.0))


def _oscillates(sign: float) -> bool:
    """Return whether Table 2's walk still oscillates after 300, u' being multiplied by a sign."""
    network = printed('walk')

    def rates(_: float, x: np.ndarray) -> np.ndarray:
        return np.concatenate([network.rates(x)[:4], sign * network.rates(x)[4:]])

    def far(_: float, x: np.ndarray) -> float:
        return 10.0 - float(np.abs(x).max())

    far.terminal = True  # type: ignore[attr-defined]
    # A step that ends far out may pass through numbers that are no longer finite.
    with np.errstate(over='ignore', invalid='ignore'):
        run = solve_ivp(rates, (0.0, 300.0), np.ravel(PRINTED['table_3']['walk']), events=far,
                        max_step=0.5)
    return bool(run.t[-1] >= 300.0 and np.ptp(run.y[0, run.t > 250.0]) > 0.1)


def primary() -> Iterator[ReproducedRow | Picture]:
    """Tables 2, 3 and 5, Figures 2 to 6, equations 6 to 9: the four primary gaits."""
    for gait in PRIMARY:
        result, figure = settled(gait), PRINTED['figures'][gait]
        name, phases = named(gait), result.end.phases
        at = Citation(AUTHORS, 'Table 2')
        yield at.word('gait with I, phi and w_a, w_b, w_c of the ' + name, name,
                      named(result.gait), note=f'period {result.cycle.period:.4f}')
        yield at.stable(f'the {name} attracts',
                        multipliers(solve_orbit(printed(gait), gait)).leading)
        at = Citation(AUTHORS, 'Figure 2')
        for text, cell_a, cell_b, value in (
                ('right against left flexor', 1, 0, PRINTED['figure_2'][gait][0]),
                ('right against left extensor', 3, 2, PRINTED['figure_2'][gait][0]),
                ('left extensor against flexor', 2, 0, PRINTED['figure_2'][gait][1]),
                ('right extensor against flexor', 3, 1, PRINTED['figure_2'][gait][1])):
            yield at.phases(f'{name}: {text}', value, [phases[cell_a] - phases[cell_b]])
        equation, expected = PRINTED['equations'][gait]
        for n, (degrees, phase) in enumerate(zip(expected, phases[1:], strict=True), 1):
            off = abs((360.0 * phase - degrees + 180.0) % 360.0 - 180.0)
            yield Citation(AUTHORS, equation).number(
                f'objective z_{n} of the {name} [degrees], which is to vanish', '0.00', off,
                within=OBJECTIVE_TOLERANCE, erratum=(8, '180'),
                note=f'phase of cell {n + 1} {360.0 * phase:.2f}')
        yield from _table_5(gait, result)
        start = simulated(printed(gait), tuple(np.ravel(PRINTED['table_3'][gait]).tolist()))
        yield Citation(AUTHORS, 'Table 3').word(
            f'gait from the initial values of the {name}', name, named(start.gait),
            note=PRINTED['odd'].get(gait, ''))
        yield _drawn(f'Figure {figure}', name, start, 'From the initial values of Table 3.')


def search() -> Iterator[ReproducedRow | Picture]:
    """Section 4: NSGA-II with the printed operators and objectives, which needs pymoo."""
    if find_spec('pymoo') is None:
        return
    at = Citation(AUTHORS, 'section 4')
    for gait in PRIMARY:
        current, phi, *_ = PRINTED['table_2'][gait]
        setup = SearchSetup('biped', gait, {}, {'current': current, 'phi': phi}, paper=True)
        tried = evolve(Epoch(setup, POPULATION, GENERATIONS, 0, 0)).tried
        front = np.array([score.errors for score in non_dominated(list(tried), 3)])
        ranges = ', '.join(f'{low:.2f} to {high:.2f}' for low, high in
                           zip(front.min(axis=0), front.max(axis=0), strict=True))
        theirs = evaluate([printed(gait)], gait, 0, 0)[0].errors
        yield at.number(
            f'largest objective of the best set that the search finds for the {named(gait)} '
            '[degrees]', '0.00', float(front.max(axis=1).min()), within=OBJECTIVE_TOLERANCE,
            note=f'z_1 to z_3 of its front of {len(front)} sets, of {len(tried)} tried: {ranges}; '
            'population and generations are ours')
        yield at.holds(
            f'no set that the search finds dominates the weights of Table 2, {named(gait)}',
            not ((front <= theirs + OBJECTIVE_TOLERANCE).all(axis=1)
                 & (front < theirs - OBJECTIVE_TOLERANCE).any(axis=1)).any(),
            note=f'z_1 to z_3 with these {", ".join(f"{error:.2f}" for error in theirs)}')


def _table_5(gait: str, result: Rhythm) -> Iterator[ReproducedRow]:
    at, name = Citation(AUTHORS, 'Table 5'), named(gait)
    h, k, response = PRINTED['table_5'][gait]
    yield at.word(f'H of the {name}', h, _written(result.end.h))
    yield at.word(f'K of the {name}', k, _written(result.end.k))
    yield at.word(f'signals of cells 1 to 4 in the {name}', response,
                  f'({", ".join(signals(result))})')


def _drawn(figure: str, name: str, result: Rhythm, caption: str) -> Picture:
    run = result.run
    late = run.t >= run.t[-1] - 5.0 * result.cycle.period
    shapes = [int(signal[1]) - 1 for signal in signals(result)]
    return Picture(AUTHORS, figure, caption, trajectories(
        f'{AUTHORS}, {figure}: {name}', run.t[late] - run.t[late][0], run.x[late, :4], NAMES,
        shapes, variable='v'))


def secondary() -> Iterator[ReproducedRow | Picture]:
    """Tables 4 and 5, Figures 8 to 11: the secondary gaits. Their weights are not printed."""
    for gait in PRINTED['table_4']:
        result, name = settled(gait), named(gait)
        one, two, three, four = signals(result)
        yield Citation(AUTHORS, 'Table 4').word(
            f'signals in the {name}, left and right leg', PRINTED['table_4'][gait],
            f'({one}, {three}), ({two}, {four})', note='weights are ours: none are printed')
        if gait in PRINTED['table_5']:
            yield from _table_5(gait, result)
        if gait in PRINTED['not_reached']:
            roots = multipliers(solve_orbit(Biped.presets()[gait].network, gait))
            reached = result.gait == gait and roots.attracts
            yield Citation(AUTHORS, 'section 5').word(
                f'the {name} in this network', 'not reached',
                'reached' if reached else 'not reached', erratum=(18, 'reached'),
                note=f'leading Floquet multiplier {roots.leading:.3g} a cycle')
    for number, (before, gait) in PRINTED['transitions'].items():
        result = after(before, gait)
        yield Citation(AUTHORS, f'Figure {number}').word(
            f'gait that follows the {named(before)} with other weights', named(gait),
            named(result.gait), note='weights are ours: none are printed')
        yield _drawn(f'Figure {number}', f'{named(gait)}, from the {named(before)}', result,
                     'With weights of ours, as the paper prints none; settled.')


def predicted() -> Iterator[ReproducedRow | Picture]:
    """Section 5: which gait a primary one can break into, and the two transitions predicted."""
    at = Citation(AUTHORS, 'section 5')
    for before, gait in (*PRINTED['transitions'].values(), *PRINTED['predicted']):
        whole = D2.generated(GAITS[before])
        h = {name: shift for name, shift in D2.generated(GAITS[gait]).items() if name != '1'}
        yield at.holds(f'the {named(gait)} keeps symmetries of the {named(before)}, and no others',
                       bool(h) and all(whole[name] == shift for name, shift in h.items()),
                       note=', '.join(f'{name} by {shift}' for name, shift in h.items()))
    for before, gait in PRINTED['predicted']:
        result = after(before, gait)
        note = 'weights are ours: none are printed'
        yield at.word(f'gait that follows the {named(before)}, as predicted', named(gait),
                      named(result.gait), note=note)
        yield at.word(f'the {named(gait)} by way of the {named(before)}', 'not reached',
                      'reached' if result.gait == gait else 'not reached', erratum=(26, 'reached'),
                      note=note)


def kinds() -> Iterator[ReproducedRow | Picture]:
    """Compute section 5's eleven kinds of rhythm, and Table 5's H and K."""
    at = Citation(AUTHORS, 'section 5')
    waveforms = [pair.waveforms for pair in admissible_pairs(D2)]
    yield at.number('kinds of rhythm that D2 allows', '11', len(waveforms))
    for count, number, what in (('4', 1, 'one waveform'), ('6', 2, 'two waveforms'),
                                ('1', 4, 'four waveforms')):
        yield at.number(f'of these with {what}', count, waveforms.count(number))
    gaits = [gait for gait in GAITS if settled(gait).gait == gait]
    printed = str(len(PRINTED['table_5']))
    yield Citation(AUTHORS, 'Table 5').number('gaits of the paper with their H and K', printed,
                                              len(gaits), erratum=(11, '9'))
    in_phase = [gait for gait in gaits if gait not in PRIMARY and len(settled(gait).end.k) > 1]
    yield at.holds('cells are equal at all times in primary gaits only', not in_phase,
                   erratum=11, note='they are in: ' + ', '.join(map(named, in_phase)))
    walk = settled('walk').end
    for letter, elements, wrong, right in (('K', walk.k, 'spatio-temporal', 'spatial'),
                                           ('H', walk.h, 'spatial', 'spatio-temporal')):
        # On the elements the walk's best shifts: all of them 0, or not.
        h = max(abs((walk.distances[name][0] + 0.5) % 1.0 - 0.5) for name in elements)
        yield Citation(AUTHORS, 'Table 5').word(
            f'the symmetries in {letter} are', wrong,
            'spatio-temporal' if h > PHASE_TOLERANCE else 'spatial', erratum=(17, right))


PAPER = Paper('rashidi', AUTHORS,
              'S. F. Rashidi, M. S. Noorani, M. Shoaran: Optimization of coupling weights in a '
              '4-cell central pattern generator network for bipedal locomotion gait generation '
              '(2016)', (cell, primary, search, secondary, predicted, kinds))

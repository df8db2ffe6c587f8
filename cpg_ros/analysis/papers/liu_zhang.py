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

"""Liu & Zhang (2024), A neural network model for goat gait: the delayed network."""

import cmath
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import partial

from cpg_ros.analysis.papers.row import (
    Citation,
    Paper,
    Picture,
    primary_gaits,
    printed_values,
    ReproducedRow,
    rhythm,
    trajectories,
)
from cpg_ros.dynamics.arclength import NoOrbit
from cpg_ros.dynamics.floquet import multipliers
from cpg_ros.dynamics.hopf import first_hopf, HopfPoint, NormalForm
from cpg_ros.dynamics.isotypic import Expansion
from cpg_ros.dynamics.solve_orbit import solve_orbit
from cpg_ros.fitting.inversion.paper_fit import cycle_samples, CycleFit, fit_cycle
from cpg_ros.networks.library.delayed import Delayed
from cpg_ros.networks.symmetry import Z4_Z2
import numpy as np

# Liu & Zhang (2024), section 2: the Taylor terms F_2 and F_3 of the delayed network.

AUTHORS = 'Liu & Zhang 2024'
#: PREDECESSORS: cell, from 1, behind each cell on the same side, whose cube is in its row of F_3.
PREDECESSORS = (7, 8, 3, 2, 3, 4, 5, 6)
#: Erratum 25: in the third row it should be this cell.
THIRD_PREDECESSOR = 1


def taylor_terms() -> Iterator[ReproducedRow | Picture]:
    """F_2 and F_3 as printed after eq. 2.2."""
    at = Citation(AUTHORS, 'section 2')
    network = Delayed.presets()['liu2024_walk'].network
    assert isinstance(network, Delayed)
    rng = np.random.default_rng(2024)
    now, past, mu = rng.uniform(-1.0, 1.0, 8), rng.uniform(-1.0, 1.0, 8), 0.3
    a, b, c, d, tau = network.as_dict().values()
    expansion, across = Expansion(network, np.zeros(1)), np.arange(8) ^ 1

    def cubes(cell: int, behind: int) -> float:
        """Return a row of F_3 as printed, with some cell behind."""
        return -tau / 3.0 * (b * now[cell]**3 + d * now[behind - 1]**3 + c * past[across[cell]]**3)

    third = tau * expansion.multilinear(*[(now, past)] * 3).real
    for cell, behind in enumerate(PREDECESSORS):
        value, wrong = cubes(cell, behind), cell == 2
        yield at.formula(f'row {cell + 1} of F_3 as printed, and of F_3/3!',
                         f'-tau/3 (b phi_{cell + 1}^3 + d phi_{behind}^3 + '
                         f'c phi_{across[cell] + 1}^3(-1))', value, float(third[cell]) / 6.0,
                         erratum=(25, cubes(cell, THIRD_PREDECESSOR)) if wrong else None)
    yield at.formula('row 1 of F_3, where F = F_2/2! + F_3/3!', 'as printed', cubes(0, 7),
                     float(third[0]), erratum=(25, 6.0 * cubes(0, 7)))
    # (tau + mu) L phi has mu L phi as its second-order part in (mu, phi): half of F_2.
    linear = network.jacobian(np.zeros(8)) @ now
    delayed = network.rates(np.zeros(8), 1e-6 * past) / 1e-6
    second = mu * float((linear + delayed)[0])
    value = mu * ((a + b) * now[0] + d * now[6] + c * past[1])
    yield at.formula('row 1 of F_2, where F = F_2/2! + F_3/3!', 'as printed', value, 2.0 * second,
                     erratum=(25, 2.0 * value))


# The normal form as Liu & Zhang (2024) print it, section 2; erratum 1.

def published_normal_form(point: HopfPoint) -> NormalForm:
    """Return the normal form by the printed formulas, at a Hopf point of the delayed network.

    ``D = 1/(8 (-1 + c e))``, ``k1 = 8 D (-a - b - d + c e)``, ``k2 = -8 tau D (-b + c e - d)``
    with e = exp(i omega tau), whatever the mode.
    """
    a, b, c, d, tau = point.network.as_dict().values()
    past = c * cmath.exp(1j * point.omega * tau)
    eight = 1.0 / (-1.0 + past)
    return NormalForm(eight * (-a - b - d + past), -tau * eight * (-b + past - d))


#: Model times in which a gait develops, and which is drawn.
TRANSIENT_TIME, FIGURE_TIME = 120.0, 20.0
#: Start values printed under Figures 3 and 4.
START_VALUES = (0.1, -0.1, 0.2, -0.2, 0.1, -0.1, 0.2, -0.2)


@dataclass(frozen=True)
class Example:
    """A published gait: its parameters and the printed results.

    Attributes:
        section: in the paper.
        gait: according to the paper.
        network: the parameters.
        start: values under its figure.
        figure: number.
        numbers: omega, tau, k1, k2, k1 k2; a number that is not printed is missing.
        names: of omega and tau there.
        corrected: numbers that are right where those are not, by their name.
        wrong_start: erratum of the start values and the gait they lead to, or None.

    """

    section: str
    gait: str
    network: Delayed
    start: tuple[float, ...]
    figure: int
    numbers: dict[str, str]
    names: tuple[str, str]
    corrected: dict[str, tuple[int, str]]
    wrong_start: tuple[int, str] | None = None


PRINTED = printed_values('liu_zhang')
EXAMPLES = {name: Example(network=Delayed(*parameters), **example) for name, (parameters, example)
            in PRINTED['examples'].items()}
SOLUTIONS = {'c': '6.4300', 'tau': '0.2450'}
#: Samples of a cycle; RMS of the noise that makes a recording of the orbit.
NUM_SAMPLES, NOISE_RMS = 20, 0.35
#: Difference between the minima that different starts reach.
MINIMUM_TOLERANCE = 1e-4


def _coefficients(example: Example, point: HopfPoint) -> Iterator[ReproducedRow]:
    """Yield the normal form: by the formula that is printed, and by the right one."""
    at = Citation(AUTHORS, example.section)
    printed, right = published_normal_form(point), point.in_delays
    for name, wrong_value, value in (
            ('k1', printed.k1.real, right.k1.real), ('k2', printed.k2.real, right.k2.real),
            ('k1 k2', printed.k1.real * printed.k2.real, right.k1.real * right.k2.real)):
        number = example.numbers[name]
        # One is printed as '1' beside numbers of four decimals.
        within = 5e-5 if '.' not in number else None
        yield at.number(f'{name} of the {example.gait}, by the printed formula', number,
                        wrong_value, within=within, note='D = 1/(8 (-1 + c e)) as in section 2')
        yield at.number(f'{name} of the {example.gait}', number, value, within=within,
                        erratum=example.corrected[name],
                        note='with q = 1 + tau B exp(-i omega tau) and the mode of the gait')


def published_gait(name: str) -> Iterator[ReproducedRow | Picture]:
    """Compute the rows of one of EXAMPLES."""
    example = EXAMPLES[name]
    network, gait = example.network, example.gait
    at = Citation(AUTHORS, example.section)
    point = first_hopf(network, gait)
    if point is None:
        raise NoOrbit(f'{example.section}: no Hopf point of the {gait}')
    for name, symbol, value in (('omega', example.names[0], point.omega),
                                ('tau', example.names[1], point.value)):
        if name in example.numbers:
            yield at.number(f'{symbol} of the {gait}', example.numbers[name], value,
                            erratum=example.corrected.get(name))
    yield from _coefficients(example, point)
    k1, k2 = point.in_delays.k1.real, point.in_delays.k2.real
    yield at.word(f'direction of the bifurcation to the {gait}', 'supercritical',
                  'supercritical' if k1 * k2 < 0.0 else 'subcritical', note='theorem 2.1')
    yield at.holds(f'k1 > 0 for the {gait}', k1 > 0.0)
    yield at.holds(f'tau {network.tau:g} is above the critical delay of the {gait}',
                   network.tau > point.value)
    yield at.word(f'{gait} near its onset, on the centre manifold', 'stable',
                  'stable' if k2 < 0.0 else 'unstable', note='theorem 2.1')
    roots = point.unstable_transverse_roots
    yield at.word(
        f'{gait} near its onset, in the full network', 'stable',
        'unstable' if roots else 'stable', erratum=(3, 'unstable'),
        note=f'roots of the rest state with positive real part outside the class of the gait: '
             f'{roots}')
    spectrum = multipliers(solve_orbit(network, gait))
    yield at.stable(f'{gait} at tau {network.tau:g}, within its symmetry class',
                    spectrum.leading_within)
    yield at.stable(f'{gait} at tau {network.tau:g}, in the full network',
                    spectrum.leading_transverse, erratum=3, which='leading transverse')
    yield from _simulated(example)


def _simulated(example: Example) -> Iterator[ReproducedRow | Picture]:
    """Yield the gait that the printed start values lead to."""
    gait, figure = example.gait, f'Figure {example.figure}'
    at = Citation(AUTHORS, figure)
    gaits = primary_gaits(variables=1)
    result = rhythm(example.network, example.start, TRANSIENT_TIME, Z4_Z2, gaits)
    phases = f'phases of cells 1 to 4: {np.round(result.end.phases[:4], 4) % 1.0}'
    yield at.word('gait that the printed start values lead to', gait, result.kind,
                  erratum=example.wrong_start, note=phases)
    caption = f'From the printed start values: {result.kind}.'
    if example.wrong_start:
        result = rhythm(example.network, START_VALUES, TRANSIENT_TIME, Z4_Z2, gaits)
        yield at.word('gait that the start values of Figures 3 and 4 lead to', gait, result.kind,
                      note='0.1, -0.1, 0.2, -0.2, 0.1, -0.1, 0.2, -0.2')
        caption = (f'From the start values of Figure 3, as those printed lead to another gait '
                   f'(erratum {example.wrong_start[0]}): {result.kind}.')
    if example.gait == 'walk':
        # + : cell 3, of LF, leads cell 1, of LH, by a quarter.
        sense = {'walk-': 'walk', 'walk+': 'diagonal-sequence walk'}.get(result.gait, result.gait)
        yield at.word('walk as quadrupeds walk: LH, LF, RH, RF', 'walk', sense,
                      erratum=(7, 'diagonal-sequence walk'), note=phases)
    drawn = result.run.t <= FIGURE_TIME
    yield Picture(AUTHORS, figure, caption, trajectories(
        f'{AUTHORS}, {figure}: {result.kind}, tau {example.network.tau:g}', result.run.t[drawn],
        result.run.x[drawn, :4], ('$x_1$ (LH)', '$x_2$ (RH)', '$x_3$ (LF)', '$x_4$ (RF)')))


def conditions() -> Iterator[ReproducedRow | Picture]:
    """(H1) and (H2), the conditions of the bifurcations."""
    for example, name, key, sign in (('Example 1', 'H1', 'walk', 1.0),
                                     ('Example 2', 'H2', 'pace', -1.0)):
        a, b, c, d, _ = EXAMPLES[key].network.as_dict().values()
        yield Citation(AUTHORS, example).holds(
            f'the parameters satisfy ({name})',
            sign * (a + b) * d > 0.0 and abs(c) > abs(a + b + sign * d))


def recording(example: Example, name: str) -> tuple[np.ndarray, np.ndarray]:
    """Make up a recording of one cycle whose best fit is known to be the example's parameters.

    To the orbit a fixed misfit is added that does not depend on the parameter to first order,
    so that the orbit stays the best fit though none is perfect.

    Returns:
        Samples, shape (SAMPLES, 8), and their times in cycles, shape (SAMPLES,).

    """
    theta = np.arange(NUM_SAMPLES) / NUM_SAMPLES
    states, slopes = cycle_samples(solve_orbit(example.network, example.gait), theta)
    slope = slopes[..., example.network.parameters().index(name)]
    misfit = NOISE_RMS * np.random.default_rng(0).standard_normal(states.shape)
    misfit -= slope * np.sum(misfit * slope) / np.sum(slope * slope)
    return states + misfit, theta


def inversion(number: int, key: str, name: str) -> Iterator[ReproducedRow | Picture]:
    """Compute Table 1, c of the trot, or Table 2, tau of the walk."""
    at, example = Citation(AUTHORS, f'Table {number}'), EXAMPLES[key]
    starts = PRINTED[f'table_{number}']
    samples, theta = recording(example, name)

    def fitted(start: float) -> CycleFit:
        return fit_cycle(samples, theta, replace(example.network, **{name: start}),
                         example.gait, [name])

    fits = {start: fitted(float(start)) for start in starts}
    for start, fit in fits.items():
        yield at.number(
            f'{name} from the start {start}', SOLUTIONS[name], float(fit.values[0]),
            note=f'made-up recording (erratum 5); {fit.trial.evaluations} orbits solved, where '
                 f'{starts[start]} iterations are printed; error f {fit.cost:.4f}')
    values = np.array([fit.values[0] for fit in fits.values()])
    best = fitted(getattr(example.network, name))
    yield at.holds(f'every start reaches one minimum of f by {name}',
                   bool(np.ptp([*values, best.values[0]]) <= MINIMUM_TOLERANCE),
                   note=f'to {MINIMUM_TOLERANCE:g}, and the one that is reached from the truth')
    yield at.holds('every start reaches the same error f',
                   bool(np.ptp([fit.cost for fit in fits.values()]) <= MINIMUM_TOLERANCE))


PAPER = Paper('liu_zhang', AUTHORS,
              'L. Liu, C. Zhang: A neural network model for goat gait (2024)',
              (conditions, taylor_terms, *(partial(published_gait, name) for name in EXAMPLES),
               partial(inversion, 1, 'goat_trot', 'c'), partial(inversion, 2, 'goat_walk', 'tau')))

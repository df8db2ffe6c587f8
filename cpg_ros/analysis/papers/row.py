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

"""Quantities as a paper prints them beside the computed ones, and simulations to compute them."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from decimal import Decimal
from fractions import Fraction
from functools import cache
from pathlib import Path
import re
from typing import Any, TYPE_CHECKING

from cpg_ros.common.errors import InputError
from cpg_ros.dynamics.floquet import stable, VERDICTS
from cpg_ros.dynamics.integration.simulate import simulate, Trajectory
from cpg_ros.dynamics.settling import last_cycle, LimitCycle
from cpg_ros.fitting.gaits.recognition import recognise, Recognition
from cpg_ros.networks.library.biped import Biped
from cpg_ros.networks.library.quadruped import Quadruped
from cpg_ros.networks.network import Network, Preset
from cpg_ros.networks.symmetry import Group, Symmetry, Z4_Z2
import numpy as np
import yaml

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# Figures of the papers: the cells over time.

#: Colours of the waveforms, as in the other pictures.
WAVES = ('#2b6cb0', '#c05621', '#2f855a', '#6b46c1')


def trajectories(title: str, t: np.ndarray, x: np.ndarray, names: Sequence[str],
                 waves: Sequence[int] | None = None, variable: str = 'x') -> 'Figure':
    """Draw cells over time, one under the other.

    Args:
        title: paper and number of the figure.
        t: model time, shape (m,).
        x: one cell per column, shape (m, cells).
        names: of the cells.
        waves: number of each cell's waveform, from 0, which gives the colour; one each by
            default.
        variable: name of the drawn variable, for the axis.

    """
    waves = range(len(names)) if waves is None else waves
    from matplotlib.figure import Figure

    figure = Figure(figsize=(6.4, 0.9 + 0.75 * len(names)), layout='constrained')
    low, high = float(x.min()), float(x.max())
    margin = 0.08 * (high - low)
    grid = figure.subplots(len(names), 1, sharex=True, squeeze=False)[:, 0]
    for cell, axes in enumerate(grid):
        axes.plot(t, x[:, cell], color=WAVES[waves[cell]], linewidth=1.1)
        axes.set_ylim(low - margin, high + margin)
        axes.set_ylabel(names[cell], rotation=0, ha='right', va='center', fontsize=9)
        axes.tick_params(labelsize=8)
        axes.grid(linewidth=0.3)
        axes.spines[['top', 'right']].set_visible(False)
    grid[-1].set_xlim(float(t[0]), float(t[-1]))
    grid[-1].set_xlabel('time [model time]', fontsize=9)
    figure.supylabel(f'{variable} [1]', fontsize=9)
    figure.suptitle(title, fontsize=10)
    return figure


#: Of phases, cycles; of the values of a formula, relative.
PHASE_TOLERANCE, FORMULA_TOLERANCE = 0.002, 1e-9
#: Decimals that a computed value has beyond the printed one.
NUM_EXTRA_DIGITS = 2


@dataclass(frozen=True)
class ReproducedRow:
    """A published quantity and the computed one.

    Attributes:
        paper: authors and year.
        place: section, table, equation or figure of it.
        quantity: its description.
        published: as the paper prints it.
        computed: in the same notation.
        agrees: whether the two agree.
        compared: description of the comparison.
        value: the computed number; None for a word or several numbers.
        erratum: number of the erratum that covers this row, or None.
        corrected: correct value according to the erratum, or ''.
        explained: whether the computed value is the correct one.
        note: for the reader, or ''.

    """

    paper: str
    place: str
    quantity: str
    published: str
    computed: str
    agrees: bool
    compared: str
    value: float | None = None
    erratum: int | None = None
    corrected: str = ''
    explained: bool = False
    note: str = ''

    @property
    def verdict(self) -> str:
        """'agrees', 'erratum N', or 'FAILS' where they differ and no erratum says how."""
        if self.agrees:
            return 'agrees'
        return f'erratum {self.erratum}' if self.explained else 'FAILS'


@dataclass(frozen=True)
class Picture:
    """A figure of a paper, drawn anew.

    Attributes:
        paper: authors and year.
        place: the figure's number.
        caption: description, and differences from the paper's figure.
        figure: its title names paper and figure; or the same as PNG.

    """

    paper: str
    place: str
    caption: str
    figure: Any


@cache
def printed_values(paper: str) -> dict[str, Any]:
    """Return the tables of a paper as it prints them, from printed.yaml."""
    papers = yaml.safe_load(Path(__file__).with_name('printed.yaml').read_text('utf-8'))
    tables: dict[str, Any] = papers[paper]
    return tables


#: Value of a formula.
Value = float | complex | np.ndarray
#: Places of a printed formula where a product has no sign: after a number, a bracket or a blank.
PRODUCT = re.compile(r'(?<=\d)\s*(?=[A-Za-z(])|(?<=\))\s*(?=[\w(])|(?<=\w)\s+(?=[\w(])')


def value_of(text: str, names: Mapping[str, Value]) -> Any:
    """Return the value of a formula as a paper prints it, up to a comma.

    Args:
        text: products without a sign, powers with ^, cosh, exp and sqrt.
        names: of its variables -> value.

    """
    python = PRODUCT.sub('*', text.partition(',')[0]).replace('^', '**')
    functions = {'cosh': np.cosh, 'exp': np.exp, 'sqrt': np.sqrt}
    return eval(python, {'__builtins__': {}, **functions}, dict(names))


#: A part of a paper: computes some of its rows and pictures.
Section = Callable[[], Iterable[ReproducedRow | Picture]]


@dataclass(frozen=True)
class Paper:
    """A paper: a short name, authors and year, title, and its parts."""

    name: str
    authors: str
    reference: str
    sections: tuple[Section, ...]


@dataclass(frozen=True)
class Citation:
    """A place in a paper, from which rows are quoted.

    An erratum comes with the correct value; a computed value that differs from that and from the
    published one fails.
    """

    paper: str
    place: str

    def _row(self, quantity: str, published: str, shown: str, same: Callable[[str], bool],
             how: str, value: float | None, erratum: tuple[int, str] | None,
             note: str) -> ReproducedRow:
        number, corrected = erratum or (None, '')
        return ReproducedRow(self.paper, self.place, quantity, published, shown, same(published),
                             how, value, number, corrected, bool(erratum) and same(corrected),
                             note)

    def number(self, quantity: str, published: str, computed: float, *,
               within: float | None = None, erratum: tuple[int, str] | None = None,
               note: str = '') -> ReproducedRow:
        """Quote a number with the digits printed.

        Args:
            quantity: its description.
            published: as printed; its last digit gives its precision.
            computed: ours.
            within: largest difference; by default half a unit of the last digit printed.
            erratum: that covers a difference, and the right number with its precision.
            note: for the reader.

        """
        def same(text: str) -> bool:
            half = 0.5 * 10.0**_exponent(text)
            limit = half if within is None or text != published else within
            # A little more, for rounding errors at the limit.
            return bool(abs(computed - float(text)) <= limit * (1.0 + 1e-9))

        exponent = _exponent(published) if within is None else int(np.floor(np.log10(within)))
        digits = max(0, -exponent) + NUM_EXTRA_DIGITS
        shown = str(computed) if isinstance(computed, int) else f'{computed:.{digits}f}'
        how = 'to the last digit printed' if within is None else f'within {within:g}'
        return self._row(quantity, published, shown, same, how, float(computed), erratum, note)

    def phases(self, quantity: str, published: str, computed: Sequence[float] | np.ndarray, *,
               within: float = PHASE_TOLERANCE, erratum: tuple[int, str] | None = None,
               note: str = '') -> ReproducedRow:
        """Quote phases in cycles, printed as fractions with blanks between; compared modulo 1."""
        ours = np.asarray(computed, dtype=float)

        def same(text: str) -> bool:
            printed = np.array([float(Fraction(part)) for part in text.split()])
            return bool((np.abs((ours - printed + 0.5) % 1.0 - 0.5) <= within).all())

        # A rounding error below 0 is 0, not 1.
        shown = ' '.join(f'{round(phase % 1.0, 4) % 1.0:.4f}' for phase in ours)
        return self._row(quantity, published, shown, same, f'within {within:g} cycles',
                         float(ours[0] % 1.0) if ours.size == 1 else None, erratum, note)

    def word(self, quantity: str, published: str, computed: str, *,
             erratum: tuple[int, str] | None = None, note: str = '') -> ReproducedRow:
        """Quote a name or a list of names."""
        return self._row(quantity, published, computed, lambda text: text == computed, 'equal',
                         None, erratum, note)

    def holds(self, quantity: str, computed: bool, *, erratum: int | None = None,
              note: str = '') -> ReproducedRow:
        """Quote a statement that the paper makes; an erratum says that it is false."""
        return self.word(quantity, 'true', str(bool(computed)).lower(), note=note,
                         erratum=None if erratum is None else (erratum, 'false'))

    def stable(self, quantity: str, multiplier: float, *, erratum: int | None = None,
               which: str = 'leading') -> ReproducedRow:
        """Quote that a gait is stable, judged by a Floquet multiplier; an erratum: it is not."""
        return self.word(quantity, 'stable', VERDICTS[stable(multiplier)],
                         erratum=None if erratum is None else (erratum, 'unstable'),
                         note=f'{which} Floquet multiplier {multiplier:.3g} a cycle')

    def formula(self, quantity: str, published: str, value: Value | Mapping[str, Value],
                computed: Value, *, erratum: tuple[int, Value | str] | None = None,
                note: str = '') -> ReproducedRow:
        """Quote a formula by its value at some arguments, compared with ours at the same.

        Args:
            quantity: its description.
            published: as printed.
            value: of the formula, or those of its variables by name.
            computed: ours.
            erratum: that covers a difference, and the right value or formula.
            note: for the reader.

        """
        ours = np.ravel(computed)
        limit = FORMULA_TOLERANCE * max(1.0, float(np.abs(ours).max()))
        number, right = erratum or (None, None)
        if isinstance(value, Mapping):
            right = value_of(right, value) if isinstance(right, str) else right
            value = value_of(published, value)

        def same(other: Any) -> bool:
            theirs = np.ravel(other)
            return theirs.shape == ours.shape and bool((np.abs(theirs - ours) <= limit).all())

        single = float(ours[0].real) if ours.size == 1 and not np.iscomplexobj(ours) else None
        return ReproducedRow(self.paper, self.place, quantity, f'{published} = {_shown(value)}',
                             _shown(ours), same(value),
                             f'at one set of couplings, to {FORMULA_TOLERANCE:g}',
                             single, number, '' if right is None else _shown(right),
                             right is not None and same(right), note)


def _exponent(text: str) -> int:
    """Decimal exponent of the last digit of a number."""
    exponent = Decimal(text).as_tuple().exponent
    assert isinstance(exponent, int)
    return exponent


def _shown(value: Any) -> str:
    values = np.ravel(value)
    if np.iscomplexobj(values) and np.abs(values.imag).max() > 1e-12:
        return ', '.join(f'{number.real:.4f}{number.imag:+.4f}i' for number in values)
    return ', '.join(f'{number.real + 0.0:.4f}' for number in values)


# Constants of a Morris-Lecar cell, read off the compiled rates of a network in closed form.

#: Potentials at which m is 0 or 1 to rounding, and at which m and n bend.
SATURATED_POTENTIALS, POTENTIALS = np.array([6.0, 8.0]), np.array([-0.05, 0.0, 0.05, 0.1, 0.2])


def _rates(network: Quadruped | Biped, v: np.ndarray, w: float) -> np.ndarray:
    """V' and w' of a cell at states (v, w) with all cells alike, shape (m, 2)."""
    cells = network.cells
    states = np.concatenate([np.repeat(v[:, None], cells, 1), np.full((v.size, cells), w)], 1)
    # Far states leave the range in a step; only the slopes at its start count.
    run = simulate(network, states, network.step, network.step, progress=False, quiet=True)
    return run.slopes[:, 0, ::cells]


def cell_constants(network: Quadruped | Biped, current: float) -> dict[str, float]:
    """Read the constants off the rates.

    Args:
        network: without coupling between equal cells.
        current: into each cell, which cannot be distinguished from gL vL.

    Returns:
        gCa, vCa, gK, vK, gL, vL, v1 to v4, phi; and tau_far, which is tau at v3 + 10 v4 over
        its smallest value.

    """
    v = np.concatenate([-SATURATED_POTENTIALS, SATURATED_POTENTIALS, POTENTIALS])
    closed, opened = _rates(network, v, 0.0), _rates(network, v, 1.0)
    slope, offset = np.polyfit(v, (opened - closed)[:, 0], 1)
    g_k, v_k = -slope, offset / -slope
    low_slope, low = np.polyfit(v[:2], closed[:2, 0], 1)
    high_slope, high = np.polyfit(v[2:4], closed[2:4, 0], 1)
    g_l, g_ca = -low_slope, low_slope - high_slope
    v_l, v_ca = (low - current) / g_l, (high - low) / g_ca
    m = (closed[4:, 0] - (low + low_slope * POTENTIALS)) / (-g_ca * (POTENTIALS - v_ca))
    v1, v2 = _bend(m)
    speed = (closed - opened)[4:, 1]
    v3, v4 = _bend(closed[4:, 1] / speed)

    def tau_phi(at: float) -> float:
        v = np.array([at])
        return float((_rates(network, v, 0.0) - _rates(network, v, 1.0))[0, 1])

    return {'gCa': float(g_ca), 'vCa': float(v_ca), 'gK': float(g_k), 'vK': float(v_k),
            'gL': float(g_l), 'vL': float(v_l), 'v1': v1, 'v2': v2, 'v3': v3, 'v4': v4,
            'phi': tau_phi(v3), 'tau_far': tau_phi(v3 + 10.0 * v4) / tau_phi(v3)}


def _bend(fraction: np.ndarray) -> tuple[float, float]:
    """Middle and width of ``(1 + tanh((v - middle)/width))/2`` from its values at POTENTIALS."""
    slope, offset = np.polyfit(POTENTIALS, np.arctanh(2.0 * fraction - 1.0), 1)
    return float(-offset / slope), float(1.0 / slope)


#: Fraction of a simulation, from its end, on which the rhythm is measured.
FINAL_FRACTION = 0.15
#: DISTURBANCE: standard deviation of a disturbed start, in the units of the cells.
DISTURBANCE = 0.01


def primary_gaits(variables: int) -> dict[str, Symmetry]:
    """Gaits of Buono & Golubitsky's Table 5; + where x_3 leads x_1 by a quarter, - where it lags.

    Args:
        variables: of each cell.

    """
    shifts = {'pronk': (0, 0), 'pace': (0, 1), 'bound': (2, 0), 'trot': (2, 1),
              'jump+': (1, 0), 'jump-': (3, 0), 'walk+': (1, 1), 'walk-': (3, 1)}
    return {name: Symmetry.of(Z4_Z2, {'omega': Fraction(j, 4), 'kappa': Fraction(k, 2)},
                              variables) for name, (j, k) in shifts.items()}


def disturbed_start(preset: Preset) -> np.ndarray:
    """Return a state near a preset's orbit, every variable disturbed, shape (components,)."""
    start = np.array(preset.start)
    return start + DISTURBANCE * np.random.default_rng(0).standard_normal(start.size)


@dataclass(frozen=True)
class Rhythm:
    """A simulation and the gait at its end.

    Attributes:
        run: from the start on.
        cycle: its last one.
        end: phases, symmetries and gait.

    """

    run: Trajectory
    cycle: LimitCycle
    end: Recognition

    @property
    def gait(self) -> str:
        """Name of the gait with the direction of its wave; 'none' if none is near."""
        return self.end.name or 'none'

    @property
    def kind(self) -> str:
        """Name of the gait without the direction of its wave."""
        return self.gait.rstrip('+-')


def rhythm(network: Network, start: Sequence[float] | np.ndarray, t_end: float, group: Group,
           gaits: Mapping[str, Symmetry]) -> Rhythm:
    """Simulate from a start and recognise the gait that the network ends in.

    Args:
        network: parameters.
        start: a state; with a delay, also the whole history.
        t_end: model time to simulate.
        group: of the network.
        gaits: to choose from.

    Raises:
        InputError: it ends at rest, or does not repeat.

    """
    run = simulate(network, np.asarray(start, dtype=float), t_end, network.step, progress=False)
    cycle = last_cycle(run, network.cells, int((1.0 - FINAL_FRACTION) * run.t.size))
    if cycle is None:
        raise InputError('the simulation ends at rest, or does not repeat')
    return Rhythm(run, cycle, recognise(cycle.signals[:, :network.cells], group, gaits))

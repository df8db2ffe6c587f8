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

"""Report of ``analyze`` on a parameter set and its phase response, as text and as JSON."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
import math
from typing import Any, cast

from cpg_ros.common.command_line import table
from cpg_ros.common.errors import CpgError, ShortRepr
from cpg_ros.dynamics.arclength import NoOrbit
from cpg_ros.dynamics.equilibrium import (
    all_equilibria,
    continue_equilibrium,
    Crossing,
    Equilibrium,
    equilibrium,
    named,
    odd,
)
from cpg_ros.dynamics.hopf import hopf_points, HopfPoint
from cpg_ros.dynamics.isotypic import Block, blocks
from cpg_ros.dynamics.phase_response import locking, phase_diffusion, phase_response, PhaseResponse
from cpg_ros.dynamics.stability import GaitAssessment, nearest_threshold
from cpg_ros.networks.library.quadruped import Quadruped
from cpg_ros.networks.network import Network, ParameterLine
import numpy as np


def _published_numbers(point: HopfPoint) -> dict[str, float]:
    """Return real parts of the normal form by the formulas of Liu & Zhang (2024)."""
    # Only a report of Hopf points needs the papers' modules.
    from cpg_ros.analysis.papers.liu_zhang import published_normal_form
    form = published_normal_form(point)
    return {'k1_published': form.k1.real, 'k2_published': form.k2.real}


def _theorem(point: HopfPoint) -> tuple[str, dict[str, Any]]:
    """Return the verdict of theorem 4.2 of Buono & Golubitsky (2001)."""
    from cpg_ros.analysis.papers.buono_hopf import theorem_verdict
    verdict = theorem_verdict(cast(Quadruped, point.network), point.gait)
    return str(verdict), {'theorem_4_2': {
        'applies': verdict.applies, 'stable': verdict.stable, 'says': str(verdict)}}


@dataclass(frozen=True)
class Commentary:
    """Statements of a paper on the Hopf points of its network; none for other networks.

    Attributes:
        title: of the remarks.
        numbers: name -> number, for JSON.
        remark: statement on a point, as text and in plain types.

    """

    title: str = ''
    numbers: Callable[[HopfPoint], dict[str, float]] = lambda point: {}
    remark: Callable[[HopfPoint], tuple[str, dict[str, Any]]] = lambda point: ('', {})


#: Network -> commentary.
COMMENTARIES = {
    'delayed': Commentary(numbers=_published_numbers),
    'quadruped': Commentary(title='Buono & Golubitsky at these points:', remark=_theorem)}


#: Error of the trivial multiplier that the report mentions.
ERROR_THRESHOLD = 1e-6
#: Distance from 0 at which a variable lies on a kink at the equilibrium.
KINK_TOLERANCE = 1e-12


def _root(value: complex) -> str:
    """Return a root or a pair of them, without a minus at zero."""
    if abs(value.imag) < 1e-12:
        return f'{value.real:.4f}'
    return f'{value.real:.4f} +- {abs(value.imag):.4f}i'


def _state(network: Network, rest: np.ndarray) -> str:
    return ', '.join(f'{name} {value:.4f}' for name, value in named(network, rest).items())


def _yes(value: bool | None) -> str:
    return {True: 'yes', False: 'no', None: 'cannot tell'}[value]


def _which(verdict: GaitAssessment, meant: GaitAssessment) -> str:
    """Return which of a gait's orbits is meant, unless it is the first."""
    return '' if meant is verdict else f' (the orbit of period {meant.known_orbit.period:.6f})'


def _kind(point: HopfPoint) -> tuple[str, str]:
    """Return the type of a Hopf point, and the side on which its orbits lie."""
    if point.normal_form.degenerate:
        return 'degenerate', '-'
    return ('supercritical' if point.supercritical else 'subcritical',
            'above' if point.normal_form.side > 0 else 'below')


def _degenerate(network: Network) -> list[str]:
    """Return why there is no normal form, in lines."""
    if not network.kinks:
        return ['degenerate: the term of third order vanishes, so the normal form does not tell '
                'on which side', 'orbits lie, nor whether they attract.']
    return ['degenerate: the rates are linear about the equilibrium, up to their kinks where '
            f'{" or ".join(network.kinks)} passes 0.', 'So there is no normal form: at the point '
            'itself waves of any size up to the kinks neither grow nor', 'decay, and orbits start '
            'with the size at which they reach a kink, not with size 0.']


@dataclass(frozen=True, eq=False, repr=False)
class Analysis(ShortRepr):
    """A parameter set with its gaits.

    Hopf points are along the delay, if the network has one.

    Attributes:
        network: the parameters.
        gaits: gait -> verdict.
        along: parameters that vary along branches, and for Hopf points without a delay.
        span: their first and last value.
        longest: largest delay at which Hopf points are found, model time.

    """

    network: Network
    gaits: Mapping[str, GaitAssessment]
    along: ParameterLine
    span: tuple[float, float]
    longest: float

    @cached_property
    def _equilibrium(self) -> tuple[list[HopfPoint], tuple[Block, ...], np.ndarray, str]:
        """Return Hopf points, blocks and equilibrium, or why there are none."""
        try:
            rest = equilibrium(self.network)
            levels = rest.reshape(self.network.variables, -1)
            on = [name for name in self.network.kinks
                  if np.abs(levels[self.network.states.index(name)]).min() < KINK_TOLERANCE]
            if on:
                return [], (), np.array([]), (f'it lies on a kink of the rates, where '
                                              f'{" and ".join(on)} is 0: they have no '
                                              'linearisation, and there are no Hopf points')
            classes = blocks(self.network, rest)
            span = (0.0, self.longest) if self.delay else self.span
            points = hopf_points(self.network, self.line, *span) if span[0] < span[1] else []
        except CpgError as error:
            return [], (), np.array([]), str(error)
        return points, classes, rest, ''

    @property
    def delay(self) -> str:
        """Name of the delay, or ''."""
        return self.network.delay_parameter

    @property
    def line(self) -> ParameterLine:
        """Parameters that vary for Hopf points."""
        return ParameterLine((self.delay,), (1.0,)) if self.delay else self.along

    @property
    def hopf(self) -> list[HopfPoint]:
        """Hopf points of the equilibrium, by ascending parameter."""
        return self._equilibrium[0]

    @property
    def blocks(self) -> tuple[Block, ...]:
        """The linearisation at the equilibrium, by symmetry class."""
        return self._equilibrium[1]

    @property
    def _commentary(self) -> Commentary:
        return COMMENTARIES.get(self.network.name, Commentary())

    @property
    def existing(self) -> list[GaitAssessment]:
        """Gaits that exist at these parameters."""
        return [verdict for verdict in self.gaits.values() if verdict.orbit is not None]

    @property
    def parameters(self) -> str:
        """The network's parameters in a line."""
        return ', '.join(f'{name} {value:g}' for name, value in self.network.grouped().items())

    def _gaits(self) -> list[str]:
        names = next((list(verdict.phases) for verdict in self.existing), [])
        rows: list[tuple[str, ...]] = [(
            'gait', 'period', 'amplitude', *names, 'in class', 'transverse', 'stable',
            'gain needed', 'default', 'stable then')]
        for verdict in (orbit for whole in self.existing for orbit in whole.orbits):
            rows.append((
                verdict.gait, f'{verdict.known_orbit.period:.6f}', f'{verdict.amplitude:.6f}',
                *(f'{phase:g}' for phase in verdict.phases.values()),
                f'{verdict.multipliers.leading_within:.4f}',
                f'{verdict.multipliers.leading_transverse:.4f}', _yes(verdict.stable),
                f'{verdict.smallest_gain:.4f}', f'{verdict.default_gain:.4f}',
                _yes(verdict.stable_with_default_gain)))
        lines = [
            'Gaits at these parameters (period in model time; phases in cycles; largest Floquet',
            'multipliers per cycle in the symmetry class and transverse to it; gains of the',
            'symmetry lock per model time):'] + [
                f'  {line}' for line in table(rows, '<>>' + '>' * len(names) + '>>>>>>')]
        if not self.existing:
            lines = []
        lines += [f'  {orbit.gait}: the multiplier along the orbit comes out as '
                  f'{abs(orbit.multipliers.trivial):.6g} instead of 1; the others are no better'
                  for whole in self.existing for orbit in whole.orbits
                  if orbit.multipliers.error > ERROR_THRESHOLD]
        reasons: dict[str, list[str]] = {}
        for verdict in self.gaits.values():
            if verdict.orbit is None and verdict.gait != self.network.unnamed:
                gait, why = verdict.gait, verdict.why.removesuffix(f", not '{verdict.gait}'")
                reason = why.removeprefix(f'no {gait}')
                reasons.setdefault(f': {why}' if reason == why else reason, []).append(gait)
        return lines + [f'  no {", ".join(gaits)}{reason}' for reason, gaits in reasons.items()]

    def _conclusion(self) -> str:
        """Return a summary in a sentence or two."""
        if not self.existing:
            nearest = f'; {nearest_threshold(self.network)}' if self.delay else ''
            return f'No gait was found at these parameters{nearest}.'
        by_itself, locked, unsure, never, text = [], [], [], [], []
        for verdict in self.existing:
            if stable := [orbit for orbit in verdict.orbits if orbit.stable]:
                by_itself.append(verdict.gait + _which(verdict, stable[0]))
            elif held := [orbit for orbit in verdict.orbits if orbit.stable_with_default_gain]:
                neutral = (', cannot tell about it without the lock' if held[0].stable is None
                           else '')
                locked.append(verdict.gait + _which(verdict, held[0]) + neutral)
            elif unknown := [orbit for orbit in verdict.orbits
                             if orbit.stable_with_default_gain is None]:
                unsure.append(f'{verdict.gait} (leading multiplier '
                              f'{unknown[0].multipliers.leading:.10g})')
            else:
                count = len(verdict.orbits)
                orbits = 'one orbit' if count == 1 else f'{count} orbits'
                never.append(f'{verdict.gait} ({orbits}, {verdict.searched})')
        if by_itself:
            text.append(f'{", ".join(by_itself)}: stable.')
        if locked:
            text.append(f'{", ".join(locked)}: stable with the symmetry lock only; without it a '
                        'small disturbance takes over.')
        if unsure:
            text.append(f'{", ".join(unsure)}: cannot tell whether it attracts with the lock.')
        if never:
            text.append(f'{", ".join(never)}: does not attract, with or without the lock.')
        return ' '.join(text)

    def text(self) -> str:
        """Return the report as text."""
        return '\n'.join([f'{self.network.name}: {self.parameters}', '', *self._rest(), '',
                          *self._gaits(), '', self._conclusion()])

    def _rest(self) -> list[str]:
        """Return lines on the equilibrium and its Hopf points."""
        _, classes, rest, why = self._equilibrium
        if why:
            return [f'Equilibrium: {why}.']
        describe = self._roots if self.delay else self._eigenvalues
        lines = [*describe(classes, rest), '']
        where = (f'up to a delay of {self.longest:g}' if self.delay else
                 f'with {self.along} from {self.span[0]:g} to {self.span[1]:g}')
        return [*lines, *(self._points(where) if self.hopf else [f'No Hopf point {where}.'])]

    def _roots(self, blocks: tuple[Block, ...], rest: np.ndarray) -> list[str]:
        """Return, with a delay, the number of unstable roots, and the rightmost root."""
        unstable = sum(len(block.right_of(0.0)) for block in blocks)
        block = max(blocks, key=lambda block: block.leading.real)
        count = f'{unstable or "no"} root{"s" if unstable != 1 else ""}'
        where = '' if odd(self.network) else f' at {_state(self.network, rest)}'
        return [f'Equilibrium{where}: {count} with positive real part; the rightmost is '
                f'{_root(block.leading)} per model time, of mode '
                f'({", ".join(map(str, block.mode))}).']

    def _eigenvalues(self, blocks: tuple[Block, ...], rest: np.ndarray) -> list[str]:
        rows: list[tuple[str, ...]] = [('class', 'gait', 'rightmost eigenvalue')]
        rows += [(block.name, block.gait, _root(block.leading)) for block in blocks]
        return [f'Equilibrium: {_state(self.network, rest)}; eigenvalues per model time by '
                'symmetry class:', *(f'  {line}' for line in table(rows))]

    def _points(self, where: str) -> list[str]:
        """Return a table of the Hopf points."""
        text, heads = self._commentary, () if self.delay else ('l1',)
        rows: list[tuple[str, ...]] = [(
            'gait', 'wave', str(self.line), 'omega', 'period', 'k1', 'k2', *heads,
            'type', 'orbits', 'others', 'transverse')]
        for point in self.hopf:
            numbers = {'omega': point.omega, 'period': math.tau / point.omega, **self._form(point)}
            rows.append((
                point.gait, point.wave, f'{point.value:.4f}',
                *('-' if number is None else f'{number:.4f}' for number in numbers.values()),
                *_kind(point), str(point.unstable_roots), str(point.unstable_transverse_roots)))
        explained = (
            f'{self.delay} and period in model time; omega in rad per model time; '
            'others: further roots with\npositive real part, transverse: of them outside the class'
            if self.delay else
            'omega in rad per model time; others: further eigenvalues with positive\n'
            'real part, transverse: of them outside the class')
        middle = len(rows[0]) - 6
        lines = [*f'Hopf points {where} ({explained}):'.split('\n'),
                 *(f'  {line}' for line in table(rows, '<<' + '>' * middle + '<<>>'))]
        remarks = [f'  {self.line} {point.value:.4f}: {remark}' for point in self.hopf
                   if (remark := text.remark(point)[0])]
        if any(point.normal_form.degenerate for point in self.hopf):
            lines += [f'  {line}' for line in _degenerate(self.network)]
        return [*lines, '', text.title, *remarks] if remarks else lines

    def _form(self, point: HopfPoint) -> dict[str, float | None]:
        """Return the coefficients of the normal form; with a delay, in units of the delay."""
        form, none = point.normal_form, point.normal_form.degenerate
        if self.delay:
            form = point.in_delays
            return {'k1': form.k1.real, 'k2': None if none else form.k2.real}
        return {'k1': form.k1.real, 'k2': None if none else form.k2.real,
                'lyapunov': None if none else point.lyapunov}

    def as_dict(self) -> dict[str, Any]:
        """Return everything in plain types."""
        _, classes, rest, why = self._equilibrium
        text: dict[str, Any] = {
            'network': self.network.name, 'params': self.network.as_dict(),
            'gaits': {gait: verdict.as_dict() for gait, verdict in self.gaits.items()}}
        text['hopf'] = [{
            'gait': point.gait, 'mode': list(point.mode), 'wave': point.wave,
            **({'n': point.n, 'omega': point.omega, self.delay: point.value} if self.delay else
               {'along': str(self.along), 'value': point.value, 'omega': point.omega}),
            **self._form(point), **self._commentary.numbers(point),
            'direction': point.direction,
            **dict.fromkeys(('supercritical', 'stable_on_centre_manifold'),
                            None if point.normal_form.degenerate else point.supercritical),
            'degenerate': point.normal_form.degenerate,
            'unstable_roots': point.unstable_roots,
            'unstable_transverse_roots': point.unstable_transverse_roots,
            **self._commentary.remark(point)[1]} for point in self.hopf]
        text['rest'] = {'why': why} if why else {
            **({} if odd(self.network) else {'stand': named(self.network, rest)}),
            'leading_roots': [{
                'mode': list(block.mode), **({} if self.delay else {'gait': block.gait}),
                'real': block.leading.real, 'imag': block.leading.imag} for block in classes]}
        if self.delay and not self.existing:
            text['nearest_threshold'] = nearest_threshold(self.network)
        return text


#: Difference of values, over their range, at which two branches cross the same point.
VALUE_TOLERANCE = 1e-6


@dataclass(frozen=True, eq=False, repr=False)
class EquilibriumReport(ShortRepr):
    """The equilibria of an analysis, and where their branches bifurcate.

    Attributes:
        equilibria: one of each set that symmetries map to one another.
        crossings: on their branches, by ascending value, with the number of the equilibrium.
        line: parameters that vary along the branches.

    """

    equilibria: list[Equilibrium]
    crossings: list[tuple[int, Crossing]]
    line: ParameterLine

    @classmethod
    def of(cls, analysis: Analysis) -> 'EquilibriumReport':
        """Find the equilibria and follow them along the line of the analysis."""
        found = all_equilibria(analysis.network)
        line, (low, high) = analysis.along, analysis.span
        value = line.value(analysis.network)
        low, high = min(low, value), max(high, value)
        crossings: list[tuple[int, Crossing]] = []
        for k, start in enumerate(found):
            try:
                branch = continue_equilibrium(start, line, low, high)
            except NoOrbit:
                continue
            # A branch that has turned round may pass the images of its points.
            for one in branch.crossings:
                if not any(k == other and (one.kind, one.block.mode) == (met.kind, met.block.mode)
                           and abs(one.value - met.value) <= VALUE_TOLERANCE * (high - low)
                           for other, met in crossings):
                    crossings.append((k, one))
        return cls(found, sorted(crossings, key=lambda pair: pair[1].value), line)

    def _pose(self, one: Equilibrium) -> str:
        """Return the first variable of the cells of each level."""
        network = one.network
        levels = one.state[:network.cells]
        places: dict[float, list[str]] = {}
        for cell, level in enumerate(levels):
            key = next((other for other in places if abs(other - level) < 1e-6), float(level))
            places.setdefault(key, []).append(str(cell + 1))
        single = len(places) == 1
        return f'{network.states[0]} ' + ', '.join(
            f'{level:.4f}' + ('' if single else f' in {" ".join(cells)}')
            for level, cells in places.items())

    def text(self) -> str:
        """Return tables of the equilibria and of the bifurcations."""
        if not self.equilibria:
            return 'Equilibria: none was found.'
        rows: list[tuple[str, ...]] = [('', 'fixed by', 'state of the cells', 'unstable',
                                        'rightmost root', 'attracts')]
        rows += [(str(k), one.label, self._pose(one), str(one.unstable), _root(one.leading),
                  _yes(one.attracts)) for k, one in enumerate(self.equilibria, 1)]
        lines = ['Equilibria (one of each set of images; the symmetries that fix it; number of '
                 'unstable roots,', 'the rightmost per model time; where one attracts, the '
                 'network can freeze):', *(f'  {line}' for line in table(rows, '><<><<'))]
        if not self.crossings:
            return '\n'.join([*lines, f'  No bifurcation of them along {self.line}.'])
        rows = [('of', str(self.line), 'type', 'class', 'gait', 'omega')]
        rows += [(str(k + 1), f'{one.value:.6f}', one.kind, one.block.name, one.block.gait,
                  f'{one.omega:.4f}' if one.omega else '') for k, one in self.crossings]
        return '\n'.join([*lines, f'Their bifurcations along {self.line}:',
                          *(f'  {line}' for line in table(rows, '>><<<>'))])

    def as_dict(self) -> dict[str, Any]:
        """Return everything in plain types."""
        return {'equilibria': [{
            'fixed_by': list(one.group.elements), 'state': one.state.tolist(),
            'unstable_roots': one.unstable, 'leading_real': one.leading.real,
            'leading_imag': one.leading.imag, 'attracts': one.attracts}
            for one in self.equilibria], 'along': str(self.line), 'bifurcations': [{
                'equilibrium': k, 'value': one.value, 'type': one.kind,
                'mode': list(one.block.mode), 'gait': one.block.gait, 'omega': one.omega}
                for k, one in self.crossings]}


#: Points of a cycle in JSON, and those among which extremes are searched for.
CURVE_POINTS, EXTREMUM_POINTS = 64, 1024


@dataclass(frozen=True, eq=False, repr=False)
class PhaseReport(ShortRepr):
    """The phase response of each gait of an analysis, of its first orbit.

    Attributes:
        responses: gait -> response.
        missing: gait -> why it has none.

    """

    responses: dict[str, PhaseResponse]
    missing: dict[str, str]

    @classmethod
    def of(cls, analysis: Analysis) -> 'PhaseReport':
        """Solve for the phase responses of an analysis."""
        responses, missing = {}, {}
        for verdict in analysis.existing:
            try:
                responses[verdict.gait] = phase_response(verdict.known_orbit)
            except NoOrbit as error:
                missing[verdict.gait] = str(error)
        return cls(responses, missing)

    def text(self) -> str:
        """Return tables of the largest advances and delays, of locking ranges and diffusion."""
        rows: list[tuple[str, ...]] = [('gait', 'cells', 'input to', 'advance', 'at', 'delay',
                                        'at', 'locking')]
        theta = np.arange(EXTREMUM_POINTS) / EXTREMUM_POINTS
        spread = []
        for gait, response in self.responses.items():
            locks, first = locking(response), response.orbit.symmetry.first
            spread.append(f'{phase_diffusion(response, 1.0):.4g} ({gait})')
            for wave, variable, name in curves(response):
                values = response.waveform(theta, wave, variable)
                most, least = int(values.argmax()), int(values.argmin())
                rows.append((gait, cells(response, wave), name,
                             f'{values[most]:.5f}', f'{theta[most]:.3f}',
                             f'{-values[least]:.5f}', f'{theta[least]:.3f}',
                             f'{locks[first[wave], variable]:.5f}'))
        lines = [f'  no phase response of the {gait}: {why}' for gait, why in self.missing.items()]
        if self.responses:
            lines = ['Phase response: largest advance and delay by a small input to a variable of '
                     'one cell (cycles per',
                     "unit of the variable), and the cell's phase at which they occur (cycles; "
                     'cell 1 peaks at 0).',
                     'Locking: a sinusoidal input of amplitude a to the rate holds the gait up to '
                     'a times this from its own',
                     'frequency (cycles per model time):',
                     *(f'  {line}' for line in table(rows, '<<<>>>>>')), *lines,
                     'White noise of s per square root of model time in every variable makes the '
                     'phase diffuse with s^2 times',
                     f'(cycles^2 per model time): {", ".join(spread)}.']
        return '\n'.join(lines or ['Phase response: there is no gait.'])

    def as_dict(self) -> dict[str, Any]:
        """Return the curves in plain types, gait -> curves over the phase of the cell."""
        theta = np.arange(CURVE_POINTS) / CURVE_POINTS
        gaits: dict[str, Any] = {gait: {'why': why} for gait, why in self.missing.items()}
        for gait, response in self.responses.items():
            locks, first = locking(response), response.orbit.symmetry.first
            gaits[gait] = {
                'diffusion': phase_diffusion(response, 1.0),
                'theta': theta.tolist(), 'unit': 'cycles per unit of the variable',
                'curves': [{'cells': (np.flatnonzero(response.orbit.waves == wave) + 1).tolist(),
                            'variable': name,
                            'locking': float(locks[first[wave], variable]),
                            'response': response.waveform(theta, wave, variable).tolist()}
                           for wave, variable, name in curves(response)]}
        return gaits


def curves(response: PhaseResponse) -> list[tuple[int, int, str]]:
    """Return wave, variable and the variable's name of each curve."""
    return [(wave, variable, name) for wave in range(int(response.orbit.waves.max()) + 1)
            for variable, name in enumerate(response.orbit.network.states)]


def cells(response: PhaseResponse, wave: int) -> str:
    """Return the numbers of a wave's cells, or 'all'."""
    numbers = np.flatnonzero(response.orbit.waves == wave) + 1
    return 'all' if numbers.size == response.orbit.network.cells else ' '.join(map(str, numbers))

"""What ``analyze`` has to say about a parameter set: as text, and as JSON."""

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from cpg_ros.dynamics.cell_hopf import CellHopf, cell_hopf_points
from cpg_ros.dynamics.characteristic import leading_roots, unstable_roots
from cpg_ros.dynamics.equilibrium import stand
from cpg_ros.dynamics.gait_assessment import GaitAssessment, nearest_threshold
from cpg_ros.dynamics.hopf import HopfPoint, hopf_points
from cpg_ros.dynamics.isotypic import Block, blocks
from cpg_ros.errors import CpgError
from cpg_ros.files.plain_text import table
from cpg_ros.networks.delayed import MODES, Delayed
from cpg_ros.networks.network import Network
from cpg_ros.networks.parameter_line import ParameterLine
from cpg_ros.networks.quadruped import Quadruped
from cpg_ros.papers.theorem_4_2 import TheoremVerdict, theorem_4_2


def _root(value: complex) -> str:
    """A root or a pair of them, without a minus at zero."""
    if abs(value.imag) < 1e-12:
        return f'{value.real:.4f}'
    return f'{value.real:.4f} +- {abs(value.imag):.4f}i'


def _yes(value: bool) -> str:
    return 'yes' if value else 'no'


@dataclass(frozen=True, eq=False)
class Analysis(ABC):
    """A parameter set with its gaits.

    Attributes:
        network: the parameters.
        gaits: gait -> verdict.
        along: parameters that move for Hopf points and branches.
        span: from where to where.

    """

    network: Network
    gaits: Mapping[str, GaitAssessment]
    along: ParameterLine
    span: tuple[float, float]

    @property
    @abstractmethod
    def hopf(self) -> list:
        """Hopf points of rest, by rising parameter."""

    @property
    def existing(self) -> list[GaitAssessment]:
        """Gaits that there are."""
        return [verdict for verdict in self.gaits.values() if verdict.orbit is not None]

    @property
    def parameters(self) -> str:
        """The network's parameters in a line."""
        values = self.network.as_dict()
        for name, members in self.network.groups.items():
            if len({values[member] for member in members}) == 1:
                values = {name if key == members[0] else key: value for key, value
                          in values.items() if key == members[0] or key not in members}
        return ', '.join(f'{name} {value:g}' for name, value in values.items())

    def _gaits(self) -> list[str]:
        names = next((list(verdict.phases) for verdict in self.existing), [])
        rows: list[tuple[str, ...]] = [(
            'gait', 'period', 'amplitude', *names, 'in class', 'transverse', 'stable',
            'gain needed', 'default', 'stable then')]
        for verdict in self.existing:
            assert verdict.orbit is not None
            rows.append((
                verdict.gait, f'{verdict.orbit.period:.6f}', f'{verdict.amplitude:.6f}',
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
            lines = ['No gait at these parameters.']
        missing = [verdict for verdict in self.gaits.values() if verdict.orbit is None]
        return lines + [f'  no {verdict.gait}: {self._reason(verdict)}' for verdict in missing]

    @staticmethod
    def _reason(verdict: GaitAssessment) -> str:
        """Why there is no such gait, without the list of all parameters."""
        said = verdict.why.removeprefix(f'no {verdict.gait} ')
        head, way, _ = said.partition(' of the way, to ')
        return f'{head} of the way, no further' if way else said

    def _conclusion(self) -> str:
        """The whole in a sentence or two."""
        if not self.existing:
            return 'This set gives no gait.'
        by_itself = [verdict.gait for verdict in self.existing if verdict.stable]
        locked = [verdict.gait for verdict in self.existing
                  if not verdict.stable and verdict.stable_with_default_gain]
        never = [verdict.gait for verdict in self.existing if not (
            verdict.stable or verdict.stable_with_default_gain)]
        said = []
        if by_itself:
            said.append(f'{", ".join(by_itself)}: stable.')
        if locked:
            said.append(f'{", ".join(locked)}: stable with the symmetry lock only; without it a '
                        'small disturbance takes over.')
        if never:
            said.append(f'{", ".join(never)}: does not attract, with or without the lock.')
        return ' '.join(said)

    def text(self) -> str:
        """Tables for people."""
        return '\n'.join([f'{self.network.name}: {self.parameters}', '', *self._rest(), '',
                          *self._gaits(), '', self._conclusion()])

    @abstractmethod
    def _rest(self) -> list[str]:
        """Lines on the rest state and its Hopf points."""

    def as_dict(self) -> dict[str, Any]:
        """Everything in plain types."""
        return {'network': self.network.name, 'params': self.network.as_dict(),
                'gaits': {gait: verdict.as_dict() for gait, verdict in self.gaits.items()}}


@dataclass(frozen=True, eq=False)
class DelayAnalysis(Analysis):
    """Of the delayed network.

    Attributes:
        longest: bound of the delay for Hopf points, model time.

    """

    longest: float = 0.0

    @cached_property
    def hopf(self) -> list[HopfPoint]:
        """Hopf points of rest, by rising delay."""
        assert isinstance(self.network, Delayed)
        return hopf_points(self.network, self.longest)

    def _rest(self) -> list[str]:
        assert isinstance(self.network, Delayed)
        unstable = sum(len(unstable_roots(self.network, mode)) for mode in MODES)
        mode, leading = max(leading_roots(self.network).items(), key=lambda item: item[1].real)
        count = f'{unstable or "no"} root{"s" if unstable != 1 else ""}'
        lines = [f'Rest: {count} with positive real part; the rightmost is {_root(leading)} '
                 f'per model time, of mode ({mode.j}, {mode.k}).', '']
        if not self.hopf:
            return [*lines, f'No Hopf point up to a delay of {self.longest:g}.']
        rows: list[tuple[str, ...]] = [(
            'gait', 'wave', 'tau', 'omega', 'period', 'k1', 'k2', "k1'", "k2'", 'type', 'orbits',
            'others', 'transverse')]
        for point in self.hopf:
            form, printed = point.normal_form, point.published
            rows.append((
                point.gait, point.wave, f'{point.tau:.4f}', f'{point.omega:.4f}',
                f'{math.tau / point.omega:.4f}', f'{form.k1.real:.4f}',
                f'{form.k2.real:.4f}', f'{printed.k1.real:.4f}', f'{printed.k2.real:.4f}',
                'supercritical' if point.supercritical else 'subcritical',
                'above' if form.side > 0 else 'below', str(point.unstable_roots),
                str(point.unstable_transverse_roots)))
        return [*lines, f'Hopf points up to a delay of {self.longest:g} (tau and period in model '
                "time; omega in rad per model time; k1', k2' as",
                'Liu & Zhang print them, which is wrong; others: further roots with positive real '
                'part, transverse: of them outside the class):',
                *(f'  {line}' for line in table(rows, '<<>>>>>>><<>>'))]

    def _conclusion(self) -> str:
        assert isinstance(self.network, Delayed)
        if self.existing:
            return super()._conclusion()
        return f'This set gives no gait; {nearest_threshold(self.network)}.'

    def as_dict(self) -> dict[str, Any]:
        """Everything in plain types."""
        assert isinstance(self.network, Delayed)
        said = super().as_dict()
        said['hopf'] = [{
            'gait': point.gait, 'mode': [point.mode.j, point.mode.k], 'wave': point.wave,
            'n': point.n, 'omega': point.omega, 'tau': point.tau,
            'k1': point.normal_form.k1.real, 'k2': point.normal_form.k2.real,
            'k1_published': point.published.k1.real, 'k2_published': point.published.k2.real,
            'direction': point.direction, 'supercritical': point.supercritical,
            'stable_on_centre_manifold': point.supercritical,
            'unstable_roots': point.unstable_roots,
            'unstable_transverse_roots': point.unstable_transverse_roots}
            for point in self.hopf]
        said['rest'] = {'leading_roots': [
            {'mode': [mode.j, mode.k], 'real': root.real, 'imag': root.imag}
            for mode, root in leading_roots(self.network).items()]}
        if not self.existing:
            said['nearest_threshold'] = nearest_threshold(self.network)
        return said


@dataclass(frozen=True, eq=False)
class CellAnalysis(Analysis):
    """Of a network of Morris-Lecar cells."""

    @cached_property
    def _found(self) -> tuple[list[CellHopf], tuple[Block, ...], Any, str]:
        """Hopf points, blocks and stand; or why there are none."""
        try:
            state = stand(self.network)  # type: ignore[type-var]
            parts = blocks(self.network, state)  # type: ignore[arg-type]
            points = cell_hopf_points(self.network, self.along, *self.span)  # type: ignore[arg-type]
        except CpgError as error:
            return [], (), None, str(error)
        return points, parts, state, ''

    @property
    def hopf(self) -> list[CellHopf]:
        """Hopf points of the stand, by rising parameter."""
        return self._found[0]

    @property
    def blocks(self) -> tuple[Block, ...]:
        """The linearisation at the stand, by symmetry class."""
        return self._found[1]

    def _rest(self) -> list[str]:
        points, parts, state, why = self._found
        if why:
            return [f'Stand: {why}.']
        rows: list[tuple[str, ...]] = [('class', 'gait', 'rightmost eigenvalue')]
        rows += [(block.name, block.gait, _root(block.leading)) for block in parts]
        lines = [f'Stand: v {state[0]:.4f}, w {state[1]:.4f}; eigenvalues per model time by '
                 'symmetry class:', *(f'  {line}' for line in table(rows)), '']
        where = f'{self.along} from {self.span[0]:g} to {self.span[1]:g}'
        if not points:
            return [*lines, f'No Hopf point with {where}.']
        rows = [('gait', 'wave', str(self.along), 'omega', 'period', 'k1', 'k2', 'l1', 'type',
                 'orbits', 'others', 'transverse')]
        for point in points:
            form = point.normal_form
            rows.append((
                point.gait, point.wave, f'{point.value:.4f}', f'{point.omega:.4f}',
                f'{math.tau / point.omega:.4f}', f'{form.k1.real:.4f}',
                f'{form.k2.real:.4f}', f'{point.lyapunov:.4f}',
                'supercritical' if point.supercritical else 'subcritical',
                'above' if form.side > 0 else 'below', str(point.unstable_roots),
                str(point.unstable_transverse_roots)))
        lines += [f'Hopf points with {where} (omega in rad per model time; others: further '
                  'eigenvalues with positive', 'real part, transverse: of them outside the '
                  'class):', *(f'  {line}' for line in table(rows, '<<>>>>>><<>>'))]
        said = [f'  {self.along} {point.value:.4f}: {verdict}' for point in points
                if (verdict := self._theorem(point)) is not None]
        return [*lines, '', 'Buono & Golubitsky at these points:', *said] if said else lines

    @staticmethod
    def _theorem(point: CellHopf) -> TheoremVerdict | None:
        """What theorem 4.2 says of a Hopf point, which is one on the quadruped."""
        network = point.network
        return theorem_4_2(network, point.gait) if isinstance(network, Quadruped) else None

    def as_dict(self) -> dict[str, Any]:
        """Everything in plain types."""
        points, parts, state, why = self._found
        said = super().as_dict()
        said['hopf'] = [{
            'gait': point.gait, 'mode': list(point.mode), 'wave': point.wave,
            'along': str(self.along), 'value': point.value, 'omega': point.omega,
            'k1': point.normal_form.k1.real, 'k2': point.normal_form.k2.real,
            'lyapunov': point.lyapunov, 'direction': point.direction,
            'supercritical': point.supercritical,
            'stable_on_centre_manifold': point.supercritical,
            'unstable_roots': point.unstable_roots,
            'unstable_transverse_roots': point.unstable_transverse_roots,
            **({} if (theorem := self._theorem(point)) is None else {
                'theorem_4_2': {'applies': theorem.applies, 'stable': theorem.stable,
                                'says': str(theorem)}})} for point in points]
        said['rest'] = {'why': why} if why else {
            'stand': {'v': float(state[0]), 'w': float(state[1])},
            'leading_roots': [{'mode': list(block.mode), 'gait': block.gait,
                               'real': block.leading.real, 'imag': block.leading.imag}
                              for block in parts]}
        return said


def analysed(network: Network, gaits: Mapping[str, GaitAssessment], along: ParameterLine,
             span: tuple[float, float], longest: float) -> DelayAnalysis | CellAnalysis:
    """Put together what is known of a parameter set.

    Args:
        network: the parameters.
        gaits: gait -> verdict.
        along: parameters that move.
        span: from where to where they do.
        longest: bound of the delay for Hopf points, model time.

    """
    if isinstance(network, Delayed):
        return DelayAnalysis(network, gaits, along, span, longest)
    return CellAnalysis(network, gaits, along, span)

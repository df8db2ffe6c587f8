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

"""The phase response curves that ``analyze --prc`` reports: as text, and as JSON."""

from dataclasses import dataclass
from typing import Any

from cpg_ros.analysis.analysis_report import Analysis
from cpg_ros.common.command_line import table
from cpg_ros.common.errors import ShortRepr
from cpg_ros.dynamics.arclength import NoOrbit
from cpg_ros.dynamics.phase_response import locking, phase_diffusion, phase_response, PhaseResponse
import numpy as np

#: POINTS: points of a cycle in JSON; FINE: points among which extremes are searched for.
POINTS, FINE = 64, 1024


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
        theta = np.arange(FINE) / FINE
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
        theta = np.arange(POINTS) / POINTS
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

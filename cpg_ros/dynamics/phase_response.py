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

"""Phase reduction of a gait: its response to a weak periodic input and to noise.

To first order in a weak input p(t) to the rates, the phase in cycles obeys
``phi' = 1/T + Z(phi T) . p(t)``, Z the phase response. Averaged over a cycle, a sinusoidal input
locks it within a range of frequencies whose half-width is the harmonic of Z (Pikovsky, Rosenblum &
Kurths, *Synchronization*, ch. 7), and white noise makes it diffuse.
"""

from dataclasses import dataclass

from cpg_ros.common.errors import ShortRepr
from cpg_ros.dynamics.orbit import Orbit, Waveforms
from cpg_ros.dynamics.orbit_method import orbit_method
import numpy as np

# Phase response curves: how far a small input to a variable of a cell shifts a gait's phase.


@dataclass(frozen=True, eq=False, repr=False)
class PhaseResponse(ShortRepr):
    """The infinitesimal phase response curves of an orbit.

    Called with times it returns the cycles by which a unit impulse of each variable advances the
    phase.

    Attributes:
        orbit: the orbit.
        waveform: curve of a wave and a variable over theta in cycles; cell i has that of its wave
            at ``t/T + phi_i``.

    """

    orbit: Orbit
    waveform: Waveforms

    def _summary(self) -> str:
        return f'phase response of {self.orbit!r}'

    def __call__(self, times: np.ndarray) -> np.ndarray:
        """Return the responses at model times, cell 1 peaking at 0.

        Returns:
            Cycles per unit, shape times.shape + (cells, variables).

        """
        network = self.orbit.network
        out = self.orbit.of_cells(times, self.waveform)
        return out.reshape(*np.shape(times), network.variables, network.cells).swapaxes(-1, -2)


def phase_response(orbit: Orbit) -> PhaseResponse:
    """Solve for the phase response curves of an orbit.

    Args:
        orbit: of any network, stable or not.

    Raises:
        NoOrbit: the orbit is not isolated, as at a fold, or its response is too steep.

    """
    return PhaseResponse(orbit, orbit_method(orbit.network).floquet.adjoint(orbit))


#: POINTS: number of even points of a cycle over which averages are taken.
POINTS = 2048


def _over_a_cycle(response: PhaseResponse) -> np.ndarray:
    return response(np.arange(POINTS) / POINTS * response.orbit.period)


def locking(response: PhaseResponse) -> np.ndarray:
    """Return the half-width of the range in which a sinusoidal input locks a gait.

    Args:
        response: of the gait.

    Returns:
        Range of the gait's frequency, cycles per model time, for an input of amplitude 1 to the
            rate of each variable, shape (cells, variables); proportional to the amplitude.

    """
    return np.asarray(np.abs(np.fft.rfft(_over_a_cycle(response), axis=0)[1]) / POINTS)


def phase_diffusion(response: PhaseResponse, noise: float) -> float:
    """Return the phase diffusion coefficient D of a gait under weak white noise.

    Args:
        response: of the gait.
        noise: standard deviation per square root of model time, in every variable of every cell,
            as of ``simulate``.

    Returns:
        Half the rate at which the phase's variance grows, cycles squared per model time.

    """
    return float(0.5 * noise**2 * (_over_a_cycle(response)**2).sum(axis=(1, 2)).mean())

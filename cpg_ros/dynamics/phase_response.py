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

"""A gait reduced to its phase: what a weak periodic input, noise or another generator does to it.

To first order in a weak input p(t) to the rates, the phase in cycles obeys
``phi' = 1/T + Z(phi T) . p(t)``, Z the phase response. Averaged over a cycle, a sinusoidal input
locks it within a range of frequencies whose half-width is the harmonic of Z (Pikovsky, Rosenblum &
Kurths, *Synchronization*, ch. 7), white noise makes it diffuse, and another generator moves it by
a function of how far that is ahead (Kuramoto, *Chemical Oscillations, Waves, and Turbulence*).
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

from cpg_ros.common.errors import InputError, ShortRepr
from cpg_ros.dynamics.integration.simulate import simulate
from cpg_ros.dynamics.orbit import Orbit, Waveforms
from cpg_ros.dynamics.orbit_method import orbit_method
from cpg_ros.networks.equations import Field
from cpg_ros.networks.symmetry import Symmetry
import numpy as np
from numpy.polynomial import legendre
from scipy.special import chdtri

# Phase response curves: how far a small input to a variable of a cell shifts a gait's phase.

#: Gauss points of a panel of the integral over the history, and panels of a cycle.
_PLACES, _WEIGHTS = legendre.leggauss(12)
PANELS = 24


@dataclass(frozen=True, eq=False, repr=False)
class PhaseResponse(ShortRepr):
    """The infinitesimal phase response curves of an orbit.

    Called with times it gives the cycles by which a unit of each variable, added to it at once,
    advances the phase.

    Attributes:
        orbit: whose phase is shifted.
        waveform: the curve of a wave and a variable over theta in cycles, as an orbit's waveforms:
            cell i's is that of its wave at ``t/T + phi_i``.

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
        orbit = self.orbit
        theta = np.asarray(times, dtype=float)[..., None] / orbit.period + orbit.phases
        out = np.empty((*theta.shape, orbit.network.variables))
        for wave in range(int(orbit.waves.max()) + 1):
            cells = np.flatnonzero(orbit.waves == wave)
            for variable in range(orbit.network.variables):
                out[..., cells, variable] = self.waveform(theta[..., cells], wave, variable)
        return out

    def remembered(self, times: np.ndarray) -> np.ndarray:
        """Return the responses to what a delay later is made of the states at model times.

        A change of the history alone, ``dx(t + s)`` for -tau < s < 0, shifts the phase by the
        integral over it of these times dx; all 0 without a delay.

        Returns:
            Cycles per unit and model time, shape times.shape + (cells, variables).

        """
        orbit, network = self.orbit, self.orbit.network
        times = np.asarray(times, dtype=float)
        later = times + network.delay
        by_past = Field(network).linearised(orbit(later), orbit(times))[2]
        shape = (*times.shape, network.cells, network.variables)
        if not by_past.size:
            return np.zeros(shape)
        flat = self(later).swapaxes(-1, -2).reshape(*times.shape, network.components)
        heard = np.einsum('...i,...ij->...j', flat, by_past)
        return heard.reshape(*times.shape, network.variables, network.cells).swapaxes(-1, -2)

    def shift(self, time: float, motion: Callable[[np.ndarray], np.ndarray]) -> float:
        """Return by how many cycles a motion added to state and history advances the phase.

        Args:
            time: of the newest state, model time from a peak of cell 1 on.
            motion: of model times up to 0, that of the newest state, shape (n,), to what is added,
                shape (n, components); small, and smooth.

        """
        network, tau = self.orbit.network, self.orbit.network.delay
        panels = int(np.ceil(PANELS * tau / self.orbit.period))
        ends = -tau * np.arange(panels + 1) / max(panels, 1)
        times = (0.5 * (ends[:-1] + ends[1:])[:, None] + 0.5 * tau / max(panels, 1) * _PLACES)
        times = np.append(times.ravel(), 0.0)
        weights = np.append(np.tile(0.5 * tau / max(panels, 1) * _WEIGHTS, panels), 1.0)
        kernel = np.concatenate([self.remembered(time + times[:-1]),
                                 self(np.array([time]))])
        added = motion(times).reshape(-1, network.variables, network.cells).swapaxes(1, 2)
        return float(weights @ (kernel * added).sum(axis=(1, 2)))


def phase_response(orbit: Orbit) -> PhaseResponse:
    """Solve for the phase response curves of an orbit.

    Args:
        orbit: of any network, stable or not.

    Raises:
        NoOrbit: the orbit is not isolated, as at a fold, or its response is too steep.

    """
    return PhaseResponse(orbit, orbit_method(orbit.network).floquet.adjoint(orbit))


#: Even points of a cycle over which averages are taken, and at which simulations are kept.
POINTS, KEPT = 2048, 32
#: Rates that one generator adds to another: of states of that and of itself, (m, components).
Coupling = Callable[[np.ndarray, np.ndarray], np.ndarray]


class SimulatedDiffusion(NamedTuple):
    """A coefficient from simulations with the ends of its 95 % interval."""

    value: float
    low: float
    high: float


def _over_a_cycle(response: PhaseResponse) -> np.ndarray:
    return response(np.arange(POINTS) / POINTS * response.orbit.period)


def locking(response: PhaseResponse, periods: int = 1) -> np.ndarray:
    """Return the half-width of the range in which a sinusoidal input locks a gait.

    Args:
        response: of the gait.
        periods: of the input in a cycle of the gait.

    Returns:
        How far the gait's frequency follows, in cycles per model time, for an input of amplitude 1
        to the rate of each variable, shape (cells, variables); proportional to the amplitude.

    """
    if not 1 <= periods < POINTS // 2:
        raise InputError(f'{periods} periods of the input in a cycle: there must be at least 1')
    terms = np.fft.rfft(_over_a_cycle(response), axis=0)[periods] / POINTS
    return np.asarray(np.abs(terms))


def entrainment_range(response: PhaseResponse, cell: int, variable: str, amplitude: float,
                      periods: int = 1) -> tuple[float, float]:
    """Return the lowest and highest frequency of an input that locks a gait, to first order.

    Args:
        response: of the gait.
        cell: that the input reaches, from 1.
        variable: to whose rate ``amplitude cos(2 pi f t)`` is added.
        amplitude: in units of the variable per model time.
        periods: of the input in a cycle of the gait.

    Returns:
        The two edges of the Arnold tongue, f in cycles per model time.

    Raises:
        InputError: there is no such cell or variable.

    """
    network = response.orbit.network
    if not 1 <= cell <= network.cells:
        raise InputError(f'cell {cell} is not from 1 to {network.cells}')
    if variable not in network.states:
        raise InputError(f"'{variable}' is not one of {', '.join(network.states)}")
    half = abs(amplitude) * locking(response, periods)[cell - 1, network.states.index(variable)]
    middle = 1.0 / response.orbit.period
    return float(periods * (middle - half)), float(periods * (middle + half))


def phase_diffusion(response: PhaseResponse, noise: float) -> float:
    """Return the coefficient D by which weak white noise makes the phase diffuse.

    Args:
        response: of the gait.
        noise: standard deviation per square root of model time, in every variable of every cell,
            as of ``simulate``.

    Returns:
        Half the rate at which the phase's variance grows, in cycles squared per model time.

    """
    return float(0.5 * noise**2 * (_over_a_cycle(response)**2).sum(axis=(1, 2)).mean())


def simulated_diffusion(orbit: Orbit, noise: float, *, runs: int = 256, cycles: int = 40,
                        lock: tuple[float, Symmetry] | None = None, seed: int = 0
                        ) -> SimulatedDiffusion:
    """Estimate the same coefficient from simulations of the whole network.

    The phase is that of the first harmonic of cell 1 over a cycle; what else the noise does to it
    stays bounded, and counts the less the more cycles there are.

    Args:
        orbit: where the simulations start.
        noise: as of phase_diffusion.
        runs: number of simulations.
        cycles: of each simulation, after the first.
        lock: symmetry lock (gain in 1/model time, the gait's symmetry), or none.
        seed: of the noise.

    """
    every = max(1, int(np.ceil(2.0 * orbit.period / orbit.network.step / KEPT)))
    histories = ([orbit] * runs if orbit.network.delay
                 else np.repeat(orbit(np.zeros(1)), runs, axis=0))
    run = simulate(orbit.network, histories, (cycles + 1) * orbit.period,
                   orbit.period / (KEPT * every), every=every, noise=noise, lock=lock, seed=seed,
                   progress=False)
    signal = run.x[:, :KEPT * (cycles + 1), 0].reshape(runs, cycles + 1, KEPT)
    waves = signal @ np.exp(-2j * np.pi * np.arange(KEPT) / KEPT)
    turns = np.unwrap(np.angle(waves), axis=1) / (2.0 * np.pi)
    sizes = np.array([1.0, *(chdtri(runs - 1, p) / (runs - 1) for p in (0.025, 0.975))])
    spread = np.var(turns[:, -1] - turns[:, 0], ddof=1) / (2.0 * cycles * orbit.period)
    return SimulatedDiffusion(*(float(one) for one in spread / sizes))


def coupling_function(response: PhaseResponse, other: Orbit, coupling: Coupling,
                      leads: np.ndarray) -> np.ndarray:
    """Average what a coupling to another generator does to the phase over a cycle.

    With two generators of frequencies f and the functions H and H' of each, the second one's lead
    obeys ``lead' = f' - f + H'(-lead) - H(lead)``: where that is 0 and falls they stay together.

    Args:
        response: of the generator that the coupling moves.
        other: the other generator's orbit, of about the same period.
        coupling: what is added to the rates.
        leads: by how much the other one is ahead, cycles, shape (n,).

    Returns:
        H in cycles per model time, shape (n,).

    """
    orbit = response.orbit
    theta = np.arange(POINTS) / POINTS
    own, z = orbit(theta * orbit.period), _over_a_cycle(response).swapaxes(1, 2)
    z = z.reshape(POINTS, -1)
    return np.array([(z * coupling(other((theta + lead) * other.period), own)).sum(axis=1).mean()
                     for lead in leads])

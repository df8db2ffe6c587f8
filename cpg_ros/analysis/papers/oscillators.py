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

"""Oscillators of legs: Ijspeert et al. (2007), Righetti & Ijspeert (2008), Matsuoka (1985, 2011).

The formulas and statements on the oscillators in these papers, compared with the orbits; not the
figures of their robots.
"""

from collections.abc import Iterator
from dataclasses import replace
from typing import Any

from cpg_ros.analysis.papers.row import Citation, Paper, ReproducedRow
from cpg_ros.dynamics.arclength import NoOrbit
from cpg_ros.dynamics.floquet import multipliers
from cpg_ros.dynamics.integration.simulate import simulate
from cpg_ros.dynamics.solve_orbit import solve_orbit, solve_preset
from cpg_ros.networks.library.hopf import Hopf
from cpg_ros.networks.library.matsuoka import Matsuoka
from cpg_ros.networks.library.phase import Phase
import numpy as np
from scipy.integrate import quad

IJSPEERT, RIGHETTI, MATSUOKA = 'Ijspeert et al. 2007', 'Righetti & Ijspeert 2008', 'Matsuoka 1985'
TURN = 2.0 * np.pi


def synchronisation() -> Iterator[ReproducedRow]:
    """Compute the rows of phases, frequency and amplitudes of coupled phase oscillators."""
    cite = Citation(IJSPEERT, 'phases')
    for gait, preset in Phase.presets().items():
        if gait == Phase.unnamed:
            continue
        # Read the phases from the angles of the oscillators.
        state = solve_preset(preset)(np.zeros(()))
        yield cite.phases(f'phases that the {gait} settles in, as phi_ij has them',
                          ' '.join(f'{lead:.9f}' for lead in preset.network.leads),
                          np.arctan2(state[4:8], state[:4]) / TURN, within=1e-8)
    network: Any = Phase.presets()['walk'].network
    orbit = solve_orbit(network, 'walk')
    yield cite.formula('period', '1/nu', network.as_dict(), orbit.period)
    slowest = float(np.sort(np.abs(multipliers(orbit).within))[-1])
    yield cite.formula('what is left of a small phase difference after a stride, n = 4',
                       'exp(-n w R T)',
                       {'n': 4, 'w': network.w, 'R': network.r, 'T': 1.0 / network.nu}, slowest)


def amplitudes() -> Iterator[ReproducedRow]:
    """Amplitudes are critically damped."""
    cite = Citation(IJSPEERT, 'amplitudes')
    network: Any = Phase.presets()['trot'].network
    angle = TURN * np.array(network.leads)
    state = np.concatenate([0.5 * np.cos(angle), 0.5 * np.sin(angle), np.zeros(4)])
    run = simulate(network, state, 0.5, 0.001, progress=False)
    radii = np.hypot(run.x[[100, 250, 500], 0], run.x[[100, 250, 500], 4])
    half = 0.5 * network.a * run.t[[100, 250, 500]]
    yield cite.number('largest difference of an amplitude from R - (R - r0) (1 + a t/2) '
                      'exp(-a t/2), at t = 0.1, 0.25 and 0.5', '0', float(np.abs(
                          radii - 1.0 + 0.5 * (1.0 + half) * np.exp(-half)).max()), within=1e-9)


def stance_and_swing() -> Iterator[ReproducedRow]:
    """Durations of stance and swing of a Hopf oscillator alone."""
    cite = Citation(RIGHETTI, 'oscillator')
    for duty in (0.5, 0.6, 0.75):
        base: Any = Hopf.presets()['trot'].network
        network = _alone(replace(base, duty=duty, b=50.0))
        orbit = solve_orbit(network, 'trot')
        stance, swing = (np.pi * network.nu / fraction for fraction in (duty, 1.0 - duty))

        def slowness(angle: float, stance: float = stance, swing: float = swing) -> float:
            fraction = 0.5 + 0.5 * np.tanh(25.0 * np.sin(angle))
            return float(1.0 / (stance * fraction + swing * (1.0 - fraction)))

        spans = [quad(slowness, begin, begin + np.pi, points=[begin + 0.05, begin + np.pi - 0.05],
                      epsabs=1e-13)[0] for begin in (0.0, np.pi)]
        yield cite.formula(f'period at duty {duty:g}, b = 50', 'integral of 1/omega over a turn',
                           sum(spans), orbit.period)
        yield cite.formula(f'amplitude at duty {duty:g}', 'sqrt(mu)', network.as_dict(),
                           orbit.peak)
        yield cite.number(f'share of stance for omega_swing / omega_stance = '
                          f'{duty / (1.0 - duty):.4g}', f'{duty:g}', spans[0] / sum(spans),
                          within=0.01)


def neurons() -> Iterator[ReproducedRow]:
    """Two neurons with fatigue: onset, amplitude and frequency of their oscillation."""
    cite = Citation(MATSUOKA, 'two neurons')
    network = _alone(Matsuoka.presets()['trot'].network)
    tau, tau_v, beta = network.tau, network.tau_v, network.beta
    for a, exists in ((1.0 + tau / tau_v - 0.005, False), (1.0 + tau / tau_v + 0.005, True),
                     (1.0 + beta - 0.005, True), (1.0 + beta + 0.005, False)):
        yield cite.holds(f'a = {a:g}: they {"oscillate" if exists else "do not oscillate"}, as '
                         '1 + tau/tau_v < a < 1 + beta says', _oscillates(network, a) == exists)
    orbit, double = (solve_orbit(replace(network, c=c), 'trot') for c in (1.0, 2.0))
    yield cite.formula('amplitude with twice the input, over that with it', '2', {},
                       double.peak / orbit.peak)
    slow = solve_orbit(replace(network, tau=2.0 * tau, tau_v=2.0 * tau_v), 'trot')
    yield cite.formula('period with twice the time constants, over that with them', '2', {},
                       slow.period / orbit.period)


def frequency() -> Iterator[ReproducedRow]:
    """Compute the rows of the frequency formula by harmonic balance, exact and approximate."""
    cite = Citation(MATSUOKA, 'frequency (2011)')
    base = _alone(Matsuoka.presets()['trot'].network)
    for a, within in ((1.26, 0.001), (1.5, 0.005), (2.0, 0.015)):
        network = replace(base, a=a)
        ours = TURN / solve_orbit(network, 'trot').period
        yield cite.number(f'omega at a = {a:g}, tau/tau_v = 0.25, beta = 2.5',
                          f'{network.omega:.4f}', ours, within=within * ours,
                          note='by harmonic balance: exact where the oscillation is born')


def _alone(network: Any) -> Any:
    """Return the network with uncoupled legs."""
    return replace(network, **dict.fromkeys(network.couplings, 0.0))


def _oscillates(network: Any, a: float) -> bool:
    try:
        return bool(solve_orbit(replace(network, a=a), 'trot'))
    except NoOrbit:
        return False


PAPERS = (
    Paper('ijspeert', IJSPEERT, 'A. J. Ijspeert, A. Crespi, D. Ryczko, J.-M. Cabelguen: From '
          'swimming to walking with a salamander robot driven by a spinal cord model (2007)',
          (synchronisation, amplitudes)),
    Paper('righetti_ijspeert', RIGHETTI, 'L. Righetti, A. J. Ijspeert: Pattern generators with '
          'sensory feedback for the control of quadruped locomotion (2008)', (stance_and_swing,)),
    Paper('matsuoka', MATSUOKA, 'K. Matsuoka: Sustained oscillations generated by mutually '
          'inhibiting neurons with adaptation (1985); Analysis of a neural oscillator (2011)',
          (neurons, frequency)))

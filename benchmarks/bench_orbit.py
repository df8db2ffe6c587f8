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

"""The gaits' orbits by collocation against two ways of finding the same orbit without it.

One is simulation: the symmetry-locked network runs until two successive periods agree. The other
is scipy's general root finder on the same discretised problem, without our Jacobian and starting
from the same first harmonic. Accuracy: the residual of all eight equations between the nodes, and
the periods against the ones established beforehand (docs/numbers_and_errata.md, section Orbits
of the delayed network).
"""

from functools import partial

from common import by_turns, emit, log
from cpg_ros.dynamics.hopf import first_hopf
from cpg_ros.dynamics.integration.simulate import simulate
from cpg_ros.dynamics.orbit import Orbit
from cpg_ros.dynamics.solve_orbit import solve_orbit
from cpg_ros.networks.library.delayed import PRESETS
from cpg_ros.networks.network import Preset
import numpy as np
from scipy.optimize import brentq, root

#: Preset -> period, to eight decimals. The legs' phases differ, the waveforms are two.
PERIODS = {'trot': 1.27827056, 'pace': 1.27827056, 'bound': 1.27827056, 'pronk': 1.27827056,
           'walk': 1.09048163, 'jump': 1.09048163, 'liu2024_trot': 1.27827056,
           'liu2024_walk': 1.09048163, 'liu2024_pace': 2.04780069,
           'goat_slope_walk': 0.86761962}
GAITS = ('walk', 'trot', 'pace', 'bound', 'jump', 'pronk')
TARGETS = {'ms': 3.0, 'residual': 1e-10, 'period_error': 1e-7}
ROUNDS, REPEATS = 10, 15
NODES = 63


def residual(orbit: Orbit) -> float:
    """Largest residual of eq. 1.1, written out, at instants that are no collocation nodes."""
    a, b, c, d, tau = orbit.network.as_dict().values()
    times = (np.arange(2003) + np.sqrt(0.5)) * (orbit.period / 2003)
    x, past = orbit(times), orbit(times - tau)
    across = past[:, [1, 0, 3, 2, 5, 4, 7, 6]]
    right = (a * x + b * np.tanh(x) + d * np.tanh(np.roll(x, 2, axis=1)) + c * np.tanh(across))
    return float(np.abs(orbit.derivative(times) - right).max())


def by_simulation(preset: Preset) -> float:
    """Period, from the last two upward zero crossings of cell 1 once they agree to 1e-8."""
    network, mode = preset.network, preset.network.symmetry(preset.gait)
    omega = first_hopf(network, preset.gait).omega

    def history(times: np.ndarray) -> np.ndarray:
        return 0.9 * np.cos(omega * times[:, None] + 2.0 * np.pi * mode.phases)

    end = 16.0
    while True:
        run = simulate(network, history, end, 0.0025, progress=False,
                       lock=(network.sufficient_gain(0.5), mode))
        up = np.flatnonzero((run.x[:-1, 0] < 0.0) & (run.x[1:, 0] >= 0.0))[-3:]
        first, second = np.diff([
            brentq(lambda t, run=run: run(t)[0, 0], run.t[i], run.t[i + 1], xtol=1e-13)
            for i in up])
        if abs(second - first) < 1e-8:
            return float(second)
        end *= 1.5


def by_root_finder(preset: Preset) -> float:
    """Period, by MINPACK's hybrid method with differences for derivatives."""
    network, mode = preset.network, preset.network.symmetry(preset.gait)
    a, b, c, d, tau = network.as_dict().values()
    shifts = {name: float(shift) for name, shift in mode.shifts}
    waves = 2j * np.pi * np.arange(NODES // 2 + 1)

    def equations(unknowns: np.ndarray) -> np.ndarray:
        u, period = unknowns[:-1], unknowns[-1]
        spectrum = np.fft.rfft(u)
        turns = (waves, np.exp(-waves * shifts['omega']),
                 np.exp(waves * (shifts['kappa'] - tau / period)))
        slope, ring, past = (np.fft.irfft(spectrum * turn, NODES) for turn in turns)
        rest = (slope / period - a * u - b * np.tanh(u) - d * np.tanh(ring) - c * np.tanh(past))
        return np.append(rest, slope[0])

    wave = 0.9 * np.cos(2.0 * np.pi * np.arange(NODES) / NODES)
    start = np.append(wave, 2.0 * np.pi / first_hopf(network, preset.gait).omega)
    found = root(equations, start, tol=1e-12)
    return float(found.x[-1])


def main() -> None:
    presets = {name: PRESETS[name] for name in GAITS}
    found = {name: solve_orbit(PRESETS[name].network, PRESETS[name].gait) for name in PERIODS}
    errors = {name: abs(found[name].period - period) for name, period in PERIODS.items()}
    residuals = {name: residual(orbit) for name, orbit in found.items()}
    ways = {'simulation': by_simulation, 'root_finder': by_root_finder}
    peer_errors = {way: max(abs(run(preset) - PERIODS[name])
                            for name, preset in presets.items()) for way, run in ways.items()}
    log(f'periods of the peers are off by at most {peer_errors}')

    contestants = {}
    for name, preset in presets.items():
        contestants[name] = (partial(solve_orbit, preset.network, preset.gait), REPEATS)
        for way, run in ways.items():
            contestants[f'{name} by {way}'] = (partial(run, preset), 1)
    spent = by_turns(contestants, ROUNDS)
    gaits = {name: {**spent[name], 'residual': residuals[name],
                    'period': f'{found[name].period:.8f}', 'period_error': errors[name],
                    **{way: spent[f'{name} by {way}'] for way in ways},
                    **{f'speedup_over_{way}': spent[f'{name} by {way}']['best']
                       / spent[name]['best'] for way in ways}} for name in presets}
    worst = {'ms': max(spent[name]['median'] for name in presets),
             'residual': max(residuals.values()), 'period_error': max(errors.values())}
    emit(benchmark='orbit', gaits_ms=gaits, worst_best_ms=max(spent[n]['best'] for n in presets),
         worst_median_ms=worst['ms'], residual=worst['residual'],
         period_error=worst['period_error'], period_error_peers=peer_errors, targets=TARGETS,
         passed=all(worst[key] <= goal for key, goal in TARGETS.items()))


if __name__ == '__main__':
    main()

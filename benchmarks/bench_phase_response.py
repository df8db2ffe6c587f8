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

"""Phase response curves by the adjoint, against the orbit's own solve and direct perturbation.

The peer is what one does without the adjoint: kicks to every variable of every cell at some phases
of the orbit, to either side, each simulated until all but the shift of the phase has decayed. With
a delay a kick to the newest state is a ramp over the step before, for what is heard later; steps
are parts of the delay, and the differences are extrapolated to steps of no length.
"""

import math
import time

from common import emit, log
from cpg_ros.dynamics.floquet import multipliers
from cpg_ros.dynamics.integration.simulate import simulate
from cpg_ros.dynamics.orbit import Orbit
from cpg_ros.dynamics.phase_response import phase_response
from cpg_ros.dynamics.solve_orbit import solve_beside, solve_preset
from cpg_ros.dynamics.stability import stability
from cpg_ros.networks.registry import PRESETS
import numpy as np

GAITS = {'delayed': ('walk', 'pronk', 'goat_trot', 'goat_slope_walk', 'liu2024_pace'),
         'quadruped': ('pace', 'trot', 'jump', 'walk'),
         'biped': ('walk', 'run', 'skip', 'gallop', 'one_legged_hop'),
         'hopf': ('trot', 'walk'), 'phase': ('canter_left',)}
TIMES, SIZE, ROUNDS = np.array([0.05, 0.41, 0.83]), 3e-4, 15
#: The orbit's solve starts from one at parameters this fraction away, next to it.
BESIDE = 1e-3
TARGETS = {'difference': 1e-4, 'ratio_to_orbit': 1.0}


class Kicked:
    """An orbit from a time on as a history, its newest state changed."""

    def __init__(self, orbit: Orbit, begin: float, change: np.ndarray) -> None:
        self.orbit, self.begin, self.change = orbit, begin, change

    def __call__(self, times):
        return self.orbit(self.begin + times) + np.where(times[:, None] == 0.0, self.change, 0.0)

    def derivative(self, times):
        return self.orbit.derivative(self.begin + times)


def directly(orbit: Orbit, step: float) -> np.ndarray:
    """Return the phase response at TIMES by simulation, shape (times, cells, variables)."""
    network, gain = orbit.network, stability(orbit).lock_gain
    leading = multipliers(orbit, gain).leading
    cycles = math.ceil(math.log(1e-8) / math.log(max(leading, 1e-4)))
    steps, unit = math.ceil(cycles * orbit.period / step), np.eye(network.components)
    times = np.repeat(TIMES * orbit.period, len(unit))
    starts = [Kicked(orbit, begin, side * SIZE * unit[k % len(unit)])
              for k, begin in enumerate(times) for side in (1.0, -1.0)]
    run = simulate(network, starts if network.delay else [one(np.zeros(1))[0] for one in starts],
                   steps * step, step, lock=(gain, orbit.symmetry), every=steps, progress=False)
    ends = run.x[:, -1].reshape(len(times), 2, -1)
    slopes = orbit.derivative(times + steps * step)
    found = (((ends[:, 0] - ends[:, 1]) * slopes).sum(axis=1) / (slopes**2).sum(axis=1)
             / (2.0 * SIZE * orbit.period))
    return found.reshape(TIMES.size, network.variables, network.cells).swapaxes(1, 2)


def measured(orbit: Orbit) -> np.ndarray:
    """Return directly() with steps short enough."""
    network = orbit.network
    if not network.delay:
        return directly(orbit, 0.5 * network.step)
    parts = math.ceil(network.delay / network.step)
    one, two, four = (directly(orbit, network.delay / (n * parts)) for n in (1, 2, 4))
    return (8.0 * four - 6.0 * two + one) / 3.0


def cpu_ms(call, rounds: int) -> float:
    """Median CPU time of a call in ms."""
    spent = []
    for _ in range(rounds):
        began = time.process_time()
        call()
        spent.append(1e3 * (time.process_time() - began))
    return float(np.median(spent))


def main() -> None:
    rows = {}
    for network, gaits in GAITS.items():
        for gait in gaits:
            orbit = solve_preset(PRESETS[network][gait])
            own = orbit.network
            # The first parameter that the orbit's size or period depends on.
            name = own.couplings[0] if own.delay_parameter == '' else own.delay_parameter
            near = solve_beside(own.replace(**{name: getattr(own, own.members(name)[0])
                                               * (1.0 + BESIDE)}), orbit)
            mine = phase_response(orbit)(TIMES * orbit.period)
            # Both are compiled by now.
            peer = measured(orbit)
            began = time.process_time()
            directly(orbit, own.delay / math.ceil(own.delay / own.step) if own.delay
                     else 0.5 * own.step)
            direct_ms = 1e3 * (time.process_time() - began)
            orbit_ms = cpu_ms(lambda own=own, near=near: solve_beside(own, near), ROUNDS)
            response_ms = cpu_ms(lambda orbit=orbit: phase_response(orbit), ROUNDS)
            rows[f'{network} {gait}'] = {
                'difference': float(np.abs(mine - peer).max() / np.abs(mine).max()),
                'orbit_ms': orbit_ms, 'response_ms': response_ms, 'direct_ms': direct_ms}
            log(f'{network} {gait}: {rows[f"{network} {gait}"]}')
    emit(benchmark='phase_response', orbits=len(rows), gaits=rows,
         peer='kicks to simulations, at 3 phases',
         difference=max(row['difference'] for row in rows.values()),
         ratio_to_orbit=max(row['response_ms'] / row['orbit_ms'] for row in rows.values()),
         ratio=min(row['direct_ms'] / row['response_ms'] for row in rows.values()),
         targets=TARGETS)


if __name__ == '__main__':
    main()

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

"""Floquet multipliers of the delayed network's gaits: ours against growth measured in simulation.

The peer is what one does without them: two runs from the orbit, disturbed to either side outside
its class, for so many strides that the fastest disturbance stands alone; the ratio of its last two
strides is the leading transverse multiplier. Ours gives all of them, the trivial one among them.
"""

import time

from common import by_turns, emit, log
from cpg_ros.dynamics.floquet import multipliers, smallest_gain
from cpg_ros.dynamics.integration.simulate import simulate
from cpg_ros.dynamics.solve_orbit import solve_preset
from cpg_ros.networks.library.delayed import PRESETS
import numpy as np

ROUNDS, STEPS = 20, 400
TARGETS = {'agreement': 1e-3, 'trivial_error': 1e-6}


class Disturbed:
    """An orbit as a history, with a small constant disturbance outside its class."""

    def __init__(self, orbit, size):
        shape = np.array([1.0, 0.5, 0.7, 1.1, -0.3, 1.2, 0.4, 0.9])
        basis = orbit.symmetry.basis
        self.orbit, self.more = orbit, size * (shape - basis.T @ (basis @ shape))

    def __call__(self, times):
        return self.orbit(times) + self.more

    def derivative(self, times):
        return self.orbit.derivative(times)


def by_simulation(orbit, strides: int) -> float:
    """Return the leading transverse multiplier, by the growth of a disturbance."""
    size = 1e-4 * 3.0**-strides
    runs = simulate(orbit.network, [Disturbed(orbit, side * size) for side in (1.0, -1.0)],
                    strides * orbit.period, orbit.period / STEPS, every=STEPS)
    apart = np.linalg.norm(runs.x[0] - runs.x[1], axis=1)
    return float(apart[-1] / apart[-2])


def main() -> None:
    rows = {}
    for name in ('walk', 'trot', 'liu2024_pace'):
        log(name)
        orbit = solve_preset(PRESETS[name])
        found, measured = multipliers(orbit), by_simulation(orbit, 14)
        times = by_turns({'ours': (lambda orbit=orbit: multipliers(orbit), 1),
                          'peer': (lambda orbit=orbit: by_simulation(orbit, 14), 1)}, ROUNDS)
        began = time.perf_counter()
        gain = smallest_gain(orbit)
        rows[name] = {
            'ours_ms': times['ours']['median'], 'peer_ms': times['peer']['median'],
            'leading_transverse': found.leading_transverse, 'measured': measured,
            'trivial_error': abs(found.trivial - 1.0), 'smallest_gain': gain,
            'smallest_gain_ms': 1e3 * (time.perf_counter() - began)}
    emit(benchmark='floquet', gaits=rows, peer='growth over 14 strides of simulation',
         agreement=max(abs(row['measured'] / row['leading_transverse'] - 1.0)
                       for row in rows.values()),
         trivial_error=max(row['trivial_error'] for row in rows.values()),
         ratio=min(row['peer_ms'] / row['ours_ms'] for row in rows.values()), targets=TARGETS)


if __name__ == '__main__':
    main()

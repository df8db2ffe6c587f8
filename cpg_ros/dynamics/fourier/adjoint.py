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

"""The adjoint of the variational equation along a gait of a network with a delay, spectrally.

The orbit's collocation equations have the slope along the orbit as right null vector; the left one
is the periodic adjoint at the same nodes. It is the last row of the inverse of the Jacobian that
Newton's method has: what each equation's residual does to the period.
"""

from cpg_ros.dynamics.fourier import collocation
from cpg_ros.dynamics.fourier.newton import equations, MOST_NODES
from cpg_ros.dynamics.fourier.orbit import FourierOrbit
from cpg_ros.dynamics.periodic import NoOrbit, NOT_ISOLATED, Waveforms
import numpy as np

#: The adjoint is resolved when its last harmonics are this small.
RESOLVED = 1e-9


def adjoint(orbit: FourierOrbit) -> Waveforms:
    """Return the adjoint's waveforms, in cycles per unit of each variable.

    Raises:
        NoOrbit: the orbit is not isolated, or more nodes would be needed than there may be.

    """
    symmetry = orbit.symmetry
    u = orbit.values.reshape(-1, orbit.samples)
    alike = np.repeat(np.bincount(symmetry.waves), orbit.network.variables)[:, None]
    while True:
        rows, n = u.shape
        _, jacobian, _ = equations(orbit.network, symmetry, u, orbit.period)
        last = np.zeros(rows * n + 1)
        last[-1] = 1.0
        try:
            by_residual = np.linalg.solve(jacobian.T, last)[:-1].reshape(u.shape)
        except np.linalg.LinAlgError as error:
            raise NoOrbit(NOT_ISOLATED) from error
        # A rate p added to one wave at all times changes 1/T by the mean of z p over its cells.
        values = -n * by_residual / (alike * orbit.period**2)
        if max(collocation.tail(row) for row in values) <= RESOLVED:
            break
        if n >= MOST_NODES:
            raise NoOrbit(f'the phase response is too steep for {MOST_NODES} nodes')
        u = np.array([collocation.resample(row, 2 * n + 1) for row in u])
    variables = orbit.network.variables

    def waveform(theta: np.ndarray, wave: int = 0, variable: int = 0) -> np.ndarray:
        return collocation.evaluate(values[wave * variables + variable], theta)

    return waveform

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

"""The disturbance of an orbit that belongs to a real Floquet multiplier, as a function of time.

With a delay the multiplier's eigenvector is a history; the variational equation takes it through a
period, after which it is the multiplier times as large.
"""

from collections.abc import Callable

from cpg_ros.dynamics.fourier.floquet import variation
from cpg_ros.dynamics.fourier.orbit import FourierOrbit
import numpy as np


def mode(orbit: FourierOrbit, part: int, multiplier: complex
         ) -> Callable[[np.ndarray], np.ndarray]:
    """Return the disturbance with a multiplier, of size 1 at most.

    Args:
        orbit: of a network with a delay.
        part: 0 for the gait's class, then the subspaces transverse to it, as in floquet.
        multiplier: about that of the disturbance, real and not the trivial one.

    Returns:
        States, shape (points, components), as a function of times in cycles, shape (points,).

    """
    equation = variation(orbit)[0]
    columns = (equation.inside, *equation.outside)[part]
    size, through = equation.march(columns, 0.0)
    roots, vectors = np.linalg.eig(equation.period_map(columns, 0.0)[1](np.eye(size)))
    gaps = np.abs(roots - multiplier)
    if part == 0:
        # The disturbance along the orbit.
        gaps[np.abs(roots - 1.0).argmin()] = np.inf
    nearest = gaps.argmin()
    values = through(vectors[:, [nearest]].real)
    values /= np.abs(values).max()
    nu = float(roots[nearest].real)

    def path(theta: np.ndarray) -> np.ndarray:
        turns = np.floor(theta)
        times = (theta - turns) * orbit.period / equation.length
        return nu**turns[:, None] * equation.read(values, times)[..., 0] @ columns.T

    return path

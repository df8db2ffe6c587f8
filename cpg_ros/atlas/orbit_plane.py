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

"""A gait's orbits over the plane of an atlas, and their multipliers by subspace."""

from cpg_ros.atlas.chart import Chart
from cpg_ros.atlas.row_job import subspace_multipliers
from cpg_ros.dynamics.orbit import NoOrbit, Orbit, solve_beside
import numpy as np

#: Tolerances of multipliers, and halvings of the elements.
ARNOLDI, TRIVIAL, HALVINGS = 1e-12, 1e-8, 5


def spectrum(orbit: Orbit) -> list[np.ndarray]:
    """Multipliers of each subspace, largest first; that of the class first, without 1."""
    return [part[np.argsort(-np.abs(part), kind='stable')]
            for part in subspace_multipliers(orbit, ARNOLDI, TRIVIAL, HALVINGS)]


class OrbitPlane:
    """Orbits over the plane, each solved beside the last one."""

    def __init__(self, chart: Chart, gait: str) -> None:
        """Take the plane; the first orbit is set as the last."""
        self.chart, self.gait = chart, gait
        self.last: Orbit | None = None

    def orbit(self, share: np.ndarray) -> Orbit:
        """Solve at a point given in shares of the ranges.

        Raises:
            NoOrbit: there is none beside the last one.

        """
        assert self.last is not None
        found = solve_beside(self.chart.at_share(share), self.last)
        if found.levels[0, 0, 1] < 0.3 * self.last.levels[0, 0, 1]:
            raise NoOrbit('the orbit has shrunk')
        return found

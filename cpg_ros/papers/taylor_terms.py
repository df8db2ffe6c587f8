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

"""Liu & Zhang (2024), section 2: the Taylor terms F_2 and F_3 of the delayed network.

They are held against the exact derivatives of the network's own equations, at one history drawn
at random.
"""

from collections.abc import Iterator

from cpg_ros.dynamics.expansion import Expansion
from cpg_ros.networks.delayed import Delayed
from cpg_ros.networks.equations import equations_of
from cpg_ros.papers.row import Citation, Picture, ReproducedRow
import numpy as np

AUTHORS = 'Liu & Zhang 2024'
#: Of the cubes in row i of F_3, cells from 1: own, behind on the same side, across a delay ago.
BEHIND = (7, 8, 3, 2, 3, 4, 5, 6)
#: Erratum 25: in the third row it should be this cell.
THIRD = 1


def taylor_terms() -> Iterator[ReproducedRow | Picture]:
    """F_2 and F_3 as printed after eq. 2.2."""
    at = Citation(AUTHORS, 'section 2')
    network = Delayed.presets()['liu2024_walk'].network
    assert isinstance(network, Delayed)
    rng = np.random.default_rng(2024)
    now, past, mu = rng.uniform(-1.0, 1.0, 8), rng.uniform(-1.0, 1.0, 8), 0.3
    a, b, c, d, tau = network.as_dict().values()
    expansion, across = Expansion(network, np.zeros(1)), np.arange(8) ^ 1

    def cubes(cell: int, behind: int) -> float:
        """Return a row of F_3 as printed, with some cell behind."""
        return -tau / 3.0 * (b * now[cell]**3 + d * now[behind - 1]**3 + c * past[across[cell]]**3)

    def third_derivative(cell: int) -> float:
        heard = np.array([(past if one.delayed else now)[
            cell if one.source is None else one.source[cell]]
            for one in equations_of(Delayed).arguments])
        return tau * float(expansion.third(heard, heard, heard)[0].real)

    for cell, behind in enumerate(BEHIND):
        value, wrong = cubes(cell, behind), cell == 2
        yield at.formula(f'row {cell + 1} of F_3 as printed, and of F_3/3!',
                         f'-tau/3 (b phi_{cell + 1}^3 + d phi_{behind}^3 + '
                         f'c phi_{across[cell] + 1}^3(-1))', value, third_derivative(cell) / 6.0,
                         erratum=(25, cubes(cell, THIRD)) if wrong else None)
    yield at.formula('row 1 of F_3, where F = F_2/2! + F_3/3!', 'as printed', cubes(0, 7),
                     third_derivative(0), erratum=(25, 6.0 * cubes(0, 7)))
    # (tau + mu) L phi has mu L phi as its second-order part in (mu, phi): half of F_2.
    linear = network.jacobian(np.zeros(8)) @ now
    delayed = network.rates(np.zeros(8), 1e-6 * past) / 1e-6
    second = mu * float((linear + delayed)[0])
    value = mu * ((a + b) * now[0] + d * now[6] + c * past[1])
    yield at.formula('row 1 of F_2, where F = F_2/2! + F_3/3!', 'as printed', value, 2.0 * second,
                     erratum=(25, 2.0 * value))

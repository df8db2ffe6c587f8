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

"""Selection of the method that solves for orbits.

Fourier collocation takes any delay, Gauss collocation on a mesh any steepness. Each is a folder
with the same functions.
"""

from types import ModuleType
from typing import NamedTuple

from cpg_ros.dynamics.fourier import floquet as fourier_floquet
from cpg_ros.dynamics.fourier import solve as fourier_solve
from cpg_ros.dynamics.mesh import floquet as mesh_floquet
from cpg_ros.dynamics.mesh import solve as mesh_solve
from cpg_ros.networks.network import Network


class OrbitMethod(NamedTuple):
    """Two modules with the same functions: one solves for orbits, one judges their stability."""

    solve: ModuleType
    floquet: ModuleType


FOURIER = OrbitMethod(fourier_solve, fourier_floquet)
MESH = OrbitMethod(mesh_solve, mesh_floquet)


def orbit_method(network: Network) -> OrbitMethod:
    """Return how a network's orbits are found, followed and judged."""
    return FOURIER if network.delay_parameter else MESH

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

"""Gaits as exact periodic orbits, for every network.

This is the one place that chooses between the two ways to solve for them: Fourier collocation,
which takes any delay, and Gauss collocation on a mesh, which takes any steepness. Each is a folder
with the same functions; what they solve for are orbits and curves that know what to do.
"""

from collections.abc import Callable
from types import ModuleType
from typing import Any, NamedTuple

from cpg_ros.dynamics.fourier import curve as fourier_curve
from cpg_ros.dynamics.fourier import floquet as fourier_floquet
from cpg_ros.dynamics.fourier import mode as fourier_mode
from cpg_ros.dynamics.fourier import solve as fourier_solve
from cpg_ros.dynamics.mesh import curve as mesh_curve
from cpg_ros.dynamics.mesh import floquet as mesh_floquet
from cpg_ros.dynamics.mesh import mode as mesh_mode
from cpg_ros.dynamics.mesh import solve as mesh_solve
from cpg_ros.dynamics.periodic import NoOrbit, Orbit
from cpg_ros.networks.network import Network, Preset
from cpg_ros.networks.parameter_line import ParameterLine
from cpg_ros.networks.symmetry import Symmetry
import numpy as np

__all__ = [
    'NoOrbit',
    'Orbit',
    'curve_beside',
    'curve_through',
    'orbit_method',
    'solve_beside',
    'solve_from_path',
    'solve_orbit',
    'solve_preset',
]


class OrbitMethod(NamedTuple):
    """Modules with the same functions, which find, follow and judge orbits."""

    solve: ModuleType
    curve: ModuleType
    floquet: ModuleType
    mode: ModuleType


FOURIER = OrbitMethod(fourier_solve, fourier_curve, fourier_floquet, fourier_mode)
MESH = OrbitMethod(mesh_solve, mesh_curve, mesh_floquet, mesh_mode)


def orbit_method(network: Network) -> OrbitMethod:
    """Return how a network's orbits are found, followed and judged."""
    return FOURIER if network.delay_parameter else MESH


def solve_orbit(network: Network, gait: str, near: Orbit | None = None) -> Orbit:
    """Solve for the gait's orbit, with exact derivatives by every parameter.

    Args:
        network: parameters.
        gait: one of the network's gaits.
        near: an orbit of that gait of the same kind of network to start from; by default, where
            the network has no delay, that of the shipped preset.

    Raises:
        InputError: an unknown gait, or parameters that are not finite or a delay not positive.
        NoOrbit: this set has no such orbit, or none was found; the message says how far off
            the parameters are.

    """
    found: Orbit = orbit_method(network).solve.solve(network, gait, near)
    return found


def solve_beside(network: Network, near: Orbit) -> Orbit:
    """Solve for the orbit next to a known one of the same symmetry, by Newton's method alone.

    Args:
        network: parameters.
        near: the known orbit.

    Raises:
        NoOrbit: the method leads elsewhere; a shorter way may do.

    """
    found: Orbit = orbit_method(network).solve.beside(network, near)
    return found


def solve_preset(preset: Preset) -> Orbit:
    """Solve for a preset's orbit; errors as in solve_orbit."""
    found: Orbit = orbit_method(preset.network).solve.from_preset(preset)
    return found


def solve_from_path(network: Network, symmetry: Symmetry,
                    path: Callable[[np.ndarray], np.ndarray], period: float) -> Orbit | None:
    """Solve for an orbit from a guess; None where Newton's method leads to none.

    Args:
        network: parameters.
        symmetry: of the gait.
        path: states, shape (m, components), as a function of times in cycles, shape (m,), that
            begin where cell 1 peaks.
        period: in model time.

    """
    found: Orbit | None = orbit_method(network).solve.from_path(network, symmetry, path, period)
    return found


def curve_through(orbit: Orbit, line: ParameterLine, scales: tuple[float, float]
                  ) -> tuple[Any, np.ndarray]:
    """Return the curve of a gait's orbits along a line of parameters, and the orbit's place on it.

    Args:
        orbit: of a network on the line.
        line: of parameters.
        scales: against which periods and values on the line are measured.

    """
    curve, place = orbit_method(orbit.network).curve.through(orbit, line, scales)
    return curve, place


def curve_beside(network: Network, symmetry: Symmetry, line: ParameterLine,
                 scales: tuple[float, float], path: Callable[[np.ndarray], np.ndarray],
                 disturbance: Callable[[np.ndarray], np.ndarray], period: float
                 ) -> tuple[Any, np.ndarray, np.ndarray]:
    """Return the curve of the orbits that leave a state or an orbit, that on it, and how.

    Args:
        network: at the place.
        symmetry: of the orbits.
        line: of parameters.
        scales: against which periods and values on the line are measured.
        path: states of what they leave, shape (m, components), over times in cycles.
        disturbance: the direction in which they leave it, the same.
        period: of the orbits, model time.

    """
    curve, point, border = orbit_method(network).curve.beside(network, symmetry, line, scales,
                                                              path, disturbance, period)
    return curve, point, border

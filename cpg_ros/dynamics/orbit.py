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

"""Gaits as exact periodic orbits, for every network."""

from collections.abc import Callable, Sequence
from functools import lru_cache

from cpg_ros.dynamics.branch_orbits import branch_orbits
from cpg_ros.dynamics.orbit_method import orbit_method
from cpg_ros.dynamics.periodic import NoOrbit, Orbit, richer
from cpg_ros.networks.network import Network, Preset
from cpg_ros.networks.symmetry import Symmetry
import numpy as np

__all__ = [
    'NoOrbit',
    'Orbit',
    'solve_beside',
    'solve_from_path',
    'solve_orbit',
    'solve_preset',
]


def solve_orbit(network: Network, gait: str, near: Orbit | None = None) -> Orbit:
    """Solve for one orbit of the gait, with exact derivatives by every parameter.

    A gait may have several: ``coexisting_orbits`` finds them and which of them attract.

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
    preset = network.presets().get(gait)
    try:
        found: Orbit = orbit_method(network).solve.solve(network, gait, near)
        return found
    except NoOrbit as error:
        if near is not None or (preset is not None and preset.start is not None):
            raise
        return _from_hopf_point(network, gait, error)


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


@lru_cache(maxsize=64)
def solve_preset(preset: Preset) -> Orbit:
    """Solve for a preset's orbit; errors as in solve_orbit."""
    try:
        found: Orbit = orbit_method(preset.network).solve.from_preset(preset)
        return found
    except NoOrbit as error:
        if preset.start is not None:
            raise
        return _from_hopf_point(preset.network, preset.gait, error)


def _from_hopf_point(network: Network, gait: str, error: NoOrbit) -> Orbit:
    """Return the first orbit on the branches of the equilibrium's Hopf points, or raise."""
    if not network.delay_parameter:
        for orbits in branch_orbits(network, gait):
            for orbit in orbits:
                if not richer(orbit):
                    return orbit
    raise error


def solve_from_path(network: Network, symmetry: Symmetry,
                    path: Callable[[np.ndarray], np.ndarray], period: float,
                    known: Sequence[float] = ()) -> Orbit | None:
    """Solve for an orbit from a guess; None where Newton's method leads to none.

    Args:
        network: parameters.
        symmetry: of the gait.
        path: states, shape (m, components), as a function of times in cycles, shape (m,), that
            begin where cell 1 peaks.
        period: in model time.
        known: periods, model time, of orbits that Newton's method is to be kept off.

    """
    found: Orbit | None = orbit_method(network).solve.from_path(network, symmetry, path, period,
                                                                known)
    return found

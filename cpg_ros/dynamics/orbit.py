"""Gaits as exact periodic orbits, for every network.

This is the one place that chooses between the two ways to solve for them: Fourier collocation,
which takes any delay, and Gauss collocation on a mesh, which takes any steepness. Each is a folder
with the same functions; what they solve for are orbits and curves that know what to do.
"""

from types import ModuleType
from typing import Any

import numpy as np

from cpg_ros.dynamics.fourier import curve as fourier_curve
from cpg_ros.dynamics.fourier import solve as fourier_solve
from cpg_ros.dynamics.mesh import curve as mesh_curve
from cpg_ros.dynamics.mesh import solve as mesh_solve
from cpg_ros.dynamics.periodic import NoOrbit, Orbit
from cpg_ros.networks.network import Network, Preset
from cpg_ros.networks.parameter_line import ParameterLine
from cpg_ros.networks.symmetry import Symmetry

__all__ = ['NoOrbit', 'Orbit', 'curve_from_rest', 'solve_beside', 'solve_orbit', 'solve_preset']


def _way(network: Network) -> tuple[ModuleType, ModuleType]:
    """How a network's orbits are found, and followed."""
    if network.delay_parameter:
        return fourier_solve, fourier_curve
    return mesh_solve, mesh_curve


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
    found: Orbit = _way(network)[0].solve(network, gait, near)
    return found


def solve_beside(network: Network, near: Orbit) -> Orbit:
    """Solve for the orbit next to a known one of the same symmetry, by Newton's method alone.

    Args:
        network: parameters.
        near: the known orbit.

    Raises:
        NoOrbit: the method leads elsewhere; a shorter way may do.

    """
    found: Orbit = _way(network)[0].beside(network, near)
    return found


def solve_preset(preset: Preset) -> Orbit:
    """Solve for a preset's orbit; errors as in solve_orbit."""
    found: Orbit = _way(preset.network)[0].from_preset(preset)
    return found


def curve_from_rest(network: Network, symmetry: Symmetry, line: ParameterLine,
                    scales: tuple[float, float], rest: np.ndarray, vector: np.ndarray,
                    period: float) -> tuple[Any, np.ndarray, np.ndarray]:
    """Return the curve of the orbits born at a Hopf point, rest on it, and the oscillation.

    Args:
        network: at the Hopf point.
        symmetry: of the critical class.
        line: of parameters.
        scales: against which periods and values on the line are measured.
        rest: the equilibrium, shape (components,).
        vector: critical eigenvector, complex, shape (components,), that of cell 1's first
            variable 1.
        period: of the critical oscillation, model time.

    """
    curve, point, border = _way(network)[1].from_rest(network, symmetry, line, scales, rest,
                                                      vector, period)
    return curve, point, border

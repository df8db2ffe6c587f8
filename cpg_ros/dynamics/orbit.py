"""Gaits as exact periodic orbits, for every network."""

from cpg_ros.dynamics import cell_orbit, delayed_orbit
from cpg_ros.dynamics.delayed_orbit import DelayedOrbit
from cpg_ros.dynamics.mesh_orbit import MeshOrbit
from cpg_ros.dynamics.periodic import NoOrbit, Orbit
from cpg_ros.networks.delayed import Delayed
from cpg_ros.networks.network import Network, Preset

__all__ = ['NoOrbit', 'Orbit', 'solve_orbit', 'solve_preset']


def solve_orbit(network: Network, gait: str, near: Orbit | None = None) -> Orbit:
    """Solve for the gait's orbit, with exact derivatives by every parameter.

    Args:
        network: parameters.
        gait: one of the network's gaits.
        near: an orbit of that gait to start from; by default, where the network has no delay,
            that of the shipped preset.

    Raises:
        ValueError: an unknown gait, or parameters that are not finite or a delay not positive.
        NoOrbit: this set has no such orbit, or none was found; the message says how far off
            the parameters are.

    """
    if isinstance(network, Delayed):
        return delayed_orbit.solve(network, gait,
                                   near if isinstance(near, DelayedOrbit) else None)
    return cell_orbit.solve(network, gait, near if isinstance(near, MeshOrbit) else None)


def solve_preset(preset: Preset) -> Orbit:
    """Solve for a preset's orbit; errors as in solve_orbit."""
    if preset.start is None:
        return solve_orbit(preset.network, preset.gait)
    return cell_orbit.from_preset(preset)

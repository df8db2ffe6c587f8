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

"""Finding the orbit of a gait of a network without delay, from the nearest one known.

From the given start Newton's method is tried at once; failing that, the network is left to find
its gait by itself, held in its symmetry, from there and from many other states; failing that, the
orbit is followed from the known parameters to the wanted ones, which also tells how far it exists.
Where no orbit is known, those that are unstable within their class are followed from Hopf points.
"""

from collections.abc import Callable
from dataclasses import replace
from functools import lru_cache

from cpg_ros.dynamics.equilibrium import NoEquilibrium
from cpg_ros.dynamics.mesh.adaptation import collocate as from_path
from cpg_ros.dynamics.mesh.adaptation import predicted
from cpg_ros.dynamics.mesh.orbit import MeshOrbit
from cpg_ros.dynamics.periodic import check_values, NoOrbit, Orbit, richer
from cpg_ros.dynamics.seek import find_orbit, settle
from cpg_ros.integration.simulate import simulate
from cpg_ros.networks.network import Network, Preset
from cpg_ros.networks.symmetry import Symmetry
import numpy as np

#: A peak this much lower than the highest, over that, is another one.
SAME = 1e-6


def _accepted(orbit: MeshOrbit | None) -> MeshOrbit | None:
    return orbit if orbit is not None and not richer(orbit) else None


@lru_cache(maxsize=64)
def from_preset(preset: Preset) -> MeshOrbit:
    """Solve for a preset's orbit from its start.

    Raises:
        NoOrbit: the start does not lead to an orbit of the gait.

    """
    network = preset.network
    check_values(network, preset.gait)
    symmetry = network.symmetry(preset.gait)
    if preset.start is None:
        return _stated(network, preset.gait) or _sought(network, preset.gait)
    start = np.array(preset.start)
    orbit = _from_state(network, symmetry, start, preset.period)
    if orbit is None:
        orbit = _by_itself(network, symmetry, start, preset.period)
    if orbit is None:
        raise NoOrbit(f'no {preset.gait} was found from the start given')
    return orbit


def _from_state(network: Network, symmetry: Symmetry, start: np.ndarray, period: float
                ) -> MeshOrbit | None:
    """Collocate from what a simulation does in a period from a state near the orbit."""
    run = simulate(network, start, 1.05 * period, network.step, progress=False)
    return _accepted(from_path(network, symmetry, lambda theta: run(theta * period), period))


def _stated(network: Network, gait: str) -> MeshOrbit | None:
    """The orbit near which the network knows a state; None where it knows none."""
    known = network.on_orbit(gait)
    if known is None:
        return None
    symmetry = network.symmetry(gait)
    found = _from_state(network, symmetry, *known)
    # Phase 0 is the highest peak, to which a state that is only near need not lead.
    if found is None or found.peak - found.waveform(np.zeros(1))[0] > SAME * found.peak:
        return _by_itself(network, symmetry, *known)
    return found


def _sought(network: Network, gait: str) -> MeshOrbit:
    orbit = _settled(network, gait)
    if orbit is None:
        # Hopf points are looked at, too, before anybody reads this: see orbit.solve_orbit.
        raise NoOrbit(f'no {gait} was found at these parameters, neither by simulations from '
                      f'states about the equilibrium nor from a Hopf point along {network.line}')
    return orbit


def _settled(network: Network, gait: str) -> MeshOrbit | None:
    """Return what the network settles on from many states of the gait's class."""
    symmetry = network.symmetry(gait)
    try:
        found = (_accepted(from_path(network, symmetry, *one)) for one in find_orbit(network,
                                                                                     gait))
        return next((orbit for orbit in found if orbit is not None), None)
    except NoEquilibrium:
        return None


def _by_itself(network: Network, symmetry: Symmetry, start: np.ndarray, period: float
               ) -> MeshOrbit | None:
    found = settle(network, symmetry, start, period)
    return None if found is None else _accepted(from_path(network, symmetry, *found))


def _on_cycles(orbit: Orbit) -> Callable[[np.ndarray], np.ndarray]:
    return lambda theta: orbit(theta * orbit.period)


def _followed(known: MeshOrbit, network: Network) -> tuple[MeshOrbit | None, float]:
    """Follow an orbit along the line to other parameters; also return the share reached."""
    start, end = known.network.as_dict(), network.as_dict()
    orbit, reached, step = known, 0.0, 0.25
    # A failure costs more than a success, so steps shrink fast.
    while reached < 1.0 and step > 0.003:
        share = min(1.0, reached + step)
        here = replace(network, **{key: start[key] + share * (end[key] - start[key])
                                   for key in start})  # type: ignore[type-var]
        found = _accepted(from_path(here, known.symmetry, _on_cycles(orbit), orbit.period))
        # A jump to another branch would be no continuation.
        if found is None or not 0.5 < found.period / orbit.period < 2.0:
            step *= 0.25
            continue
        orbit, reached, step = found, share, 1.5 * step
    return (orbit if reached >= 1.0 else None), reached


def beside(network: Network, near: MeshOrbit) -> MeshOrbit:
    """Solve for the orbit next to a known one of the same symmetry, by Newton's method alone.

    Raises:
        NoOrbit: the method leads elsewhere; a shorter way may do.

    """
    found = _accepted(predicted(network, near))
    if found is None:
        found = _accepted(from_path(network, near.symmetry, _on_cycles(near), near.period))
    if found is None or not 0.5 < found.period / near.period < 2.0:
        raise NoOrbit('no orbit next to the known one')
    return found


def solve(network: Network, gait: str, near: MeshOrbit | None = None) -> MeshOrbit:
    """Solve for the gait's orbit, with exact derivatives by every parameter.

    Args:
        network: parameters.
        gait: one of the network's.
        near: an orbit of the same gait to start from; the shipped preset's if not given.

    Raises:
        ValueError: an unknown gait, or parameters that are not finite.
        NoOrbit: none was found; the message says how far from the known one it exists.

    """
    symmetry = network.symmetry(gait)
    check_values(network, gait)
    stated = _stated(network, gait)
    if stated is not None:
        return stated
    if near is None:
        near = _of_preset(network, gait) or _sought(network, gait)
    if near.network == network and near.symmetry == symmetry:
        return near
    if near.symmetry == symmetry:
        try:
            return beside(network, near)
        except NoOrbit:
            # Not near enough.
            pass
    start = near(np.array(0.0))
    if near.symmetry != symmetry and near.symmetry.h == symmetry.h:
        # A wave that runs the other way: the same signals with other phases.
        start = _states(near, symmetry)
    orbit = _by_itself(network, symmetry, start, near.period) or _settled(network, gait)
    if orbit is not None:
        return orbit
    if near.symmetry == symmetry:
        orbit, reached = _followed(near, network)
        if orbit is not None:
            return orbit
        changed = ', '.join(
            f'{name} {known + reached * (value - known):.4g}' for (name, value), known
            in zip(network.as_dict().items(), near.network.as_dict().values(), strict=True)
            if value != known)
        raise NoOrbit(f'no {gait} at these parameters: on the way to them from its preset it ends '
                      f'at {changed}')
    raise NoOrbit(f'no {gait} at these parameters')


def _of_preset(network: Network, gait: str) -> MeshOrbit | None:
    """Return the orbit of the gait's preset, if it has one."""
    known = network.presets().get(gait)
    # One without a start is sought, as the gait of the network itself is.
    if known is None or (known.start is None and known.network == network):
        return None
    try:
        return from_preset(known)
    except NoOrbit:
        return None


def _states(orbit: MeshOrbit, symmetry: Symmetry) -> np.ndarray:
    """State at phase 0 of the orbit's waveforms with the phases of another symmetry."""
    cells = orbit.network.cells
    out = np.empty(orbit.network.components)
    for cell in range(cells):
        for variable in range(orbit.network.variables):
            out[cell + variable * cells] = orbit.waveform(
                np.array(symmetry.phases[cell]), 0, int(symmetry.waves[cell]), variable)
    return out

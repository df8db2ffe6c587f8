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

"""Finding the orbit of a gait of a network with a delay: from another, or from its onset."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import lru_cache

from cpg_ros.dynamics.delay_crossings import critical_delay, frequencies
from cpg_ros.dynamics.fourier.newton import newton, NODES, rows_of
from cpg_ros.dynamics.fourier.orbit import FourierOrbit
from cpg_ros.dynamics.hopf_point import first_hopf
from cpg_ros.dynamics.periodic import check_values, NoOrbit
from cpg_ros.dynamics.seek import find_orbit
from cpg_ros.networks.equations import equations_of, values_of
from cpg_ros.networks.network import Network, Preset
from cpg_ros.networks.symmetry import Symmetry
import numpy as np

#: Points of a cycle on which describing functions are worked out.
POINTS = 32
THETA = np.arange(NODES) / NODES


def _delayed(network: Network, delay: float) -> Network:
    return replace(network, **{network.delay_parameter: delay})  # type: ignore[type-var]


Describing = Callable[[float], tuple[complex, complex]]


@lru_cache(maxsize=8)
def _describing(network: Network, symmetry: Symmetry) -> Describing:
    """Return A and B of ``lambda = A + B exp(-lambda tau)`` as functions of an amplitude.

    Each cell's rate by its first harmonic where all cells are amplitude * cos, with their
    phases: at this amplitude the network is, to first harmonic, a linear one.
    """
    kind, cosine = equations_of(type(network)), np.cos(np.arange(POINTS) * (2.0 * np.pi / POINTS))
    p = [value[0] if value.ndim else value for value in values_of(network)]
    # One row for each argument, in which all others are at rest.
    rows = np.eye(len(kind.arguments))[..., None] * cosine
    first = [0 if one.source is None else one.source[0] for one in kind.arguments]
    turns = np.exp(2j * np.pi * (symmetry.phases[first] - symmetry.phases[0]))
    late = np.array([one.delayed for one in kind.arguments])
    cosine = cosine * (2.0 / POINTS)

    def terms(amplitude: float) -> tuple[complex, complex]:
        gains = kind.rates(list(amplitude * rows), p)[0] @ cosine / amplitude * turns
        return complex(gains[~late].sum()), complex(gains[late].sum())

    return terms


def _first_harmonic(network: Network, symmetry: Symmetry) -> tuple[np.ndarray, float] | None:
    """Waveform and period by harmonic balance; for one variable a cell that swings about 0."""
    describing = _describing(network, symmetry)

    def onset(amplitude: float) -> tuple[float, float]:
        a, b = describing(amplitude)
        omegas = frequencies(a, b)
        return (critical_delay(a, b, omegas[0]), omegas[0]) if omegas else (1e3, 0.0)

    def excess(amplitude: float) -> float:
        return onset(amplitude)[0] - network.delay

    low, high = 0.0, 1e-3
    while excess(high) < 0.0:
        low, high = high, 2.0 * high
        if high > 1e3:
            return None
    low = max(low, 1e-6)
    if excess(low) >= 0.0:
        return None
    # Bisection suffices for a guess, and spares a generator's start the loading of an optimizer.
    while high - low > 1e-3 * high:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if excess(middle) < 0.0 else (low, middle)
    omega = onset(high)[1]
    if not omega:
        return None
    return high * np.cos(2.0 * np.pi * THETA)[None], 2.0 * np.pi / omega


def _guess(network: Network, gait: str) -> tuple[np.ndarray, float] | None:
    """Waveforms and period near onset."""
    symmetry = network.symmetry(gait)
    if _simple(network, symmetry):
        return _first_harmonic(network, symmetry)
    point = first_hopf(network, gait)
    if point is None or (network.delay - point.value) * point.normal_form.side <= 0.0:
        return None
    return (rows_of(network, symmetry, point.path(network.delay, THETA)),
            point.period(network.delay))


def _accepted(orbit: FourierOrbit | None) -> FourierOrbit | None:
    return orbit if orbit is not None and orbit.values[0, 0].argmax() == 0 else None


def _continued(network: Network, gait: str, onset: float) -> FourierOrbit | None:
    """Follow the orbit in the delay from near its onset, halving steps that fail."""
    delay, reached = network.delay, onset
    ahead = onset + 0.1 * (delay - onset)
    orbit, tries = None, 0
    while reached < delay and tries < 10:
        tries += 1
        here = _delayed(network, ahead)
        guess = _guess(here, gait) if orbit is None else predicted(here, orbit)
        found = None if guess is None else _accepted(newton(here, network.symmetry(gait), *guess))
        if found is None:
            ahead = reached + 0.4 * (ahead - reached)
            continue
        reached, orbit = ahead, found
        ahead = min(delay, reached + 1.6 * max(ahead - reached, 0.1 * (delay - onset)))
    return orbit if reached >= delay else None


def predicted(network: Network, near: FourierOrbit) -> tuple[np.ndarray, float]:
    """Waveforms and period that the derivatives of a known orbit predict for a near network."""
    change = np.subtract([*network.as_dict().values()], [*near.network.as_dict().values()])
    u = near.values + near.d_values @ change
    return u.reshape(-1, u.shape[-1]), near.period + float(near.d_period @ change)


def beside(network: Network, near: FourierOrbit) -> FourierOrbit:
    """Solve for the orbit next to a known one of the same symmetry, by Newton's method alone.

    Raises:
        NoOrbit: the method leads elsewhere; a shorter way may do.

    """
    found = _accepted(newton(network, near.symmetry, *predicted(network, near)))
    if found is None or not 0.5 < found.period / near.period < 2.0:
        raise NoOrbit('no orbit next to the known one')
    return found


def from_path(network: Network, symmetry: Symmetry, path: Callable[[np.ndarray], np.ndarray],
              period: float, known: Sequence[float] = ()) -> FourierOrbit | None:
    """Solve for an orbit from a guess, states over times in cycles; None where none is found."""
    try:
        u = rows_of(network, symmetry, path(THETA))
        return _accepted(newton(network, symmetry, u, period, known))
    except NoOrbit:
        return None


def from_preset(preset: Preset) -> FourierOrbit:
    """Solve for a preset's orbit; errors as in solve."""
    return solve(preset.network, preset.gait)


def solve(network: Network, gait: str, near: FourierOrbit | None = None) -> FourierOrbit:
    """Solve for the gait's orbit, with exact derivatives by every parameter.

    Args:
        network: parameters.
        gait: one of the network's.
        near: an orbit of that gait to start from; where it leads nowhere it does not matter.

    Raises:
        InputError: an unknown gait, or parameters that are not finite or a delay not positive.
        NoOrbit: this set has no such orbit; the message names the threshold.

    """
    symmetry = network.symmetry(gait)
    check_values(network, gait)
    obstacle = network.obstacle(gait)
    if obstacle:
        raise NoOrbit(obstacle)
    name, delay, onset = network.delay_parameter, network.delay, _onset(network, gait)
    simple = _simple(network, symmetry)
    if simple and onset is not None and delay <= onset:
        raise NoOrbit(f"{name} {delay:g} is below the {gait}'s critical delay {onset:.4f}")
    if near is not None and near.symmetry == symmetry:
        try:
            return beside(network, near)
        except NoOrbit:
            # Not near enough.
            pass
    reason = 'no orbit was found'
    try:
        guess = _guess(network, gait)
        orbit = None if guess is None else _accepted(newton(network, symmetry, *guess))
        if orbit is None and onset is not None and delay > onset:
            orbit = _continued(network, gait, onset)
        if orbit is None and not simple:
            found = (from_path(network, symmetry, *one) for one in find_orbit(network, gait))
            orbit = next((one for one in found if one is not None), None)
        if orbit is not None:
            return orbit
    except NoOrbit as error:
        reason = str(error)
    far = '' if onset is None else f', far from its critical delay {onset:.4f}'
    raise NoOrbit(f'no {gait} at {name} {delay:g}{far}: {reason}')


def _simple(network: Network, symmetry: Symmetry) -> bool:
    """Whether cells have one variable and swing about 0: then harmonic balance tells the onset."""
    return symmetry.odd and network.variables == 1


def _onset(network: Network, gait: str) -> float | None:
    """Return the gait's first critical delay."""
    symmetry = network.symmetry(gait)
    if _simple(network, symmetry):
        a, b = _describing(network, symmetry)(1e-9)
        omegas = frequencies(a, b)
        return critical_delay(a, b, omegas[0]) if omegas else None
    point = first_hopf(network, gait)
    return None if point is None else point.value

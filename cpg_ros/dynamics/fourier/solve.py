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

"""Solution for the orbit of a gait with a delay, from another orbit or from its onset."""

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import lru_cache, partial

from cpg_ros.common.errors import ShortRepr
from cpg_ros.dynamics.arclength import NoOrbit
from cpg_ros.dynamics.characteristic import critical_delay, frequencies
from cpg_ros.dynamics.fourier import orbit as collocation
from cpg_ros.dynamics.fourier import pieces
from cpg_ros.dynamics.fourier.orbit import (
    Basis,
    by_parameter,
    complete,
    converge,
    equations,
    FourierOrbit,
    HARMONIC_TOLERANCE,
    MAX_NODES,
    Nodes,
    NUM_NODES,
    rows_of,
)
from cpg_ros.dynamics.hopf import first_hopf
from cpg_ros.dynamics.orbit import check_values, Path
from cpg_ros.dynamics.settling import find_orbit
from cpg_ros.networks.equations import equations_of, values_of
from cpg_ros.networks.network import Network, ParameterLine, Preset
from cpg_ros.networks.symmetry import Symmetry
import numpy as np


@dataclass(frozen=True, eq=False, repr=False)
class FourierCurve(ShortRepr):
    """Orbits by waveforms: unknowns u at n nodes of each row, T, and the value on the line.

    Attributes:
        network: any on the line.
        symmetry: of the gait.
        along: the line.
        scales: of period and value.
        sizes: of the variables.

    """

    network: Network
    symmetry: Symmetry
    along: ParameterLine
    scales: tuple[float, float]
    sizes: np.ndarray

    def _rows(self, z: np.ndarray) -> np.ndarray:
        """Return the waveforms, a row for each variable of each wave, shape (rows, n)."""
        return z[:-2].reshape((int(self.symmetry.waves.max()) + 1) * self.network.variables, -1)

    def product(self, first: np.ndarray, second: np.ndarray) -> float:
        """Mean over the cycle and the rows plus period plus value."""
        return float(self._weights(first.size) * first @ second)

    def _weights(self, size: int) -> np.ndarray:
        rows = (int(self.symmetry.waves.max()) + 1) * self.network.variables
        each = np.resize(self.sizes**-2.0, rows).repeat((size - 2) // rows) / (size - 2)
        return np.append(each, np.array(self.scales)**-2.0)

    def step(self, z: np.ndarray, border: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Newton's increment normal to the border, and the tangent."""
        network = self.along.at(self.network, z[-1])
        residual, jacobian, point = equations(network, self.symmetry, self._rows(z), float(z[-2]))
        matrix = np.zeros((z.size, z.size))
        matrix[:-1, :-1] = jacobian
        slopes = by_parameter(network, self.symmetry, point)
        matrix[:-1, -1] = slopes @ self.along.direction(network)
        matrix[-1] = self._weights(z.size) * border
        right = np.zeros((z.size, 2))
        right[:-1, 0], right[-1, 1] = -residual, 1.0
        solutions = np.linalg.solve(matrix, right)
        return solutions[:, 0], solutions[:, 1]

    def amplitude(self, z: np.ndarray) -> float:
        """Half the range of cell 1's first variable over its size; the peak in an odd network."""
        row = self._rows(z)[0] / self.sizes[0]
        return float(row[0] if self.symmetry.odd else 0.5 * np.ptp(row))

    def renewed(self, z: np.ndarray, border: np.ndarray, again: bool
                ) -> tuple['FourierCurve', np.ndarray, np.ndarray] | None:
        """Double the nodes where the waveforms need it, and start at cell 1's highest peak."""
        rows = self._rows(z)
        n = rows.shape[1]
        fine = collocation.resample(rows[0], 4 * n)
        start = (0.0 if fine.max() <= rows[0, 0] + 1e-9 * np.ptp(rows[0])
                 else fine.argmax() / (4 * n))
        more = max(collocation.tail(row) for row in rows) > HARMONIC_TOLERANCE
        if not more and not start:
            return None
        if more and n >= MAX_NODES:
            raise NoOrbit(f'the waveform is too steep for {MAX_NODES} nodes')
        nodes = 2 * n + 1 if more else n
        theta = start + np.arange(nodes) / nodes
        moved = [np.concatenate([*(collocation.evaluate(row, theta) for row in self._rows(vector)),
                                 vector[-2:]]) for vector in (z, border)]
        return self, moved[0], moved[1]

    def orbit(self, z: np.ndarray) -> FourierOrbit:
        """Complete a solution by its derivatives and its residual."""
        network, u, period = self.along.at(self.network, float(z[-1])), self._rows(z), float(z[-2])
        return complete(network, self.symmetry, u, period,
                        *equations(network, self.symmetry, u, period)[1:])


def through(orbit: FourierOrbit, line: ParameterLine, scales: tuple[float, float],
            sizes: np.ndarray) -> tuple[FourierCurve, np.ndarray]:
    """Return the curve of the orbits along a line, and the unknowns of one of them."""
    return (FourierCurve(orbit.network, orbit.symmetry, line, scales, sizes),
            np.append(rows_of(orbit.network, orbit.symmetry, orbit.cycle(orbit.samples)),
                      [orbit.period, line.value(orbit.network)]))


def curve_beside(network: Network, symmetry: Symmetry, line: ParameterLine,
                 scales: tuple[float, float], sizes: np.ndarray, path: Path, disturbance: Path,
                 period: float) -> tuple[FourierCurve, np.ndarray, np.ndarray]:
    """Return the curve of the orbits that branch off, the old solution on it and the tangent.

    Args:
        network: at the bifurcation.
        symmetry: of the new orbits.
        line: of parameters.
        scales: as of the curve.
        sizes: as of the curve.
        path: the old solution.
        disturbance: its critical disturbance.
        period: of the new orbits, model time.

    """
    theta = np.arange(NUM_NODES) / NUM_NODES
    return (FourierCurve(network, symmetry, line, scales, sizes),
            np.append(rows_of(network, symmetry, path(theta)), [period, line.value(network)]),
            np.append(rows_of(network, symmetry, disturbance(theta)), [0.0, 0.0]))


def newton(network: Network, symmetry: Symmetry, u: np.ndarray, period: float,
           periods: Sequence[float] = ()) -> FourierOrbit | None:
    """Solve by Newton's method from a guess, doubling the nodes until waveforms are resolved.

    Args:
        network: parameters.
        symmetry: of the gait.
        u: guess at the waveforms on the nodes, shape (rows, n).
        period: guess, model time.
        periods: of orbits to keep away from, model time.

    Raises:
        NoOrbit: the waveforms need more nodes than are allowed, and cannot be solved on a mesh.

    """
    while True:
        solved = converge(network, symmetry, u, period, Nodes(u.shape[1]), periods)
        if solved is None:
            return None
        u, period = solved.u, solved.period
        if max(collocation.tail(row) for row in u) <= HARMONIC_TOLERANCE:
            return complete(network, symmetry, *solved)
        if u.shape[1] >= MAX_NODES:
            return _steep(network, symmetry, Nodes(u.shape[1]), u, period)
        u, periods = np.array([collocation.resample(row, 2 * row.size + 1) for row in u]), ()


def _steep(network: Network, symmetry: Symmetry, basis: Basis, u: np.ndarray, period: float
           ) -> FourierOrbit:
    """Solve on a mesh from a guess on a basis.

    Raises:
        NoOrbit: Newton's method fails, or more intervals are needed than are allowed.

    """
    orbit = pieces.solve(network, symmetry, lambda theta: np.array(
        [basis.evaluate(row, theta, 0) for row in u]), period)
    if orbit is None:
        raise NoOrbit(f'the waveform is too steep for {MAX_NODES} nodes and for '
                      f'{pieces.MAX_INTERVALS} intervals')
    return orbit


#: Points of a cycle at which describing functions are computed.
POINTS = 32
THETA = np.arange(NUM_NODES) / NUM_NODES


def _delayed(network: Network, delay: float) -> Network:
    return replace(network, **{network.delay_parameter: delay})  # type: ignore[type-var]


#: By how much the start may miss cell 1's peak, over its range.
PEAK_TOLERANCE = 1e-8
Describing = Callable[[float], tuple[complex, complex]]


@lru_cache(maxsize=8)
def _describing(network: Network, symmetry: Symmetry) -> Describing:
    """Return A and B of ``lambda = A + B exp(-lambda tau)`` as functions of an amplitude.

    They are the first harmonic of a cell's rate where all cells are amplitude * cos with their
    phases (describing functions).
    """
    kind, cosine = equations_of(type(network)), np.cos(np.arange(POINTS) * (2.0 * np.pi / POINTS))
    p = [value[0] if value.ndim else value for value in values_of(network)]
    # One row for each argument, in which all others are 0.
    rows = np.eye(len(kind.arguments))[..., None] * cosine
    first = [0 if argument.source is None else argument.source[0] for argument in kind.arguments]
    phasors = np.exp(2j * np.pi * (symmetry.phases[first] - symmetry.phases[0]))
    late = np.array([argument.delayed for argument in kind.arguments])
    cosine = cosine * (2.0 / POINTS)

    def terms(amplitude: float) -> tuple[complex, complex]:
        gains = kind.rates(list(amplitude * rows), p)[0] @ cosine / amplitude * phasors
        return complex(gains[~late].sum()), complex(gains[late].sum())

    return terms


def _first_harmonic(network: Network, symmetry: Symmetry) -> tuple[np.ndarray, float] | None:
    """Return waveform and period by harmonic balance; for one variable that swings about 0."""
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
    # Bisection suffices for a guess, and the generator need not load scipy's optimizers.
    while high - low > 1e-3 * high:
        middle = 0.5 * (low + high)
        low, high = (middle, high) if excess(middle) < 0.0 else (low, middle)
    omega = onset(high)[1]
    if not omega:
        return None
    return high * np.cos(2.0 * np.pi * THETA)[None], 2.0 * np.pi / omega


def _guess(network: Network, gait: str) -> tuple[np.ndarray, float] | None:
    """Return the waveforms and period near onset."""
    symmetry = network.symmetry(gait)
    if _simple(network, symmetry):
        return _first_harmonic(network, symmetry)
    point = first_hopf(network, gait)
    if point is None or (network.delay - point.value) * point.normal_form.side <= 0.0:
        return None
    return (rows_of(network, symmetry, point.path(network.delay, THETA)),
            point.period(network.delay))


def _accepted(orbit: FourierOrbit | None) -> FourierOrbit | None:
    """Return the orbit if cell 1 peaks at the first node."""
    if orbit is None:
        return None
    first = orbit.values[0, 0]
    return orbit if first[0] >= first.max() - PEAK_TOLERANCE * np.ptp(first) else None


def _continued(network: Network, gait: str, onset: float) -> FourierOrbit | None:
    """Follow the orbit in the delay from near its onset, halving steps that fail."""
    delay, reached = network.delay, onset
    ahead = onset + 0.1 * (delay - onset)
    orbit, tries = None, 0
    while reached < delay and tries < 10:
        tries += 1
        here = _delayed(network, ahead)
        guess = None if orbit else _guess(here, gait)
        try:
            solved = beside(here, orbit) if orbit else guess and _accepted(
                newton(here, network.symmetry(gait), *guess))
        except NoOrbit:
            solved = None
        if solved is None:
            ahead = reached + 0.4 * (ahead - reached)
            continue
        reached, orbit = ahead, solved
        ahead = min(delay, reached + 1.6 * max(ahead - reached, 0.1 * (delay - onset)))
    return orbit if reached >= delay else None


def predicted(network: Network, near: FourierOrbit) -> tuple[np.ndarray, float]:
    """Predict waveforms and period of a nearby network by the derivatives of a known orbit."""
    change = np.subtract([*network.as_dict().values()], [*near.network.as_dict().values()])
    u = near.values + near.d_values @ change
    return u.reshape(-1, u.shape[-1]), near.period + float(near.d_period @ change)


def beside(network: Network, near: FourierOrbit) -> FourierOrbit:
    """Solve for the orbit next to a known one of the same symmetry, by Newton's method alone.

    Raises:
        NoOrbit: the method leads elsewhere; a shorter step may succeed.

    """
    method = newton if isinstance(near.basis, Nodes) else partial(_steep, basis=near.basis)
    u, period = predicted(network, near)
    orbit = _accepted(method(network, near.symmetry, u=u, period=period))
    if orbit is None or not 0.5 < orbit.period / near.period < 2.0:
        raise NoOrbit('no orbit next to the known one')
    return orbit


#: Size of a guess's last harmonics, over the largest, that needs more nodes, or a mesh.
TAIL_THRESHOLD = 1e-3


def from_path(network: Network, symmetry: Symmetry, path: Path, period: float,
              periods: Sequence[float] = ()) -> FourierOrbit | None:
    """Solve for an orbit from a guess, as solve_orbit.solve_from_path."""
    def rows(theta: np.ndarray) -> np.ndarray:
        return rows_of(network, symmetry, path(theta % 1.0))

    n, orbit = NUM_NODES, None
    while (not periods and n < MAX_NODES
           and max(map(collocation.tail, rows(np.arange(n) / n))) > TAIL_THRESHOLD):
        n = 2 * n + 1
    with suppress(NoOrbit):
        orbit = _accepted(newton(network, symmetry, rows(np.arange(n) / n), period, periods))
    # The phase of a plateau is no peak's.
    return orbit or (None if n == NUM_NODES else _accepted(
        pieces.solve(network, symmetry, rows, period)))


def from_preset(preset: Preset) -> FourierOrbit:
    """Solve for a preset's orbit; errors as in solve."""
    return solve(preset.network, preset.gait)


def solve(network: Network, gait: str, near: FourierOrbit | None = None) -> FourierOrbit:
    """Solve for the gait's orbit, with exact derivatives by every parameter.

    Args:
        network: parameters.
        gait: one of the network's.
        near: an orbit of that gait to start from; if it fails, it is ignored.

    Raises:
        InputError: an unknown gait, or parameters that are not finite or a delay not positive.
        NoOrbit: this set has no such orbit; the message names the threshold.

    """
    symmetry = network.symmetry(gait)
    check_values(network, gait)
    validate_gait = network.validate_gait(gait)
    if validate_gait:
        raise NoOrbit(validate_gait)
    name, delay, onset = network.delay_parameter, network.delay, _onset(network, gait)
    simple = _simple(network, symmetry)
    if simple and onset is not None and delay <= onset:
        raise NoOrbit(f"{name} {delay:g} is below the {gait}'s critical delay {onset:.4f}")
    if near is not None and near.symmetry == symmetry:
        try:
            return beside(network, near)
        except NoOrbit:
            # The known orbit is not near enough: solve from the onset.
            pass
    reason = 'no orbit was found'
    try:
        guess = _guess(network, gait)
        orbit = None if guess is None else _accepted(newton(network, symmetry, *guess))
        if orbit is None and onset is not None and delay > onset:
            orbit = _continued(network, gait, onset)
        if orbit is None and not simple:
            orbits = (from_path(network, *guess) for guess in find_orbit(network, gait))
            orbit = next((candidate for candidate in orbits if candidate is not None), None)
        if orbit is not None:
            return orbit
    except NoOrbit as error:
        reason = str(error)
    far = '' if onset is None else f', far from its critical delay {onset:.4f}'
    raise NoOrbit(f'no {gait} at {name} {delay:g}{far}: {reason}')


def _simple(network: Network, symmetry: Symmetry) -> bool:
    """Return whether cells have one variable that oscillates about 0, for harmonic balance."""
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

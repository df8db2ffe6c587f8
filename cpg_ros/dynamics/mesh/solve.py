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

"""Solution for the orbit of a gait without delay, from the nearest known orbit.

Newton's method starts at the given orbit. If it fails, simulations locked to the gait's symmetry
start there and at many other states. If these fail, the orbit is continued from the known
parameters, which also shows how far it exists. Without a known orbit, orbits that are unstable
within their class are continued from Hopf points.
"""

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import lru_cache

from cpg_ros.common.errors import ShortRepr
from cpg_ros.dynamics.arclength import NoOrbit
from cpg_ros.dynamics.equilibrium import NoEquilibrium
from cpg_ros.dynamics.integration.simulate import simulate
from cpg_ros.dynamics.mesh import collocation
from cpg_ros.dynamics.mesh.collocation import aligned, sign_changes
from cpg_ros.dynamics.mesh.orbit import (
    bordered,
    coefficients_of,
    columns_of,
    completed,
    finer,
    FIRST_INTERVALS,
    first_mesh,
    linearised,
    MeshOrbit,
    MIN_INTERVALS,
    newton,
    path_of,
    Reduced,
    remeshed,
    sampled,
    Solution,
)
from cpg_ros.dynamics.orbit import check_values, extra_symmetry, Orbit, Path
from cpg_ros.dynamics.settling import find_orbit, settle
from cpg_ros.networks.network import Network, ParameterLine, Preset
from cpg_ros.networks.symmetry import Symmetry
import numpy as np
from numpy.polynomial import polynomial

#: Numbers of intervals of first meshes; the second is for waveforms with several spikes.
MESH_SIZES = FIRST_INTERVALS, 4 * FIRST_INTERVALS
#: Iterations in which ends of intervals move onto kinks.
KINK_ITERATIONS = 8
#: Range, over that of the guess, below which the orbit has fallen to an equilibrium.
MIN_RANGE_RATIO = 1e-5


def from_path(network: Network, symmetry: Symmetry, path: Path, period: float,
              periods: Sequence[float] = ()) -> MeshOrbit | None:
    """Solve for an orbit from a guess, as solve_orbit.solve_from_path."""
    reduced = Reduced(network, symmetry)

    def guess(positions: np.ndarray) -> np.ndarray:
        return path(positions / symmetry.order)[:, reduced.kept]

    for intervals in MESH_SIZES[:1] if periods else MESH_SIZES:
        start = sampled(guess, first_mesh(reduced, guess, intervals, getattr(path, 'steps', None)),
                        period / symmetry.order)
        orbit = _refined(reduced, start, [excluded / symmetry.order for excluded in periods])
        if orbit is not None:
            return orbit
    return None


def predicted(network: Network, near: MeshOrbit) -> MeshOrbit | None:
    """Solve for an orbit from the prediction of a known one, on its mesh; None as of from_path.

    Args:
        network: parameters.
        near: an orbit of the same gait at nearby parameters.

    Raises:
        NoOrbit: the known orbit is not isolated.

    """
    change = np.subtract([*network.as_dict().values()], [*near.network.as_dict().values()])
    coefficients = near.coefficients + near.d_coefficients @ change
    points = np.vstack([coefficients[0], coefficients[:, -1].sum(axis=0)])
    stages = polynomial.polyval(collocation.NODES, coefficients).transpose(0, 2, 1)
    length = (near.period + float(near.d_period @ change)) / near.symmetry.order
    if not length > 0.0:
        return None
    return _refined(Reduced(network, near.symmetry), Solution(near.mesh, points, stages, length))


def _refined(reduced: Reduced, now: Solution, periods: Sequence[float] = ()) -> MeshOrbit | None:
    """Solve, remesh and solve again until the mesh is fine enough; None as in from_path."""
    fewest, smallest = MIN_INTERVALS, MIN_RANGE_RATIO * np.ptp(now.points[:, :reduced.size])
    while True:
        with np.errstate(all='ignore'):
            converged = newton(reduced, now, periods)
        if not converged or np.ptp(now.points[:, :reduced.size]) <= smallest:
            return None
        if not _on_kinks(reduced, now):
            return None
        try:
            mesh = remeshed(reduced, now, fewest)
            if mesh is None:
                return completed(reduced, now)
        except NoOrbit:
            return None
        now, periods = sampled(path_of(reduced, now), mesh, now.length), ()
        # Finer every time: distributing the error evenly need not suffice.
        fewest = finer(mesh)


def kinks(reduced: Reduced, now: Solution) -> np.ndarray:
    """Positions, 0 to 1, at which the rates of a solution have a kink."""
    network = reduced.network
    columns = [variable * reduced.size + k for variable, name in enumerate(network.states)
               if name in network.kinks for k in range(reduced.size)]
    return sign_changes(now.mesh, coefficients_of(reduced, now)[..., columns])


def _on_kinks(reduced: Reduced, now: Solution) -> bool:
    """Move ends of intervals onto all kinks, in place; return whether Newton converged."""
    if not reduced.network.kinks:
        return True
    for _ in range(KINK_ITERATIONS):
        mesh = aligned(now.mesh, kinks(reduced, now))
        if mesh is None:
            break
        moved = sampled(path_of(reduced, now), mesh, now.length)
        now.mesh, now.points, now.stages = moved.mesh, moved.points, moved.stages
        if not newton(reduced, now):
            return False
    return True


@dataclass(frozen=True, eq=False, repr=False)
class MeshCurve(ShortRepr):
    """Orbits of a network without delay on a mesh: points, nodes, L = T/m, and the value.

    Attributes:
        network: any on the line.
        symmetry: of the gait.
        along: the line.
        scales: of period and value.
        sizes: of the variables.
        mesh: ends of the intervals, shape (n + 1,).

    """

    network: Network
    symmetry: Symmetry
    along: ParameterLine
    scales: tuple[float, float]
    sizes: np.ndarray
    mesh: np.ndarray

    def _solution(self, z: np.ndarray) -> tuple[Reduced, Solution]:
        reduced = Reduced(self.along.at(self.network, float(z[-1])), self.symmetry)
        n, d = self.mesh.size - 1, len(reduced.kept)
        points, stages = np.split(z[:-2], [(n + 1) * d])
        return reduced, Solution(self.mesh, points.reshape(n + 1, d),
                                 stages.reshape(n, -1, d), float(z[-2]))

    def _weights(self, size: int) -> np.ndarray:
        """Return trapezoidal weights of points, L and value; nodes between points have none."""
        d = len(self.symmetry.basis)
        ends = np.zeros(self.mesh.size)
        ends[:-1] += 0.5 * np.diff(self.mesh)
        ends[1:] += 0.5 * np.diff(self.mesh)
        weights = np.zeros(size)
        each = np.repeat(self.sizes**-2.0, d // self.sizes.size) / d
        weights[:d * ends.size] = np.outer(ends, each).ravel()
        weights[-2] = (self.scales[0] / self.symmetry.order)**-2.0
        weights[-1] = self.scales[1]**-2.0
        return weights

    def product(self, first: np.ndarray, second: np.ndarray) -> float:
        """Mean over the cycle and the components plus period plus value."""
        return float(self._weights(first.size) * first @ second)

    def step(self, z: np.ndarray, border: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Newton's increment normal to the border, and the tangent."""
        reduced, now = self._solution(z)
        direction = self.along.direction(self.network)
        extra = reduced.by_parameter(now.stages) @ direction
        p, r, by_start, by_source = linearised(reduced, now, extra[..., None])
        d = p.shape[-1]
        matrix, right = np.zeros((d + 2, d + 2)), np.zeros((d + 2, 2))
        matrix[:d + 1, :d + 1] = bordered(reduced, now, p, r)
        matrix[:d, d + 1] = r[-1, :, 2]
        matrix[d, d + 1] = reduced.by_parameter(now.points[0])[0] @ direction
        weighted = self._weights(z.size) * border
        row = weighted[:now.points.size].reshape(now.points.shape)
        matrix[d + 1, :d] = np.einsum('ki,kij->j', row, p)
        matrix[d + 1, d:] = np.einsum('ki,kij->j', row, r)[[0, 2]] + weighted[-2:]
        right[:d, 0] = now.points[0, reduced.permutation] - now.points[-1] - r[-1, :, 1]
        right[d, 0] = -reduced.rates(now.points[0])[0]
        right[d + 1] = -(row * r[..., 1]).sum(), 1.0
        answers = []
        for solution, residual in zip(np.linalg.solve(matrix, right).T, (1.0, 0.0), strict=True):
            source = np.array([solution[d], residual, solution[d + 1]])
            moved = p @ solution[:d] + r @ source
            inner = np.einsum('nsij,nj->nsi', by_start, moved[:-1]) + by_source @ source
            answers.append(np.concatenate([moved.ravel(), inner.ravel(), solution[d:]]))
        return answers[0], answers[1]

    def amplitude(self, z: np.ndarray) -> float:
        """Half the range of cell 1's first variable at the mesh points, over its size."""
        points = self._solution(z)[1].points[:, columns_of(self.symmetry, 0, 0)]
        return float(0.5 * np.ptp(points) / self.sizes[0])

    def renewed(self, z: np.ndarray, border: np.ndarray, again: bool
                ) -> tuple['MeshCurve', np.ndarray, np.ndarray] | None:
        """A finer mesh if the solution needs it, from the highest peak of cell 1."""
        reduced, now = self._solution(z)
        mesh = remeshed(reduced, now, finer(now.mesh) if again else MIN_INTERVALS)
        path = path_of(reduced, now)
        start = self._highest(now, path)
        if mesh is None and not start:
            return None
        mesh = now.mesh if mesh is None else mesh
        points = border[:now.points.size].reshape(now.points.shape)

        def slanted(positions: np.ndarray) -> np.ndarray:
            return np.stack([np.interp(positions, now.mesh, column) for column in points.T], -1)

        curve = replace(self, mesh=mesh)
        moved = [curve.pack(sampled(self._turned(reduced, states, start), mesh, 1.0), *ends)
                 for states, ends in ((path, z[-2:]), (slanted, border[-2:]))]
        return curve, moved[0], moved[1]

    def _highest(self, now: Solution, path: Callable) -> float:
        """Return the time of cell 1's peak, in m-ths of the cycle, or 0 if it is at the start."""
        columns = columns_of(self.symmetry, 0, 0)
        peaks = now.points[:, columns]
        node, index = divmod(int(peaks.argmax()), len(columns))
        if peaks.max() <= now.points[0, 0] + 1e-9 * np.ptp(peaks):
            return 0.0
        near = np.linspace(now.mesh[max(node - 1, 0)], now.mesh[min(node + 1, now.mesh.size - 1)],
                           201)
        return float(index + near[path(near)[:, columns[index]].argmax()])

    def _turned(self, reduced: Reduced, path: Callable, start: float) -> Callable:
        """Return the path from another start, where y(s + 1) = y(s)[permutation]."""
        def later(positions: np.ndarray) -> np.ndarray:
            positions = positions + start
            periods = np.floor(positions).astype(int)
            out = path(positions - periods)
            for k in range(1, periods.max(initial=0) + 1):
                out[periods >= k] = out[periods >= k][:, reduced.permutation]
            return out
        return later

    def pack(self, now: Solution, length: float, value: float) -> np.ndarray:
        """Return the vector of unknowns."""
        return np.concatenate([now.points.ravel(), now.stages.ravel(), [length, value]])

    def orbit(self, z: np.ndarray) -> MeshOrbit:
        """Make an orbit of a solution."""
        return completed(*self._solution(z))


def through(orbit: MeshOrbit, line: ParameterLine, scales: tuple[float, float],
            sizes: np.ndarray) -> tuple[MeshCurve, np.ndarray]:
    """Return the curve of the orbits along a line, and the unknowns of one of them."""
    curve = MeshCurve(orbit.network, orbit.symmetry, line, scales, sizes, orbit.mesh)
    now = orbit.solution
    return curve, curve.pack(now, now.length, line.value(orbit.network))


def curve_beside(network: Network, symmetry: Symmetry, line: ParameterLine,
                 scales: tuple[float, float], sizes: np.ndarray, path: Path, disturbance: Path,
                 period: float) -> tuple[MeshCurve, np.ndarray, np.ndarray]:
    """Return the curve of the orbits that branch off, the old solution on it and the tangent.

    The arguments are those of the Fourier method's function.
    """
    reduced = Reduced(network, symmetry)

    def on_quotient(states: Path) -> Path:
        return lambda positions: states(positions / symmetry.order)[:, reduced.kept]

    mesh = first_mesh(reduced, on_quotient(path))
    curve = MeshCurve(network, symmetry, line, scales, sizes, mesh)
    return (curve, curve.pack(sampled(on_quotient(path), mesh, 1.0), period / symmetry.order,
                              line.value(network)),
            curve.pack(sampled(on_quotient(disturbance), mesh, 1.0), 0.0, 0.0))


#: Relative difference above which a peak is not the highest.
PEAK_TOLERANCE = 1e-6


def _accepted(orbit: MeshOrbit | None) -> MeshOrbit | None:
    return orbit if orbit is not None and not extra_symmetry(orbit) else None


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
    """Collocate from a simulation over a period from a state near the orbit."""
    run = simulate(network, start, 1.05 * period, network.step, progress=False, quiet=True)
    return _accepted(from_path(network, symmetry, lambda theta: run(theta * period), period))


def _stated(network: Network, gait: str) -> MeshOrbit | None:
    """Solve from the state that the network states near the orbit; None if it states none."""
    state = network.on_orbit(gait)
    if state is None:
        return None
    symmetry = network.symmetry(gait)
    orbit = _from_state(network, symmetry, *state)
    # Phase 0 is the highest peak, which a state near the orbit may miss.
    if orbit is None or orbit.peak - orbit.waveform(np.zeros(1))[0] > PEAK_TOLERANCE * orbit.peak:
        return _by_itself(network, symmetry, *state)
    return orbit


def _sought(network: Network, gait: str) -> MeshOrbit:
    orbit, unsolved = _settled(network, gait)
    if unsolved:
        raise NoOrbit(f'no {gait} was found at these parameters: simulations settle on a cycle of '
                      f'period {unsolved:.6g}, which is too steep to be solved for')
    if orbit is None:
        # solve_orbit.solve_orbit searches from Hopf points before it raises this.
        raise NoOrbit(f'no {gait} was found at these parameters, neither by simulations from '
                      f'states about the equilibrium nor from a Hopf point along {network.line}')
    return orbit


def _settled(network: Network, gait: str) -> tuple[MeshOrbit | None, float]:
    """Simulate from states of the gait's class until the network settles.

    Returns:
        The orbit on which it settles, or None; where only the solution for an orbit fails, the
            period of the cycle in model time, else 0.

    """
    unsolved = 0.0
    with suppress(NoEquilibrium):
        for symmetry, path, period in find_orbit(network, gait):
            orbit = from_path(network, symmetry, path, period)
            if _accepted(orbit) is not None:
                return orbit, 0.0
            unsolved = unsolved or (period if orbit is None else 0.0)
    return None, unsolved


def _by_itself(network: Network, symmetry: Symmetry, start: np.ndarray, period: float
               ) -> MeshOrbit | None:
    cycle = settle(network, symmetry, start, period)
    return None if cycle is None else _accepted(from_path(network, symmetry, cycle, cycle.period))


def _on_cycles(orbit: Orbit) -> Path:
    return lambda theta: orbit(theta * orbit.period)


def _continue_orbit(near: MeshOrbit, network: Network) -> tuple[MeshOrbit | None, float]:
    """Continue an orbit to other parameters; also return the fraction of the way reached."""
    start, end = near.network.as_dict(), network.as_dict()
    orbit, reached, step = near, 0.0, 0.25
    # A failure costs more than a success, so steps shrink fast.
    while reached < 1.0 and step > 0.003:
        fraction = min(1.0, reached + step)
        between = replace(network, **{key: start[key] + fraction * (end[key] - start[key])
                                   for key in start})  # type: ignore[type-var]
        ahead = _accepted(from_path(between, near.symmetry, _on_cycles(orbit), orbit.period))
        # A jump to another branch would be no continuation.
        if ahead is None or not 0.5 < ahead.period / orbit.period < 2.0:
            step *= 0.25
            continue
        orbit, reached, step = ahead, fraction, 1.5 * step
    return (orbit if reached >= 1.0 else None), reached


def beside(network: Network, near: MeshOrbit) -> MeshOrbit:
    """Solve for the orbit next to a known one of the same symmetry, by Newton's method alone.

    Raises:
        NoOrbit: the method leads elsewhere; a shorter step may succeed.

    """
    orbit = _accepted(predicted(network, near))
    if orbit is None:
        orbit = _accepted(from_path(network, near.symmetry, _on_cycles(near), near.period))
    if orbit is None or not 0.5 < orbit.period / near.period < 2.0:
        raise NoOrbit('no orbit next to the known one')
    return orbit


def solve(network: Network, gait: str, near: MeshOrbit | None = None) -> MeshOrbit:
    """Solve for the gait's orbit, with exact derivatives by every parameter.

    Args:
        network: parameters.
        gait: one of the network's.
        near: an orbit of the same gait to start from; by default the shipped preset's.

    Raises:
        ValueError: an unknown gait, or parameters that are not finite.
        NoOrbit: there is none; the message says how far from the known one it exists.

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
            # The known orbit is not near enough: solve in another way.
            pass
    start = near(np.array(0.0))
    if near.symmetry != symmetry and near.symmetry.h == symmetry.h:
        # The opposite wave has the same signals with other phases.
        start = _states(near, symmetry)
    orbit = _by_itself(network, symmetry, start, near.period) or _settled(network, gait)[0]
    if orbit is not None:
        return orbit
    if near.symmetry == symmetry:
        orbit, reached = _continue_orbit(near, network)
        if orbit is not None:
            return orbit
        first = near.network
        last = first.replace(**{name: old + reached * (network.as_dict()[name] - old)
                                for name, old in first.as_dict().items()})
        before = first.grouped()
        changed = ', '.join(f'{name} {value:.4g}' for name, value in last.grouped().items()
                            if value != before.get(name))
        raise NoOrbit(f'no {gait} at these parameters: continued from its preset, it ends at '
                      f'{changed}')
    raise NoOrbit(f'no {gait} at these parameters')


def _of_preset(network: Network, gait: str) -> MeshOrbit | None:
    """Return the orbit of the gait's preset, if it has one."""
    preset = network.presets().get(gait)
    # A preset without a start is solved like the gait of the network itself.
    if preset is None or (preset.start is None and preset.network == network):
        return None
    try:
        return from_preset(preset)
    except NoOrbit:
        return None


def _states(orbit: MeshOrbit, symmetry: Symmetry) -> np.ndarray:
    """Return the state at phase 0 of the orbit's waveforms with another symmetry's phases."""
    cells = orbit.network.cells
    out = np.empty(orbit.network.components)
    for cell in range(cells):
        for variable in range(orbit.network.variables):
            out[cell + variable * cells] = orbit.waveform(
                np.array(symmetry.phases[cell]), 0, int(symmetry.waves[cell]), variable)
    return out

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

"""The orbits of a gait along a line of parameters on a mesh, as a curve for continuation.

Their collocation equations, the parameter as one more unknown and the border as one more equation.
Unknowns are counted against their scales: states against 1, where cells saturate, the period and
the parameter against what is given.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

from cpg_ros.dynamics.mesh.adaptation import completed
from cpg_ros.dynamics.mesh.newton import (
    bordered,
    FEWEST,
    finer,
    first_mesh,
    linearised,
    path_of,
    Reduced,
    remeshed,
    sampled,
    Solution,
)
from cpg_ros.dynamics.mesh.orbit import MeshOrbit
from cpg_ros.networks.network import Network
from cpg_ros.networks.parameter_line import ParameterLine
from cpg_ros.networks.symmetry import Symmetry
from cpg_ros.short_repr import ShortRepr
import numpy as np

#: States, shape (m, components), as a function of times in cycles, shape (m,).
States = Callable[[np.ndarray], np.ndarray]


@dataclass(frozen=True, eq=False, repr=False)
class MeshCurve(ShortRepr):
    """Orbits of a network without delay on a mesh: points, nodes, L = T/m, and the value.

    Attributes:
        network: any on the line.
        symmetry: of the gait.
        along: the line.
        scales: of period and value.
        mesh: ends of the intervals, shape (n + 1,).

    """

    network: Network
    symmetry: Symmetry
    along: ParameterLine
    scales: tuple[float, float]
    mesh: np.ndarray

    def _solution(self, z: np.ndarray) -> tuple[Reduced, Solution]:
        reduced = Reduced(self.along.at(self.network, float(z[-1])), self.symmetry)
        n, d = self.mesh.size - 1, len(reduced.kept)
        points, stages = np.split(z[:-2], [(n + 1) * d])
        return reduced, Solution(self.mesh, points.reshape(n + 1, d),
                                 stages.reshape(n, -1, d), float(z[-2]))

    def _weights(self, size: int) -> np.ndarray:
        """Of points, by the trapezoidal rule, L and value; nodes between points do not count."""
        d = len(self.symmetry.basis)
        ends = np.zeros(self.mesh.size)
        ends[:-1] += 0.5 * np.diff(self.mesh)
        ends[1:] += 0.5 * np.diff(self.mesh)
        weights = np.zeros(size)
        weights[:d * ends.size] = np.repeat(ends / d, d)
        weights[-2] = (self.scales[0] / self.symmetry.order)**-2.0
        weights[-1] = self.scales[1]**-2.0
        return weights

    def product(self, one: np.ndarray, other: np.ndarray) -> float:
        """Mean over the cycle and the components plus period plus value."""
        return float(self._weights(one.size) * one @ other)

    def step(self, z: np.ndarray, border: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Newton's increment normal to the border, and the tangent."""
        reduced, now = self._solution(z)
        way = self.along.direction(self.network)
        extra = reduced.by_parameter(now.stages) @ way
        p, r, by_start, by_source = linearised(reduced, now, extra[..., None])
        d = p.shape[-1]
        matrix, right = np.zeros((d + 2, d + 2)), np.zeros((d + 2, 2))
        matrix[:d + 1, :d + 1] = bordered(reduced, now, p, r)
        matrix[:d, d + 1] = r[-1, :, 2]
        matrix[d, d + 1] = reduced.by_parameter(now.points[0])[0] @ way
        weighted = self._weights(z.size) * border
        row = weighted[:now.points.size].reshape(now.points.shape)
        matrix[d + 1, :d] = np.einsum('ki,kij->j', row, p)
        matrix[d + 1, d:] = np.einsum('ki,kij->j', row, r)[[0, 2]] + weighted[-2:]
        right[:d, 0] = now.points[0, reduced.turn] - now.points[-1] - r[-1, :, 1]
        right[d, 0] = -reduced.rates(now.points[0])[0]
        right[d + 1] = -(row * r[..., 1]).sum(), 1.0
        answers = []
        for found, residual in zip(np.linalg.solve(matrix, right).T, (1.0, 0.0), strict=True):
            source = np.array([found[d], residual, found[d + 1]])
            moved = p @ found[:d] + r @ source
            inner = np.einsum('nsij,nj->nsi', by_start, moved[:-1]) + by_source @ source
            answers.append(np.concatenate([moved.ravel(), inner.ravel(), found[d:]]))
        return answers[0], answers[1]

    def _columns(self, reduced: Reduced) -> list[int]:
        """Where the reduced state has cell 1's first variable in each m-th of the cycle."""
        columns = [0]
        for _ in range(self.symmetry.order - 1):
            columns.append(int(reduced.turn[columns[-1]]))
        return columns

    def amplitude(self, z: np.ndarray) -> float:
        """Half the range of cell 1's first variable at the mesh points."""
        reduced, now = self._solution(z)
        return float(0.5 * np.ptp(now.points[:, self._columns(reduced)]))

    def renewed(self, z: np.ndarray, border: np.ndarray, again: bool
                ) -> tuple['MeshCurve', np.ndarray, np.ndarray] | None:
        """Another mesh where the solution asks for it, from the highest peak of cell 1."""
        reduced, now = self._solution(z)
        mesh = remeshed(reduced, now, finer(now.mesh) if again else FEWEST)
        path = path_of(reduced, now)
        start = self._highest(reduced, now, path)
        if mesh is None and not start:
            return None
        mesh = now.mesh if mesh is None else mesh
        points = border[:now.points.size].reshape(now.points.shape)

        def slanted(places: np.ndarray) -> np.ndarray:
            return np.stack([np.interp(places, now.mesh, column) for column in points.T], -1)

        curve = replace(self, mesh=mesh)
        moved = [curve.pack(sampled(self._turned(reduced, one, start), mesh, 1.0), *ends)
                 for one, ends in ((path, z[-2:]), (slanted, border[-2:]))]
        return curve, moved[0], moved[1]

    def _highest(self, reduced: Reduced, now: Solution, path: Callable) -> float:
        """Where cell 1 is higher than at the start, in m-ths of the cycle, or 0."""
        columns = self._columns(reduced)
        peaks = now.points[:, columns]
        node, part = divmod(int(peaks.argmax()), len(columns))
        if peaks.max() <= now.points[0, 0] + 1e-9 * np.ptp(peaks):
            return 0.0
        near = np.linspace(now.mesh[max(node - 1, 0)], now.mesh[min(node + 1, now.mesh.size - 1)],
                           201)
        return float(part + near[path(near)[:, columns[part]].argmax()])

    def _turned(self, reduced: Reduced, path: Callable, start: float) -> Callable:
        """Return the path from another start on: y(s + 1) = y(s)[turn]."""
        def later(places: np.ndarray) -> np.ndarray:
            places = places + start
            parts = np.floor(places).astype(int)
            out = path(places - parts)
            for k in range(1, parts.max(initial=0) + 1):
                out[parts >= k] = out[parts >= k][:, reduced.turn]
            return out
        return later

    def pack(self, now: Solution, length: float, value: float) -> np.ndarray:
        """Return the vector of unknowns."""
        return np.concatenate([now.points.ravel(), now.stages.ravel(), [length, value]])

    def orbit(self, z: np.ndarray) -> MeshOrbit:
        """Make an orbit of a solution."""
        return completed(*self._solution(z))


def through(orbit: MeshOrbit, line: ParameterLine, scales: tuple[float, float]
            ) -> tuple[MeshCurve, np.ndarray]:
    """Return the curve of the orbits along a line, and the place of one of them on it."""
    curve = MeshCurve(orbit.network, orbit.symmetry, line, scales, orbit.mesh)
    now = orbit.solution
    return curve, curve.pack(now, now.length, line.value(orbit.network))


def beside(network: Network, symmetry: Symmetry, line: ParameterLine,
           scales: tuple[float, float], path: States, disturbance: States, period: float
           ) -> tuple[MeshCurve, np.ndarray, np.ndarray]:
    """Return the orbits near a state or an orbit: their curve, that on it, and how they leave it.

    Args:
        network: at the place.
        symmetry: of the orbits.
        line: of parameters.
        scales: as of the curve.
        path: states of what they leave, shape (m, components), over times in cycles.
        disturbance: the direction in which, the same.
        period: of the orbits, model time.

    """
    reduced = Reduced(network, symmetry)

    def on_quotient(states: States) -> States:
        return lambda places: states(places / symmetry.order)[:, reduced.kept]

    mesh = first_mesh(reduced, on_quotient(path))
    curve = MeshCurve(network, symmetry, line, scales, mesh)
    return (curve, curve.pack(sampled(on_quotient(path), mesh, 1.0), period / symmetry.order,
                              line.value(network)),
            curve.pack(sampled(on_quotient(disturbance), mesh, 1.0), 0.0, 0.0))

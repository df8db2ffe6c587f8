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

"""The adjoint of the variational equation along a gait of a network without delay.

``z' = -J(t)' z`` with the orbit's boundary condition, by the orbit's own collocation, backwards in
time, in which it does not grow where disturbances decay. It may be steep where the orbit is not,
as at the knees of a relaxation oscillation: intervals that do not resolve it are halved.
"""

from cpg_ros.dynamics.mesh import collocation
from cpg_ros.dynamics.mesh.elimination import chained, summed, transfer
from cpg_ros.dynamics.mesh.newton import MOST_INTERVALS, path_of, Reduced
from cpg_ros.dynamics.mesh.orbit import evaluate, MeshOrbit
from cpg_ros.dynamics.periodic import NoOrbit, NOT_ISOLATED, Waveforms
import numpy as np

#: An interval is fine enough when its polynomials end with terms of this share of the whole.
RESOLVED = 1e-9
#: Below this singular value a disturbance other than along the orbit does not decay, either.
SINGULAR = 1e-9


def adjoint(orbit: MeshOrbit) -> Waveforms:
    """Return the adjoint's waveforms, in cycles per unit of each variable.

    Raises:
        NoOrbit: the orbit is not isolated, or more intervals would be needed than there may be.

    """
    mesh, symmetry = orbit.mesh, orbit.symmetry
    while True:
        coefficients, unresolved = _on_mesh(orbit, mesh)
        if not unresolved.any():
            break
        if mesh.size + unresolved.sum() > 4 * MOST_INTERVALS:
            raise NoOrbit('the phase response is too steep to be resolved')
        middles = 0.5 * (mesh[:-1] + mesh[1:])[unresolved]
        mesh = np.sort(np.concatenate([mesh, middles]))
    fine = mesh

    def waveform(theta: np.ndarray, wave: int = 0, variable: int = 0) -> np.ndarray:
        return evaluate(symmetry, fine, coefficients, theta, wave=wave, variable=variable)

    return waveform


def _on_mesh(orbit: MeshOrbit, mesh: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the adjoint's polynomials, (S + 1, n, d), and which intervals do not resolve it."""
    reduced, length = Reduced(orbit.network, orbit.symmetry), orbit.solution.length
    lengths = length * np.diff(mesh)
    places = mesh[:-1, None] + np.diff(mesh)[:, None] * collocation.NODES
    states = path_of(reduced, orbit.solution)(places.ravel()).reshape(*places.shape, -1)
    jacobians = reduced.linearised(states)[1]
    # Backwards: the last interval first, and in each the last node.
    back = np.ascontiguousarray(jacobians[::-1, ::-1].swapaxes(2, 3))
    try:
        answers = transfer(back, lengths[::-1], np.zeros((*back.shape[:3], 0)))
        d = back.shape[-1]
        steps = np.eye(d) + summed(back, lengths[::-1], answers)
        whole = chained(steps)
        # z(L) = z(0)[turn], and z along the flow 1/T.
        start = orbit.solution.points[-1]
        matrix = np.vstack([whole[-1, reduced.turn] - np.eye(d),
                            orbit.period * reduced.rates(start)])
        end, _, _, sizes = np.linalg.lstsq(matrix, np.append(np.zeros(d), 1.0), rcond=None)
    except np.linalg.LinAlgError as error:
        raise NoOrbit(NOT_ISOLATED) from error
    if not sizes[-1] > SINGULAR:
        raise NoOrbit(NOT_ISOLATED)
    points = whole @ end
    slopes = -np.einsum('nsij,nsjk,nk->nsi', back, answers, points[:-1])[::-1, ::-1]
    coefficients = collocation.power_coefficients(points[::-1][:-1], slopes, lengths)
    ends = collocation.last_share(slopes) * lengths / np.abs(points).max()
    # One class stands for all of its cells, which share what it does.
    alike = np.tile(np.bincount(orbit.symmetry.classes), orbit.network.variables)
    return coefficients / alike, ends > RESOLVED

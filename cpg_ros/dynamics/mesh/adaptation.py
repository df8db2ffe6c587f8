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

"""Solving for orbits on meshes that are made finer until they resolve them."""

from collections.abc import Callable, Sequence

from cpg_ros.dynamics.mesh import collocation
from cpg_ros.dynamics.mesh.kinks import aligned, places_of
from cpg_ros.dynamics.mesh.newton import (
    coefficients_of,
    FEW,
    FEWEST,
    finer,
    first_mesh,
    newton,
    path_of,
    Reduced,
    remeshed,
    sampled,
    Solution,
)
from cpg_ros.dynamics.mesh.orbit import MeshOrbit
from cpg_ros.dynamics.periodic import NoOrbit
from cpg_ros.networks.network import Network
from cpg_ros.networks.symmetry import Symmetry
import numpy as np
from numpy.polynomial import polynomial

#: How many times as many intervals a first mesh has where fewer lead nowhere: as several spikes.
MORE = 4
#: Times that ends of intervals are put on kinks anew.
ALIGNED = 8
#: Below this range the orbit has fallen to an equilibrium.
SMALLEST = 1e-5
#: Places of an interval, 0 to 1, at which it is looked how well the equations hold.
BETWEEN = np.array([0.02, 0.3, 0.5, 0.7, 0.98])


def collocate(network: Network, symmetry: Symmetry, path: Callable[[np.ndarray], np.ndarray],
              period: float, known: Sequence[float] = ()) -> MeshOrbit | None:
    """Solve for an orbit from a guess; None where Newton's method leads to none.

    Args:
        network: parameters.
        symmetry: of the gait.
        path: states, shape (m, components), as a function of times in cycles, shape (m,).
        period: in model time.
        known: periods of orbits that Newton's method is to be kept off, model time.

    """
    reduced = Reduced(network, symmetry)

    def guess(places: np.ndarray) -> np.ndarray:
        return path(places / symmetry.order)[:, reduced.kept]

    for intervals in (FEW,) if known else (FEW, MORE * FEW):
        start = sampled(guess, first_mesh(reduced, guess, intervals), period / symmetry.order)
        found = _refined(reduced, start, [one / symmetry.order for one in known])
        if found is not None:
            return found
    return None


def predicted(network: Network, near: MeshOrbit) -> MeshOrbit | None:
    """Solve for an orbit from what the derivatives of a known one predict; None as in collocate.

    The mesh of the known one is taken over, so that little is left to do.

    Args:
        network: parameters.
        near: an orbit of the same gait at near parameters.

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


def _refined(reduced: Reduced, now: Solution, known: Sequence[float] = ()
             ) -> MeshOrbit | None:
    """Solve, remesh and solve again until the mesh is fine enough; None as in collocate."""
    fewest = FEWEST
    while True:
        with np.errstate(all='ignore'):
            converged = newton(reduced, now, known)
        if not converged or np.ptp(now.points[:, :reduced.size]) < SMALLEST:
            return None
        if not _on_kinks(reduced, now):
            return None
        try:
            mesh = remeshed(reduced, now, fewest)
            if mesh is None:
                return completed(reduced, now)
        except NoOrbit:
            return None
        now, known = sampled(path_of(reduced, now), mesh, now.length), ()
        # Finer every time: equal shares of the error alone may stay short of the goal for ever.
        fewest = finer(mesh)


def kinks(reduced: Reduced, now: Solution) -> np.ndarray:
    """Places, 0 to 1, at which the rates of a solution have a kink."""
    network = reduced.network
    columns = [variable * reduced.size + k for variable, name in enumerate(network.states)
               if name in network.kinks for k in range(reduced.size)]
    return places_of(now.mesh, coefficients_of(reduced, now)[..., columns])


def _on_kinks(reduced: Reduced, now: Solution) -> bool:
    """Put ends of intervals on all kinks, in place; tell whether Newton's method converged."""
    if not reduced.network.kinks:
        return True
    for _ in range(ALIGNED):
        mesh = aligned(now.mesh, kinks(reduced, now))
        if mesh is None:
            break
        moved = sampled(path_of(reduced, now), mesh, now.length)
        now.mesh, now.points, now.stages = moved.mesh, moved.points, moved.stages
        if not newton(reduced, now):
            return False
    return True


def completed(reduced: Reduced, now: Solution) -> MeshOrbit:
    """Make an orbit of a solution."""
    coefficients = coefficients_of(reduced, now)
    values, rise = (polynomial.polyval(BETWEEN, c).transpose(0, 2, 1)
                    for c in (coefficients, polynomial.polyder(coefficients)))
    steps = now.length * np.diff(now.mesh)
    residual = np.abs(rise / steps[:, None, None] - reduced.rates(values))
    return MeshOrbit(reduced.network, reduced.symmetry, reduced.symmetry.order * now.length,
                     float(residual.max()), now.mesh, now.stages, coefficients)

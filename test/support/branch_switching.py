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

"""Onto the branch of orbits that leaves at a branch point or a period doubling."""

from fractions import Fraction

from cpg_ros.dynamics.arclength import NoOrbit
from cpg_ros.dynamics.continuation import Bifurcation, Branch, continue_from_disturbance
from cpg_ros.dynamics.fourier.floquet import mode as fourier_mode
from cpg_ros.dynamics.fourier.orbit import FourierOrbit
from cpg_ros.dynamics.mesh import collocation
from cpg_ros.dynamics.mesh.floquet import Flow, returning
from cpg_ros.dynamics.orbit import extra_symmetry
from cpg_ros.networks.network import ParameterLine
from cpg_ros.networks.symmetry import Symmetry
import numpy as np
from numpy.polynomial import polynomial

#: Shares of the disturbance that are tried, and points of a cycle at which symmetry is tested.
AMPLITUDES, POINTS = (0.02, 0.005, 0.06), 96
#: What a symmetry may miss by, over the disturbance.
SAME = 1e-3


def mode(orbit, part: int, multiplier: complex):
    """Return the disturbance with a multiplier as a function of time, of size 1 at most.

    On a gait ``x(t + T/m) = M x(t)``, M the change of places of the cells after T/m. So the
    disturbances w that return as a multiple nu of themselves are those of the map over T/m in the
    frame that changes places with the cells, and ``v(t + j T/m) = M^j Re(nu^j w(t))``.

    Args:
        orbit: of a network without delay.
        part: 0 for the gait's class, then the subspaces transverse to it, as in transverse.
        multiplier: about that of the disturbance over a period, not the trivial one.

    Returns:
        States, shape (points, components), as a function of times in cycles, shape (points,).

    """
    if isinstance(orbit, FourierOrbit):
        return fourier_mode(orbit, part, multiplier)
    columns, nu, left = returning(orbit, part, multiplier)
    flow, m = Flow(orbit), orbit.symmetry.order
    jacobians, answers = flow.solved(columns)
    change = flow.on(columns)[1]
    inner = np.einsum('nsij,nj->nsi', answers, left[:-1])
    slopes = np.einsum('nsij,nsj->nsi', jacobians, inner)
    coefficients = collocation.power_coefficients(left[:-1], slopes, flow.lengths)
    size = float(np.abs(left).max())

    def path(theta: np.ndarray) -> np.ndarray:
        places = np.asarray(theta, dtype=float) * m
        turns = np.floor(places).astype(int)
        places = places - turns
        k = np.clip(np.searchsorted(orbit.mesh, places, side='right') - 1, 0,
                    orbit.mesh.size - 2)
        xi = (places - orbit.mesh[k]) / np.diff(orbit.mesh)[k]
        values = polynomial.polyval(xi[:, None], coefficients[:, k], tensor=False)
        out = (nu**turns[:, None] * values).real
        for turn in np.unique(turns):
            there = turns == turn
            out[there] = out[there] @ np.linalg.matrix_power(change, int(turn)).T
        return out @ columns.T / size

    return path


def switch_branch(bifurcation: Bifurcation, along: ParameterLine, low: float, high: float,
                  most: int = 60) -> Branch:
    """Follow the branch that leaves at a branch point or a period doubling.

    Args:
        bifurcation: of a branch of orbits.
        along: the line it was found on.
        low: least value.
        high: greatest value.
        most: points at most.

    Raises:
        NoOrbit: Newton's method finds no orbit beside the point.

    """
    orbit, doubled = bifurcation.point.orbit, bifurcation.kind == 'period doubling'
    cycles = 2 if doubled else 1
    disturbance = mode(orbit, bifurcation.part, -1.0 if doubled else 1.0)
    theta = np.arange(POINTS) / POINTS
    symmetry = kept(orbit.symmetry, disturbance(cycles * theta), doubled)
    for amplitude in AMPLITUDES:
        try:
            found = continue_from_disturbance(
                orbit.network, symmetry, along, low, high,
                lambda theta: orbit(cycles * theta * orbit.period),
                lambda theta: disturbance(cycles * theta), cycles * orbit.period,
                amplitude=amplitude, most=most)
        except NoOrbit:
            continue
        if not extra_symmetry(found.points[0].orbit):
            return found
    raise NoOrbit(f'no orbit was found near the {bifurcation.kind} at {along} '
                  f'{bifurcation.value:g}')


def kept(symmetry: Symmetry, disturbance: np.ndarray, doubled: bool) -> Symmetry:
    """Return the symmetry that an orbit has left once it is disturbed.

    Args:
        symmetry: of the orbit.
        disturbance: at even times of a cycle, of two if doubled, shape (points, components).
        doubled: whether two cycles become one.

    """
    x = disturbance[:, :symmetry.group.cells]
    size, shifts = np.abs(disturbance).max(), {}
    for name, shift in symmetry.shifts:
        choices = (shift / 2, shift / 2 + Fraction(1, 2)) if doubled else (shift,)
        image = x[:, list(symmetry.group.elements[name])]
        for choice in choices:
            turned = np.roll(x, -round(float(choice) * len(x)), axis=0)
            if np.abs(image - turned).max() < SAME * size:
                shifts[name] = choice
                break
    # Two cycles that differ are no negatives of one another.
    half = np.roll(x, len(x) // 2, axis=0)
    odd = symmetry.odd and not doubled and bool(np.abs(x + half).max() < SAME * size)
    return Symmetry.of(symmetry.group, shifts, symmetry.variables, odd)

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

"""Orbits as polynomials on a mesh: the gaits of the networks without delay.

A gait with m = order of H/K is known from the cells of one class each, over one m-th of the cycle:
``x_i(t + T/m) = x_turn(i)(t)``.
"""

from dataclasses import dataclass
from functools import cached_property

from cpg_ros.dynamics.mesh.newton import derivatives, Reduced, Solution
from cpg_ros.dynamics.periodic import Orbit
from cpg_ros.networks.symmetry import Symmetry
import numpy as np

#: Even points of a cycle that resolve a relaxation oscillation.
SAMPLES = 8192


@dataclass(frozen=True, eq=False, repr=False)
class MeshOrbit(Orbit):
    """An orbit as polynomials on a mesh.

    Attributes:
        mesh: ends of the intervals over T/m, from 0 to 1, shape (n + 1,).
        stages: reduced states at the nodes, shape (n, S, d).
        coefficients: of the polynomials on each interval, shape (S + 1, n, d).

    """

    mesh: np.ndarray
    stages: np.ndarray
    coefficients: np.ndarray

    def _summary(self) -> str:
        return f'{super()._summary()}, {self.mesh.size - 1} intervals'

    @property
    def solution(self) -> Solution:
        """The same as what Newton's method works on."""
        ends = np.vstack([self.coefficients[0], self.coefficients[:, -1].sum(axis=0)])
        return Solution(self.mesh, ends, self.stages, self.period / self.symmetry.order)

    @cached_property
    def _derivatives(self) -> tuple[np.ndarray, np.ndarray]:
        return derivatives(Reduced(self.network, self.symmetry), self.solution)

    @property
    def d_period(self) -> np.ndarray:
        """Derivatives of the period by the network's parameters, shape (parameters,)."""
        return self._derivatives[1]

    @property
    def d_coefficients(self) -> np.ndarray:
        """Derivatives of the coefficients by the parameters at fixed theta.

        A family of weights that the symmetry carries into one another acts as one: each has an
        equal share of what moving all of them does. Shape (S + 1, n, d, parameters).
        """
        return self._derivatives[0]

    def waveform(self, theta: np.ndarray, order: int = 0, wave: int = 0, variable: int = 0
                 ) -> np.ndarray:
        """Return a waveform, or its derivative in theta of order 1 or 2, at theta in cycles."""
        return evaluate(self.symmetry, self.mesh, self.coefficients, theta, order=order, wave=wave,
                        variable=variable)

    def d_waveform(self, theta: np.ndarray, wave: int = 0, variable: int = 0) -> np.ndarray:
        """Return the derivatives by the parameters, shape theta.shape + (parameters,)."""
        return evaluate(self.symmetry, self.mesh, self.d_coefficients, theta, wave=wave,
                        variable=variable)

    @property
    def samples(self) -> int:
        """How many evenly spaced points of a cycle resolve a waveform."""
        return SAMPLES


def _columns(symmetry: Symmetry, wave: int, variable: int) -> list[int]:
    """Where u_wave is found in the reduced state, in each m-th of the cycle."""
    columns, cell = [], int(symmetry.first[wave])
    for _ in range(symmetry.order):
        columns.append(int(symmetry.classes[cell] + variable * (symmetry.classes.max() + 1)))
        cell = int(symmetry.turn[cell])
    return columns


def evaluate(symmetry: Symmetry, mesh: np.ndarray, coefficients: np.ndarray, theta: np.ndarray, *,
             order: int = 0, wave: int = 0, variable: int = 0) -> np.ndarray:
    """Evaluate a waveform, or its derivative in theta, that polynomials on a mesh describe.

    Args:
        symmetry: of the gait.
        mesh: ends of the intervals over T/m, from 0 to 1, shape (n + 1,).
        coefficients: of reduced states on each interval, shape (terms, n, d, ...).
        theta: where, in cycles, any shape.
        order: of the derivative, 0 for the value.
        wave: which waveform.
        variable: of the cell.

    Returns:
        An array of shape theta.shape + (...).

    """
    theta = np.asarray(theta, dtype=float) - symmetry.phases[symmetry.first[wave]]
    places = (theta - np.floor(theta)) * symmetry.order
    part = np.minimum(places.astype(int), symmetry.order - 1)
    places = places - part
    interval = np.clip(np.searchsorted(mesh, places, side='right') - 1, 0, mesh.size - 2)
    length = np.diff(mesh)[interval]
    xi = (places - mesh[interval]) / length
    column = np.array(_columns(symmetry, wave, variable))[part]
    terms = coefficients
    for _ in range(order):
        terms = terms[1:] * np.arange(1, terms.shape[0]).reshape(-1, *[1] * (terms.ndim - 1))
    picked = terms[:, interval, column]
    xi = xi.reshape(xi.shape + (1,) * (picked.ndim - 1 - xi.ndim))
    out = np.zeros(picked.shape[1:])
    for term in picked[::-1]:
        out = out * xi + term
    return out * ((symmetry.order / length)**order).reshape(xi.shape)

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

"""A network's right-hand side on arrays, with exact derivatives, on all cells or a quotient.

Where a symmetry makes cells equal, or equal but for the sign, one cell of each class stands for
all: the equations are the same, and what a cell hears is found among the classes.
"""

from typing import Generic

from cpg_ros.networks.equations import equations_of, multilinear, values_of
from cpg_ros.networks.network_definition import AnyDefinition
import numpy as np

#: States now and a delay ago, shape (..., d) each; None where there is no delay.
States = tuple[np.ndarray, np.ndarray | None]


class Field(Generic[AnyDefinition]):
    """``dx/dt = f(x(t), x(t - tau); p)`` of a network, or of one cell of each class.

    Attributes:
        size: cells that are left.
        kept: components of the network that stand for all, shape (d,).
        place: where each component of the network finds its value among these.

    """

    def __init__(self, network: AnyDefinition, classes: np.ndarray | None = None) -> None:
        """Look at a network.

        Args:
            network: parameters.
            classes: number of each cell's class, from 0, shape (cells,); each cell is its own
                by default.

        """
        cells, variables = network.cells, network.variables
        classes = np.arange(cells) if classes is None else classes
        first = np.unique(classes, return_index=True)[1]
        blocks = np.arange(variables)[:, None]
        self.network, self.size = network, first.size
        self.kept = (first + blocks * cells).ravel()
        self.place = (classes + blocks * self.size).ravel()
        self._equations = equations_of(type(network))
        own = np.arange(cells)
        #: For each argument, where the kept cells find it.
        self._heard = [self.place[one.variable * cells + np.asarray(
            own if one.source is None else one.source)[first]]
            for one in self._equations.arguments]
        self._p = [value[first] if value.ndim else value for value in values_of(network)]
        columns = list(network.parameters())
        #: For each row of parameters, the columns of the kept cells.
        by_cell = self._equations.by_cell
        self._columns = [np.array([columns.index(name) for name in by_cell[row]])[first]
                         if row in by_cell else columns.index(row)
                         for row in self._equations.rows]

    def _arguments(self, now: np.ndarray, past: np.ndarray | None) -> list[np.ndarray]:
        return [(past if one.delayed and past is not None else now)[..., heard]
                for one, heard in zip(self._equations.arguments, self._heard, strict=True)]

    def _filled(self, rates: list, shape: tuple[int, ...]) -> np.ndarray:
        out = np.empty(shape)
        for v, rate in enumerate(rates):
            out[..., v * self.size:(v + 1) * self.size] = rate
        return out

    def rates(self, now: np.ndarray, past: np.ndarray | None = None) -> np.ndarray:
        """Right-hand side at states, shape (..., d).

        Args:
            now: states, shape (..., d).
            past: the states a delay ago; those of now by default, as at rest.

        """
        return self._filled(self._equations.rates(self._arguments(now, past), self._p), now.shape)

    def linearised(self, now: np.ndarray, past: np.ndarray | None = None
                   ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Rates, shape (..., d), and Jacobians by now and by past, shape (..., d, d).

        Without a delay the last one is empty: its last two axes have the length 0.
        """
        rates, slopes = self._equations.slopes(self._arguments(now, past), self._p)
        delays = any(one.delayed for one in self._equations.arguments)
        d = now.shape[-1]
        by_now = np.zeros((*now.shape, d))
        by_past = np.zeros((*now.shape, d) if delays else (*now.shape[:-1], 0, 0))
        i = np.arange(self.size)
        for (v, k), slope in slopes.items():
            into = by_past if self._equations.arguments[k].delayed else by_now
            into[..., i + v * self.size, self._heard[k]] += slope
        return self._filled(rates, now.shape), by_now, by_past

    def multilinear(self, at: States, *sets: States) -> np.ndarray:
        """Return the second or third derivative of the rates, B(a, b) or C(a, b, c), (..., d).

        Args:
            at: the states.
            sets: two or three disturbances of them, which may be complex.

        """
        find = self._equations.second if len(sets) == 2 else self._equations.third
        out = np.zeros(sets[0][0].shape, dtype=complex)
        for v, rate in multilinear(find(self._arguments(*at), self._p),
                                   [self._arguments(*one) for one in sets]).items():
            out[..., v * self.size:(v + 1) * self.size] = rate
        return out

    def by_parameter(self, now: np.ndarray, past: np.ndarray | None = None) -> np.ndarray:
        """Return the rates' derivative by the network's parameters, shape (..., d, parameters).

        What the delay does is not in it: that depends on the slope of the past.
        """
        out = np.zeros((*now.shape, len(self.network.parameters())))
        i = np.arange(self.size)
        found = self._equations.by_parameter(self._arguments(now, past), self._p)
        for (v, r), slope in found.items():
            out[..., i + v * self.size, self._columns[r]] += slope
        return out

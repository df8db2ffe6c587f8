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

"""A cell's rates about a state in which all cells are alike, expanded in what the cell hears.

Near such a state the arguments of a cell's equations differ from it by what the cell hears of a
disturbance. One of a symmetry class, ``h chi(cell) exp(lambda t)`` with h of a cell, is heard from
cell s as ``h chi(s)``, and a delay ago as ``exp(-lambda tau)`` times that.
"""

from collections.abc import Mapping
from functools import cached_property
from typing import Any

from cpg_ros.networks.equations import equations_of, multilinear, values_of
from cpg_ros.networks.network import Network
from cpg_ros.networks.parameter_line import ParameterLine
import numpy as np


class Expansion:
    """Derivatives of the first cell's rates, exact; they are those of every cell.

    Attributes:
        network: parameters.
        state: of every cell, shape (variables,).

    """

    def __init__(self, network: Network, state: np.ndarray) -> None:
        """Take the parameters and the state of every cell."""
        self.network, self.state = network, state
        self._equations = equations_of(type(network))
        self._x = [state[one.variable] for one in self._equations.arguments]
        self._p = [value.flat[0] for value in values_of(network)]

    @cached_property
    def _slopes(self) -> Mapping[tuple[int, int], float]:
        return self._equations.slopes(self._x, self._p)[1]

    @cached_property
    def _second(self) -> Mapping[Any, float]:
        return self._equations.second(self._x, self._p)

    @cached_property
    def _third(self) -> Mapping[Any, float]:
        return self._equations.third(self._x, self._p)

    def linear(self, chi: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """L0 and L1 of a class, complex: ``h' = L0 h(t) + L1 h(t - tau)``, (variables, variables).

        Args:
            chi: the class's character for every cell, 1 for the first, shape (cells,).

        """
        return self._split(chi, self._slopes)

    def _split(self, chi: np.ndarray, slopes: Mapping[tuple[int, int], float]
               ) -> tuple[np.ndarray, np.ndarray]:
        variables = self.network.variables
        both = np.zeros((2, variables, variables), dtype=complex)
        for (v, k), slope in slopes.items():
            one = self._equations.arguments[k]
            both[int(one.delayed), v, one.variable] += slope * (
                1.0 if one.source is None else chi[one.source[0]])
        return both[0], both[1]

    def heard(self, h: np.ndarray, chi: np.ndarray, exponent: complex = 0.0) -> np.ndarray:
        """Return what is heard of ``h chi exp(exponent t)`` at t = 0, shape (arguments,).

        Args:
            h: of a cell, shape (variables,).
            chi: character, shape (cells,).
            exponent: 1/model time.

        """
        past = np.exp(-exponent * self.network.delay)
        return np.array([h[one.variable] * (1.0 if one.source is None else chi[one.source[0]])
                         * (past if one.delayed else 1.0) for one in self._equations.arguments])

    def second(self, a: np.ndarray, b: np.ndarray) -> np.ndarray:
        """Second derivative of the rates, B(a, b), at two sets of arguments, (variables,)."""
        return self._multilinear(self._second, a, b)

    def third(self, a: np.ndarray, b: np.ndarray, c: np.ndarray) -> np.ndarray:
        """Third derivative of the rates, C(a, b, c), shape (variables,)."""
        return self._multilinear(self._third, a, b, c)

    def _multilinear(self, derivatives: Mapping[Any, float], *sets: np.ndarray
                     ) -> np.ndarray:
        out = np.zeros(self.network.variables, dtype=complex)
        for v, rate in multilinear(derivatives, list(sets)).items():
            out[v] = rate
        return out

    def _moving(self, line: ParameterLine) -> dict[int, float]:
        """How fast the rows of parameters move along a line, those that do."""
        signs = dict(zip(line.names, line.signs, strict=True))
        by_cell = self._equations.by_cell
        names = [by_cell[row][0] if row in by_cell else row for row in self._equations.rows]
        return {r: signs[name] for r, name in enumerate(names) if name in signs}

    def along(self, line: ParameterLine) -> np.ndarray:
        """Return the derivative of the rates along a line of parameters, shape (variables,)."""
        out, moving = np.zeros(self.network.variables), self._moving(line)
        for (v, r), slope in self._equations.by_parameter(self._x, self._p).items():
            out[v] += slope * moving.get(r, 0.0)
        return out

    def linear_along(self, line: ParameterLine, chi: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return derivatives of L0 and L1 along a line of parameters, at a state that stays."""
        moving = self._moving(line)
        slopes: dict[tuple[int, int], float] = {}
        mixed = self._equations.by_parameter_and_argument(self._x, self._p)
        for (v, r, k), slope in mixed.items():
            slopes[v, k] = slopes.get((v, k), 0.0) + slope * moving.get(r, 0.0)
        return self._split(chi, slopes)

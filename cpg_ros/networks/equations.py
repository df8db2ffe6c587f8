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

"""A network's equations, read once: what they are made of, and functions on arrays from them.

Every cell obeys the same equations, in which it hears other cells, now or a delay ago. They are
written once for a cell (``Network.equations``); here they are read as texts, and sympy derives the
rates and their derivatives, exactly, as numpy code that is kept on disk.
"""

from collections.abc import Mapping, Sequence
from functools import cache, cached_property
import hashlib
from itertools import permutations
from math import prod
import re
from types import ModuleType
from typing import Any

from cpg_ros.networks import generated
from cpg_ros.networks.cell import Cell, Parameters
from cpg_ros.networks.network_definition import NetworkDefinition
from cpg_ros.networks.terms import Term
import numpy as np


class Equations:
    """The equations of a network, with functions on arrays.

    Arrays of a variable, an argument or a parameter have one shape, or shapes that broadcast.

    Attributes:
        arguments: that stand in them, in order.
        rows: names of the parameters, or groups of them, that stand in them.
        by_cell: name that has a parameter for each cell -> these.
        texts: the rate of each variable, in x0, x1 ... for the arguments and p_NAME.
        key: digest of all that follows from them.

    """

    def __init__(self, network: type[NetworkDefinition]) -> None:
        """Read a network's equations.

        Raises:
            TypeError: they are not as many as the cell has variables.

        """
        cell = Cell(network.variables, network.cells)
        found = network.equations(cell, Parameters((*network.parameters(), *network.by_cell())))
        self.texts = tuple(term.text if isinstance(term, Term) else repr(float(term))
                           for term in found)
        if len(self.texts) != network.variables:
            raise TypeError(f'{network.__name__}.equations returns {len(self.texts)} rates for '
                            f'{network.variables} variables')
        text = ' '.join(self.texts)
        self._numbers = tuple(k for k in range(len(cell.arguments))
                              if re.search(rf'\bx{k}\b', text))
        self.arguments = tuple(cell.arguments[k] for k in self._numbers)
        self.by_cell = network.by_cell()
        self.rows = tuple(dict.fromkeys(re.findall(r'\bp_(\w+)', text)))
        words = repr((self.texts, cell.arguments, network.cells))
        self.key = f'{network.name}_{hashlib.sha256(words.encode()).hexdigest()[:16]}'

    @property
    def names(self) -> tuple[str, ...]:
        """The symbols in the texts: arguments, then parameters."""
        return (*(f'x{k}' for k in self._numbers), *(f'p_{row}' for row in self.rows))

    @cached_property
    def _first(self) -> ModuleType:
        return generated.load(self.key, 'rates', lambda: _derivation().first(self))

    @cached_property
    def _higher(self) -> ModuleType:
        return generated.load(self.key, 'higher', lambda: _derivation().higher(self))

    def rates(self, x: Sequence[Any], p: Sequence[Any]) -> list[Any]:
        """Return the rate of each variable.

        Args:
            x: the arguments, arrays.
            p: the parameters of ``rows``, numbers or arrays.

        """
        return list(self._first.rates(*x, *p))

    def slopes(self, x: Sequence[Any], p: Sequence[Any]
               ) -> tuple[list[Any], dict[tuple[int, int], Any]]:
        """Return the rates, and (variable, argument) -> derivative, those not identically 0."""
        rates, found = self._first.slopes(*x, *p)
        return list(rates), dict(zip(self._first.SLOPES, found, strict=True))

    def by_parameter(self, x: Sequence[Any], p: Sequence[Any]) -> dict[tuple[int, int], Any]:
        """Return (variable, row) -> derivative of the rate, those not identically 0."""
        return dict(zip(self._first.BY_PARAMETER, self._first.by_parameter(*x, *p), strict=True))

    def by_parameter_and_argument(self, x: Sequence[Any], p: Sequence[Any]
                                  ) -> dict[tuple[int, int, int], Any]:
        """Return (variable, row, argument) -> mixed second derivative, those not 0."""
        return dict(zip(self._higher.MIXED, self._higher.mixed(*x, *p), strict=True))

    def second(self, x: Sequence[Any], p: Sequence[Any]) -> dict[tuple[int, int, int], Any]:
        """Return (variable, argument, argument) -> second derivative, arguments rising."""
        return dict(zip(self._higher.SECOND, self._higher.second(*x, *p), strict=True))

    def third(self, x: Sequence[Any], p: Sequence[Any]
              ) -> dict[tuple[int, int, int, int], Any]:
        """Return (variable, three arguments) -> third derivative, arguments rising."""
        return dict(zip(self._higher.THIRD, self._higher.third(*x, *p), strict=True))


def multilinear(derivatives: Mapping[Any, Any], sets: Sequence[Any]) -> dict[int, Any]:
    """Return variable -> second or third derivative of its rate at two or three disturbances.

    Args:
        derivatives: as ``second`` and ``third`` return them.
        sets: disturbances of the arguments.

    """
    out: dict[int, Any] = {}
    for (v, *places), value in derivatives.items():
        for order in set(permutations(places)):
            out[v] = out.get(v, 0.0) + value * prod(
                one[k] for one, k in zip(sets, order, strict=True))
    return out


def _derivation() -> ModuleType:
    # sympy takes a third of a second to load, and is needed once for each set of equations.
    from cpg_ros.networks import derivation
    return derivation


@cache
def equations_of(network: type[NetworkDefinition]) -> Equations:
    """Return a network's equations, read once."""
    return Equations(network)


def values_of(network: NetworkDefinition) -> list[np.ndarray]:
    """Return the parameters of the equations' rows, each one number or one for each cell."""
    equations = equations_of(type(network))
    return [np.array([getattr(network, name) for name in equations.by_cell[row]])
            if row in equations.by_cell else np.array(getattr(network, row))
            for row in equations.rows]

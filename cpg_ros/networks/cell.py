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

"""A cell of a network and its parameters, as the network's equations see them."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass

from cpg_ros.networks.terms import Term

#: Which cell each cell hears, from 0.
Source = tuple[int, ...]
#: The same, or a rule: cell -> the cell that it hears, counted round.
Heard = Source | Callable[[int], int]


@dataclass(frozen=True)
class Argument:
    """A state variable as it stands in the equations of a cell.

    Attributes:
        variable: of the cell that is heard, from 0.
        source: the cell that each cell hears; None for itself.
        delayed: whether it is heard a delay ago.

    """

    variable: int
    source: Source | None
    delayed: bool


class Cell:
    """Any cell of a network, as its equations see it."""

    def __init__(self, variables: int, cells: int) -> None:
        """Begin to note what is heard."""
        self._variables, self._cells = variables, cells
        self.arguments: list[Argument] = []

    def now(self, source: Heard | None = None) -> tuple[Term, ...]:
        """Return the variables of the cell itself, or of those that each cell hears."""
        return self._heard(source, False)

    def past(self, source: Heard | None = None) -> tuple[Term, ...]:
        """Return the same as they were a delay ago."""
        return self._heard(source, True)

    def _heard(self, source: Heard | None, delayed: bool) -> tuple[Term, ...]:
        if callable(source):
            source = tuple(source(i) % self._cells for i in range(self._cells))
        found = []
        for variable in range(self._variables):
            one = Argument(variable, None if source is None else tuple(source), delayed)
            if one not in self.arguments:
                self.arguments.append(one)
            found.append(Term(f'x{self.arguments.index(one)}'))
        return tuple(found)


class Parameters:
    """A network's parameters, as its equations see them: one number, or one for each cell."""

    def __init__(self, names: Iterable[str]) -> None:
        """Offer the parameters by name, and groups that have one for each cell."""
        self._known = set(names)

    def __getattr__(self, name: str) -> Term:
        if name not in self._known:
            raise AttributeError(f"'{name}' is not one of {', '.join(sorted(self._known))}")
        return Term(f'p_{name}')

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

"""A network's equations, and functions on arrays from them.

All cells obey the same equations, in which other cells are inputs, now or a delay ago
(``Network.equations``). sympy derives the exact rates and derivatives from their text as numpy
code, which is cached on disk.
"""

from collections.abc import Callable, Mapping, Sequence
from functools import cache, cached_property
import hashlib
import importlib.util
from itertools import permutations
from math import prod
from pathlib import Path
import re
import sys
from types import ModuleType
from typing import Any, Generic

from cpg_ros.common.cache_folder import cache_folder, writing
from cpg_ros.common.files import write_atomically
from cpg_ros.networks.definition import AnyDefinition, Cell, NetworkDefinition, Parameters, Term
import numpy as np

# Code that is compiled and generated from a network's equations, kept on disk between processes.

#: Subpackages with compiled code and with the constants that are compiled into it.
_COMPILED_PACKAGES = ('networks', 'dynamics', 'motion', 'feedback')


def folder(key: str = 'package') -> Path | None:
    """Return the cache folder of compiled code, of the package or of a network's equations.

    The folder's name contains a digest of the sources, so that any edit leads to another folder;
    numba's own cache watches the file of a kernel only, not those of the functions that it calls.

    Args:
        key: of the equations, see Equations.key.

    Returns:
        The folder, None if none can be written.

    """
    return cache_folder(f'{key}-{_sources_digest()}')


@cache
def _sources_digest() -> str:
    """Return a digest of all files with compiled code."""
    digest = hashlib.sha256()
    package = Path(__file__).resolve().parent.parent
    for room in _COMPILED_PACKAGES:
        for source in sorted((package / room).rglob('*.py')):
            digest.update(source.read_bytes())
    return digest.hexdigest()[:14]


def load(key: str, name: str, write: Callable[[], str]) -> ModuleType:
    """Return a generated module; write it first if it is not on disk.

    Args:
        key: of the equations from which it follows.
        name: of the module.
        write: returns the text.

    """
    module_name = f'cpg_ros_generated_{key}_{name}'
    if module_name in sys.modules:
        return sys.modules[module_name]
    cache = folder(key)
    path = None if cache is None else cache / f'{name}.py'
    if path is None or not path.exists():
        text = write()
        if path is not None:
            with writing():
                write_atomically(path, text)
        if path is None or not path.exists():
            module = sys.modules[module_name] = ModuleType(module_name)
            exec(compile(text, module_name, 'exec'), vars(module))
            return module
    spec = importlib.util.spec_from_file_location(module_name, path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    # Under its name, or numba's disk cache does not find the module of what it has compiled.
    sys.modules[module_name] = module
    spec.loader.exec_module(module)
    return module


class Equations:
    """The equations of a network, with functions on arrays.

    Arrays of a variable, an argument or a parameter have one shape, or shapes that broadcast.

    Attributes:
        arguments: of the equations, in order.
        rows: parameters, or groups of them, in the equations.
        by_cell: name with a parameter for each cell -> these parameters.
        texts: rate of each variable, with x0, x1 ... for arguments and p_NAME for parameters.
        key: digest of everything that follows from them.

    """

    def __init__(self, network: type[NetworkDefinition]) -> None:
        """Read a network's equations.

        Raises:
            TypeError: the number of equations is not that of a cell's variables, or they read the
                past of a network without a delay.

        """
        cell = Cell(network.variables, network.cells)
        rates = network.equations(cell, Parameters(
            (*network.parameters(), *network.by_cell()), network.constants))
        self.texts = tuple(term.text if isinstance(term, Term) else repr(float(term))
                           for term in rates)
        if len(self.texts) != network.variables:
            raise TypeError(f'{network.__name__}.equations returns {len(self.texts)} rates for '
                            f'{network.variables} variables')
        if not network.delay_parameter and any(one.delayed for one in cell.arguments):
            raise TypeError(f'{network.__name__}.equations reads the past, but the network names '
                            'no delay_parameter')
        text = ' '.join(self.texts)
        self._numbers = tuple(k for k in range(len(cell.arguments))
                              if re.search(rf'\bx{k}\b', text))
        self.arguments = tuple(cell.arguments[k] for k in self._numbers)
        self.by_cell = network.by_cell()
        self.rows = tuple(dict.fromkeys(re.findall(r'\bp_(\w+)', text)))
        words = repr((self.texts, cell.arguments, network.cells))
        digest = hashlib.sha256(words.encode()).hexdigest()[:16]
        self.key = f'{network.name.replace("+", "_")}_{digest}'

    @property
    def names(self) -> tuple[str, ...]:
        """Symbols in the texts: arguments, then parameters."""
        return (*(f'x{k}' for k in self._numbers), *(f'p_{row}' for row in self.rows))

    @cached_property
    def _first(self) -> ModuleType:
        return load(self.key, 'rates', lambda: _derivation().first(self))

    @cached_property
    def _higher(self) -> ModuleType:
        return load(self.key, 'higher', lambda: _derivation().higher(self))

    def derive(self, higher: bool) -> list[ModuleType]:
        """Return the code of the rates and of first, or also higher, derivatives, as on disk."""
        return [self._first, *([self._higher] if higher else [])]

    def rates(self, x: Sequence[Any], p: Sequence[Any]) -> list[Any]:
        """Return the rate of each variable.

        Args:
            x: the arguments, arrays.
            p: the parameters of ``rows``, numbers or arrays.

        """
        return list(self._first.rates(*x, *p))

    def slopes(self, x: Sequence[Any], p: Sequence[Any]
               ) -> tuple[list[Any], dict[tuple[int, int], Any]]:
        """Return the rates, and (variable, argument) -> derivative, without those that vanish."""
        rates, slopes = self._first.slopes(*x, *p)
        return list(rates), dict(zip(self._first.SLOPES, slopes, strict=True))

    def by_parameter(self, x: Sequence[Any], p: Sequence[Any]) -> dict[tuple[int, int], Any]:
        """Return (variable, row) -> derivative of the rate, without those that vanish."""
        return dict(zip(self._first.BY_PARAMETER, self._first.by_parameter(*x, *p), strict=True))

    def by_parameter_and_argument(self, x: Sequence[Any], p: Sequence[Any]
                                  ) -> dict[tuple[int, int, int], Any]:
        """Return (variable, row, argument) -> mixed second derivative, without vanishing ones."""
        return dict(zip(self._higher.MIXED, self._higher.mixed(*x, *p), strict=True))

    def higher(self, order: int, x: Sequence[Any], p: Sequence[Any]
               ) -> dict[tuple[int, ...], Any]:
        """Return (variable, arguments) -> derivative of order 2 or 3; arguments ascend."""
        indices, derive = ((self._higher.SECOND, self._higher.second) if order == 2 else
                           (self._higher.THIRD, self._higher.third))
        return dict(zip(indices, derive(*x, *p), strict=True))


def multilinear(derivatives: Mapping[Any, Any], sets: Sequence[Any]) -> dict[int, Any]:
    """Return variable -> second or third derivative of its rate along two or three disturbances.

    Args:
        derivatives: as ``Equations.higher`` returns them.
        sets: disturbances of the arguments.

    """
    out: dict[int, Any] = {}
    for (v, *indices), value in derivatives.items():
        for order in set(permutations(indices)):
            out[v] = out.get(v, 0.0) + value * prod(
                vectors[k] for vectors, k in zip(sets, order, strict=True))
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
    """Return the parameters of the equations' rows, one number each or one for each cell."""
    equations = equations_of(type(network))
    return [np.array([getattr(network, name) for name in equations.by_cell[row]])
            if row in equations.by_cell else np.array(getattr(network, row))
            for row in equations.rows]


# A network's right-hand side on arrays, with exact derivatives, on all cells or a quotient.

#: States now and a delay ago, shape (..., d) each; None where there is no delay.
States = tuple[np.ndarray, np.ndarray | None]


class Field(Generic[AnyDefinition]):
    """``dx/dt = f(x(t), x(t - tau); p)`` of a network, or of one cell of each class.

    Attributes:
        size: number of cells that are kept.
        kept: indices of the components that represent all, shape (d,).
        columns: index among these of each component of the network, shape (components,).

    """

    def __init__(self, network: AnyDefinition, classes: np.ndarray | None = None) -> None:
        """Prepare for a network.

        Args:
            network: parameters.
            classes: class of each cell, from 0, shape (cells,); by default each cell is its own.

        """
        cells, variables = network.cells, network.variables
        classes = np.arange(cells) if classes is None else classes
        first = np.unique(classes, return_index=True)[1]
        blocks = np.arange(variables)[:, None]
        self.network, self.size = network, first.size
        self.kept = (first + blocks * cells).ravel()
        self.columns = (classes + blocks * self.size).ravel()
        self._equations = equations_of(type(network))
        #: For each argument, its columns for the kept cells.
        self._inputs = [self.columns[argument.variable * cells + np.asarray(
            range(cells) if argument.source is None else argument.source)[first]]
            for argument in self._equations.arguments]
        self._p = [value[first] if value.ndim else value for value in values_of(network)]
        columns = list(network.parameters())
        #: For each row of parameters, the columns of the kept cells.
        by_cell = self._equations.by_cell
        self._columns = [np.array([columns.index(name) for name in by_cell[row]])[first]
                         if row in by_cell else columns.index(row)
                         for row in self._equations.rows]

    def _arguments(self, now: np.ndarray, past: np.ndarray | None) -> list[np.ndarray]:
        return [(past if argument.delayed and past is not None else now)[..., indices]
                for argument, indices in zip(self._equations.arguments, self._inputs, strict=True)]

    def _filled(self, rates: list, shape: tuple[int, ...]) -> np.ndarray:
        out = np.empty(shape)
        for v, rate in enumerate(rates):
            out[..., v * self.size:(v + 1) * self.size] = rate
        return out

    def rates(self, now: np.ndarray, past: np.ndarray | None = None) -> np.ndarray:
        """Return the right-hand side, shape (..., d).

        Args:
            now: states, shape (..., d).
            past: states a delay ago, by default those of now.

        """
        return self._filled(self._equations.rates(self._arguments(now, past), self._p), now.shape)

    def linearised(self, now: np.ndarray, past: np.ndarray | None = None
                   ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return rates, shape (..., d), and Jacobians by now and by past, shape (..., d, d).

        Without a delay the last two axes of the last one have length 0.
        """
        rates, slopes = self._equations.slopes(self._arguments(now, past), self._p)
        delays = any(argument.delayed for argument in self._equations.arguments)
        d = now.shape[-1]
        by_now = np.zeros((*now.shape, d))
        by_past = np.zeros((*now.shape, d) if delays else (*now.shape[:-1], 0, 0))
        i = np.arange(self.size)
        for (v, k), slope in slopes.items():
            into = by_past if self._equations.arguments[k].delayed else by_now
            into[..., i + v * self.size, self._inputs[k]] += slope
        return self._filled(rates, now.shape), by_now, by_past

    def terms(self, now: np.ndarray, order: int) -> dict[tuple[int, ...], Any]:
        """Return (variable, arguments) -> derivative of order 1 to 3 at a state, for all cells."""
        x = self._arguments(now, None)
        if order > 1:
            return self._equations.higher(order, x, self._p)
        return dict(self._equations.slopes(x, self._p)[1].items())

    def multilinear(self, at: States, *sets: States, sizes: bool = False) -> np.ndarray:
        """Return the second or third derivative of the rates, B(a, b) or C(a, b, c), (..., d).

        Args:
            at: states.
            sets: two or three disturbances, which may be complex.
            sizes: return the sums of the moduli of all terms instead.

        """
        out = np.zeros(sets[0][0].shape, dtype=complex)
        derivatives = self._equations.higher(len(sets), self._arguments(*at), self._p)
        vectors = [self._arguments(*states) for states in sets]
        if sizes:
            derivatives = {key: abs(value) for key, value in derivatives.items()}
            vectors = [[abs(entry) for entry in entries] for entries in vectors]
        for v, rate in multilinear(derivatives, vectors).items():
            out[..., v * self.size:(v + 1) * self.size] = rate
        return out

    def linear_along(self, now: np.ndarray, direction: np.ndarray
                     ) -> tuple[np.ndarray, np.ndarray]:
        """Return derivatives of the Jacobians at an equilibrium along parameters, (d, d) each.

        Args:
            now: the equilibrium, which stays, shape (d,).
            direction: of the parameters, shape (parameters,).

        """
        result, i = np.zeros((2, now.size, now.size)), np.arange(self.size)
        mixed = self._equations.by_parameter_and_argument(self._arguments(now, None), self._p)
        for (v, r, k), slope in mixed.items():
            into = result[int(self._equations.arguments[k].delayed)]
            into[i + v * self.size, self._inputs[k]] += slope * direction[self._columns[r]]
        return result[0], result[1]

    def by_parameter(self, now: np.ndarray, past: np.ndarray | None = None) -> np.ndarray:
        """Return the derivative of the rates by the parameters, shape (..., d, parameters).

        It excludes the effect of the delay, which depends on the slope of the past.
        """
        out = np.zeros((*now.shape, len(self.network.parameters())))
        i = np.arange(self.size)
        slopes = self._equations.by_parameter(self._arguments(now, past), self._p)
        for (v, r), slope in slopes.items():
            out[..., i + v * self.size, self._columns[r]] += slope
        return out

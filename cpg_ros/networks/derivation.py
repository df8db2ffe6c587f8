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

"""Numpy code for a network's rates and their derivatives, derived by sympy."""

from collections.abc import Iterable, Sequence
from itertools import combinations_with_replacement, islice, product
from typing import Any, Protocol

from cpg_ros.networks.definition import Argument
import sympy
from sympy.printing.numpy import NumPyPrinter


class EquationTexts(Protocol):
    """Texts of the equations, from which the functions of Equations are generated."""

    texts: tuple[str, ...]
    arguments: tuple[Argument, ...]
    rows: tuple[str, ...]

    @property
    def names(self) -> tuple[str, ...]:
        """Symbols in the texts: arguments, then parameters."""


class _Printer(NumPyPrinter):  # type: ignore[misc]
    """Printer of numpy code, with all digits of numbers."""

    def _print_Float(self, value: Any) -> str:
        return repr(float(value))  # sympy omits two digits.


_PRINTER = _Printer({'fully_qualified_modules': False, 'allow_unknown_functions': False})


def expressions(equations: EquationTexts) -> tuple[list[Any], list[Any]]:
    """Return the equations as sympy expressions, and their symbols in the order of ``names``."""
    symbols = {name: sympy.Symbol(name, real=True) for name in equations.names}
    return ([sympy.sympify(text, locals=symbols) for text in equations.texts],
            list(symbols.values()))


def _function(name: str, symbols: Sequence[Any], parts: Sequence[Sequence[Any]]) -> str:
    """Write a function that returns expressions and computes common subexpressions once."""
    shared, reduced = sympy.cse([value for part in parts for value in part],
                                sympy.numbered_symbols('s'))
    lines = [f'def {name}({", ".join(map(str, symbols))}):']
    lines += [f'    {symbol} = {_PRINTER.doprint(value)}' for symbol, value in shared]
    written, results = [], iter(reduced)
    for part in parts:
        texts = (f'{_PRINTER.doprint(value)}, ' for value in islice(results, len(part)))
        written.append(f'({"".join(texts)})')
    lines.append(f'    return {written[0] if len(parts) == 1 else ", ".join(written)}')
    return '\n'.join(lines)


def _nonzero(table: Iterable[tuple[tuple[int, ...], Any]]) -> tuple[list[Any], list[Any]]:
    nonzero = [(index, entry) for index, entry in table if entry != 0]
    return [index for index, _ in nonzero], [entry for _, entry in nonzero]


def _source(*parts: str) -> str:
    text = '\n\n\n'.join(parts)
    functions = [word for word in ('abs', 'cos', 'cosh', 'exp', 'log', 'sign', 'sin', 'sinh',
                                   'sqrt', 'tan', 'tanh') if f'{word}(' in text]
    head = f'from numpy import {", ".join(functions)}\n\n\n' if functions else ''
    return f'{head}{text}\n'


def first(equations: EquationTexts) -> str:
    """Write the rates, and their derivatives by the arguments and the parameters."""
    rates, symbols = expressions(equations)
    count = len(equations.arguments)
    slopes, entries = _nonzero(((v, k), sympy.diff(rate, symbols[k])) for (v, rate), k
                               in product(enumerate(rates), range(count)))
    rows, columns = _nonzero(((v, r), sympy.diff(rate, symbols[count + r])) for (v, rate), r
                             in product(enumerate(rates), range(len(equations.rows))))
    return _source(f'SLOPES = {slopes!r}\nBY_PARAMETER = {rows!r}',
                   _function('rates', symbols, [rates]),
                   _function('slopes', symbols, [rates, entries]),
                   _function('by_parameter', symbols, [columns]))


def _smooth(part: Any) -> Any:
    """Drop delta functions at kinks, so that derivatives are one-sided."""
    return part.replace(sympy.DiracDelta, lambda *_: sympy.Integer(0))


def higher(equations: EquationTexts) -> str:
    """Write second and third derivatives by the arguments, and mixed ones by a parameter."""
    rates, symbols = expressions(equations)
    count = len(equations.arguments)
    texts, tables = [], []
    for name, order in (('second', 2), ('third', 3)):
        indices, entries = _nonzero(
            ((v, *ks), _smooth(sympy.diff(rate, *(symbols[k] for k in ks)))) for (v, rate), ks
            in product(enumerate(rates), combinations_with_replacement(range(count), order)))
        tables.append(f'{name.upper()} = {indices!r}')
        texts.append(_function(name, symbols, [entries]))
    indices, entries = _nonzero(
        ((v, r, k), _smooth(sympy.diff(rate, symbols[count + r], symbols[k])))
        for (v, rate), r, k
        in product(enumerate(rates), range(len(equations.rows)), range(count)))
    tables.append(f'MIXED = {indices!r}')
    texts.append(_function('mixed', symbols, [entries]))
    return _source('\n'.join(tables), *texts)

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

"""C functions of a network's right-hand side, from the loops that its compiled kernel has.

``drive(past, p, driven)`` is what depends on delayed states alone, ``field(z, driven, p, out)``
the rates; see integration.field_code.
"""

from textwrap import fill
from typing import Any, NamedTuple

from cpg_ros.export.c_text import WIDTH
from cpg_ros.integration.field_code import lowered_parts, LoweredPart
from cpg_ros.networks.equations import Equations
import sympy
from sympy.printing.c import C99CodePrinter

HEADS = {'drive': 'static void drive(const cpg_real *past, const cpg_real *p, cpg_real *driven)',
         'field': 'static void field(const cpg_real *z, const cpg_real *driven, const cpg_real *p,'
                  '\n                  cpg_real *out)'}


class _Printer(C99CodePrinter):  # type: ignore[misc]
    """C in the type that the macros R (of a number) and F (of a function) stand for."""

    def _print_Float(self, value: Any) -> str:
        return f'R({float(value)!r})'

    _print_Integer = _print_Rational = _print_Pi = _print_Half = _print_One = _print_Float
    _print_NegativeOne = _print_Zero = _print_Exp1 = _print_Float

    def _print_Pow(self, power: Any) -> str:
        base, exponent = power.args
        if exponent.is_Integer and 0 < abs(exponent) <= 4:
            text = '*'.join([self.parenthesize(base, 100)] * abs(int(exponent)))
            return f'({text})' if exponent > 0 else f'R(1.0)/({text})'
        if abs(float(exponent)) == 0.5:
            root = f'F(sqrt)({self._print(base)})'
            return root if exponent > 0 else f'R(1.0)/{root}'
        return f'F(pow)({self._print(base)}, {self._print(exponent)})'

    def _print_Function(self, call: Any) -> str:
        name = {'Abs': 'fabs'}.get(type(call).__name__, type(call).__name__.lower())
        return f'F({name})({", ".join(map(self._print, call.args))})'

    _print_Abs = _print_exp = _print_sin = _print_cos = _print_tanh = _print_Function
    _print_cosh = _print_log = _print_Function


class FieldSource(NamedTuple):
    """The functions, and what they need.

    Attributes:
        text: C.
        driven: arrays, of one number for each cell, that drive fills in.
        parameters: numbers in p, row by row: one, or one for each cell.

    """

    text: str
    driven: int
    parameters: int


class _Names:
    """What symbols are called in C, at cell i."""

    def __init__(self, equations: Equations, cells: int, each: bool) -> None:
        self._p: dict[str, str] = {}
        self.size = 0
        for row in equations.rows:
            own = each or row in equations.by_cell
            self._p[f'p_{row}'] = f'p[{self.size} + i]' if own else f'p[{self.size}]'
            self.size += cells if own else 1
        self.sources: dict[tuple[int, ...], int] = {}
        self._printer = _Printer()

    def element(self, part: LoweredPart, expression: Any, place: str = 'i') -> str:
        """Return C of an expression at a place."""
        text = {}
        fetched = {str(symbol): (what, source) for symbol, what, source in part.program.fetched}
        state = 'past' if part.name == 'drive' else 'z'
        for symbol in sorted(expression.free_symbols, key=str):
            name = str(symbol)
            if name in fetched:
                what, source = fetched[name]
                number = self.sources.setdefault(source, len(self.sources))
                text[symbol] = self.element(part, what, f'source_{number}[{place}]')
            elif name in self._p:
                text[symbol] = self._p[name]
            elif name[0] == 'z' and name[1:].isdigit():
                text[symbol] = f'{state}[{_block(name)}{place}]'
            elif name[0] == 'd' and name[1:].isdigit():
                text[symbol] = f'driven[{_block(name)}{place}]'
            elif name[0] == 'w' and name[1:].isdigit():
                text[symbol] = f'{name}[{place}]'
        return str(self._printer.doprint(expression.xreplace(
            {symbol: sympy.Symbol(word, real=True) for symbol, word in text.items()})))


def _block(name: str) -> str:
    return '' if name[1:] == '0' else f'{name[1:]} * CPG_CELLS + '


def _loop(lines: list[str]) -> list[str]:
    wrapped = [fill(line, WIDTH, initial_indent=8 * ' ', subsequent_indent=12 * ' ',
                    break_long_words=False, break_on_hyphens=False) for line in lines]
    return ['    for (int16_t i = 0; i < CPG_CELLS; i++) {', *wrapped, '    }']


def _function(part: LoweredPart, names: _Names) -> str:
    """Write one of the functions: a loop for what other cells hear, and one for all results."""
    waiting, done = list(part.program.functions), set[Any]()
    lines: list[str] = []
    heard = {symbol: what for symbol, what, _ in part.program.fetched}
    needed = {symbol for symbol, _ in waiting}
    while waiting:
        ready = [one for one in waiting if not
                 {heard.get(symbol, symbol) for symbol in one[1].free_symbols} & needed - done]
        lines += _loop([f'{symbol}[i] = {names.element(part, call)};' for symbol, call in ready])
        done |= {symbol for symbol, _ in ready}
        waiting = [one for one in waiting if one not in ready]
    shared, results = sympy.cse(part.results, sympy.numbered_symbols('s'))
    out = 'driven' if part.name == 'drive' else 'out'
    lines += _loop([f'const cpg_real {symbol} = {names.element(part, value)};'
                    for symbol, value in shared]
                   + [f'{out}[{_block(f"o{k}")}i] = {names.element(part, value)};'
                      for k, value in enumerate(results)])
    arrays = [f'    cpg_real {symbol}[CPG_CELLS];' for symbol, _ in part.program.functions]
    body = '\n'.join(lines)
    arrays += [f'    (void){name};' for name in ('p', *(['driven'] if out == 'out' else []))
               if f'{name}[' not in body]
    return '\n'.join([HEADS[part.name], '{', *arrays, body, '}'])


def field_source(equations: Equations, cells: int, each: bool = False) -> FieldSource:
    """Write the functions of a network of so many cells.

    Args:
        equations: of the network.
        cells: that it has.
        each: every row of p has one number for each cell.

    """
    parts = lowered_parts(equations)
    names = _Names(equations, cells, each)
    functions = [_function(part, names) for part in parts]
    sources = [f'static CPG_ROM uint8_t source_{number}[CPG_CELLS] = '
               f'{{{", ".join(map(str, source))}}};' for source, number in names.sources.items()]
    return FieldSource('\n'.join(['', *sources, '', *'\n\n'.join(functions).splitlines(), '']),
                       len(parts[0].results) if len(parts) > 1 else 0, names.size)

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

"""C of a network's right-hand side: loops over all cells, or over all cells and lanes.

A function of another cell's variables is computed once, at that cell, and then fetched.
"""

from collections.abc import Sequence
from textwrap import fill
from typing import Any, NamedTuple

from cpg_ros.dynamics.integration.c_text import WIDTH
from cpg_ros.networks.definition import Argument, Source
from cpg_ros.networks.derivation import expressions
from cpg_ros.networks.equations import Equations
import sympy
from sympy.printing.c import C99CodePrinter


class LoopProgram:
    """Loops that compute expressions of arguments at one instant."""

    def __init__(self, arguments: Sequence[tuple[Any, Argument]], powers: dict[Any, Any]
                 ) -> None:
        self._arguments, self._powers = dict(arguments), powers
        self.functions: list[tuple[Any, Any]] = []
        self.fetched: list[tuple[Any, Any, Source]] = []

    def own(self, variable: int) -> Any:
        """Return the symbol of a cell's own variable."""
        return sympy.Symbol(f'z{variable}', real=True)

    def _fetch(self, what: Any, source: Source) -> Any:
        for symbol, quantity, origin in self.fetched:
            if quantity == what and origin == source:
                return symbol
        symbol = sympy.Symbol(f'g{len(self.fetched)}', real=True)
        self.fetched.append((symbol, what, source))
        return symbol

    def _function(self, call: Any) -> Any:
        for symbol, stored in self.functions:
            if stored == call:
                return symbol
        symbol = sympy.Symbol(f'w{len(self.functions)}', real=True)
        self.functions.append((symbol, call))
        return symbol

    def lowered(self, part: Any) -> Any:
        """Replace arguments and functions in an expression by results of the loops."""
        if part in self._arguments:
            argument = self._arguments[part]
            own = self.own(argument.variable)
            return own if argument.source is None else self._fetch(own, argument.source)
        if part in self._powers:
            return self.lowered(self._powers[part])
        if not part.args:
            return part
        if isinstance(part, sympy.Function):
            inputs = [self._arguments[symbol] for symbol in part.free_symbols
                      if symbol in self._arguments]
            sources = {argument.source for argument in inputs}
            if len(sources) == 1 and len(inputs) == len(part.free_symbols):
                # Computed where the cell is whose state it reads.
                source = sources.pop()
                replacement = part.xreplace({symbol: self.own(argument.variable)
                                             for symbol, argument in self._arguments.items()})
                result = self._function(self._inner(replacement))
                return result if source is None else self._fetch(result, source)
            return self._function(part.func(*(self.lowered(arg) for arg in part.args)))
        return part.func(*(self.lowered(arg) for arg in part.args))

    def _inner(self, call: Any) -> Any:
        """Replace functions within a function's arguments."""
        return call.func(*(arg.xreplace({inner: self._function(self._inner(inner))
                                         for inner in arg.atoms(sympy.Function)})
                           for arg in call.args))


# The right-hand side as loops, written from the equations.

def _share_exponentials(parts: list[Any]) -> tuple[list[Any], dict[Any, Any]]:
    """Write hyperbolic functions of multiples of one argument by one exponential.

    Returns:
        The expressions, and symbol in them (e0 ...) -> exponential.

    """
    calls = sorted({call for part in parts for call in part.atoms(sympy.tanh, sympy.cosh)},
                   key=str)
    rewritten: dict[Any, Any] = {}
    powers: dict[Any, Any] = {}
    for call in calls:
        if call.func is not sympy.cosh:
            continue
        base, power = call.args[0], sympy.Symbol(f'e{len(powers)}', real=True)
        powers[power] = sympy.exp(base)
        rewritten[call] = (power + 1 / power) / 2
        for other in calls:
            ratio = sympy.nsimplify(sympy.simplify(other.args[0] / base), rational=True)
            if other.func is sympy.tanh and ratio.is_Integer and ratio > 0:
                rewritten[other] = 1 - 2 / (power**(2 * ratio) + 1)
    return [part.xreplace(rewritten) for part in parts], powers


def _split(rates: list[Any], delayed: set[Any], now: set[Any]) -> tuple[list[Any], list[Any]]:
    """Split rates into the terms that depend on the past state, and the rest.

    Returns:
        Expressions in delayed arguments, and the rates with symbols (d0 ...) in place of them.

    """
    driven: list[Any] = []

    def symbol_of(part: Any) -> Any:
        if part not in driven:
            driven.append(part)
        return sympy.Symbol(f'd{driven.index(part)}', real=True)

    rest = []
    for rate in rates:
        alone = [term for term in sympy.Add.make_args(rate)
                 if term.free_symbols & delayed and not term.free_symbols & now]
        left = rate - sympy.Add(*alone)
        if alone:
            left = left + symbol_of(sympy.Add(*alone))
        mixed = {symbol: symbol_of(symbol) for symbol in sorted(
            left.free_symbols & delayed, key=str)}
        rest.append(left.xreplace(mixed))
    return driven, rest


class LoweredPart(NamedTuple):
    """A part of the right-hand side as loops over the cells.

    Attributes:
        name: ``drive``, terms in delayed states alone, or ``field``, the rates.
        program: functions that are computed first.
        results: expressions that the part returns, one for each array.

    """

    name: str
    program: LoopProgram
    results: list[Any]


def lowered_parts(equations: Equations) -> list[LoweredPart]:
    """Return ``drive``, if any input is delayed, and ``field``.

    The results of ``drive`` are d0, d1 ... in those of ``field``.
    """
    rates, symbols = expressions(equations)
    count = len(equations.arguments)
    arguments = list(zip(symbols[:count], equations.arguments, strict=True))
    delayed = {symbol for symbol, argument in arguments if argument.delayed}
    now = {symbol for symbol, argument in arguments if not argument.delayed}
    driven, rest = _split(rates, delayed, now)
    parts = []
    for name, results in (('drive', driven), ('field', rest)):
        if not results:
            continue
        results, powers = _share_exponentials(results)
        program = LoopProgram([(symbol, argument) for symbol, argument in arguments
                               if argument.delayed == (name == 'drive')], powers)
        parts.append(LoweredPart(name, program, [program.lowered(part) for part in results]))
    return parts


# C functions of a network's right-hand side, from these loops.

SIGNATURES = {
    'drive': 'static void drive(const cpg_real *past, const cpg_real *p, cpg_real *driven)',
    'field': 'static void field(const cpg_real *z, const cpg_real *driven, const cpg_real *p,'
             '\n                  cpg_real *out)'}


class _Printer(C99CodePrinter):  # type: ignore[misc]
    """Printer of C with numbers in R() and functions in F(), macros of the type."""

    def _print_Float(self, value: Any) -> str:
        return f'R({float(value)!r})'

    _print_Integer = _print_Rational = _print_Pi = _print_Half = _print_One = _print_Float
    _print_NegativeOne = _print_Zero = _print_Exp1 = _print_Float

    def _print_Pow(self, power: Any) -> str:
        base, exponent = power.args
        if exponent.is_Integer and 0 < abs(exponent) <= 4:
            text = '*'.join([self.parenthesize(base, 100)] * abs(int(exponent)))
            return f'({text})' if exponent > 0 else f'R(1.0)/({text})'
        if exponent.is_number and abs(float(exponent)) == 0.5:
            root = f'F(sqrt)({self._print(base)})'
            return root if exponent > 0 else f'R(1.0)/{root}'
        return f'F(pow)({self._print(base)}, {self._print(exponent)})'

    def _print_Function(self, call: Any) -> str:
        name = {'Abs': 'fabs'}.get(type(call).__name__, type(call).__name__.lower())
        return f'F({name})({", ".join(map(self._print, call.args))})'

    _print_Abs = _print_exp = _print_sin = _print_cos = _print_tanh = _print_Function
    _print_cosh = _print_log = _print_Function


class FieldSource(NamedTuple):
    """C of a network's functions, and the sizes of their arrays.

    Attributes:
        text: C.
        driven: number of arrays, of one number for each cell, that drive fills.
        parameters: numbers in p, row by row: one, or one for each cell.

    """

    text: str
    driven: int
    parameters: int


class _Names:
    """Names of symbols in C, at cell i."""

    def __init__(self, equations: Equations, cells: int, each: bool, lanes: int) -> None:
        cells, each = cells * max(1, lanes), each or lanes > 0
        self._from = 'FROM(source_{}, {})' if lanes else 'source_{}[{}]'
        self._head = 'EACH(i)' if lanes else 'for (int16_t i = 0; i < CPG_CELLS; i++)'
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
                text[symbol] = self.element(part, what, self._from.format(number, place))
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

    def loop(self, lines: list[str]) -> list[str]:
        """Return a loop over the cells."""
        wrapped = [fill(line, WIDTH, initial_indent=8 * ' ', subsequent_indent=12 * ' ',
                        break_long_words=False, break_on_hyphens=False) for line in lines]
        return [f'    {self._head} {{', *wrapped, '    }']


def _block(name: str) -> str:
    return '' if name[1:] == '0' else f'{name[1:]} * CPG_CELLS + '


def _c_function(part: LoweredPart, names: _Names) -> str:
    """Return C of a function: a loop for the terms of other cells, and one for all results."""
    waiting, done = list(part.program.functions), set[Any]()
    lines: list[str] = []
    inputs = {symbol: what for symbol, what, _ in part.program.fetched}
    needed = {symbol for symbol, _ in waiting}
    while waiting:
        ready = [call for call in waiting if not
                 {inputs.get(symbol, symbol) for symbol in call[1].free_symbols} & needed - done]
        lines += names.loop([f'{symbol}[i] = {names.element(part, call)};'
                             for symbol, call in ready])
        done |= {symbol for symbol, _ in ready}
        waiting = [call for call in waiting if call not in ready]
    shared, results = sympy.cse(part.results, sympy.numbered_symbols('s'))
    out = 'driven' if part.name == 'drive' else 'out'
    lines += names.loop([f'const cpg_real {symbol} = {names.element(part, value)};'
                         for symbol, value in shared]
                        + [f'{out}[{_block(f"o{k}")}i] = {names.element(part, value)};'
                           for k, value in enumerate(results)])
    arrays = [f'    cpg_real {symbol}[CPG_CELLS];' for symbol, _ in part.program.functions]
    body = '\n'.join(lines)
    arrays += [f'    (void){name};' for name in ('p', *(['driven'] if out == 'out' else []))
               if f'{name}[' not in body]
    return '\n'.join([SIGNATURES[part.name], '{', *arrays, body, '}'])


def field_source(equations: Equations, cells: int, each: bool = False, lanes: int = 0
                 ) -> FieldSource:
    """Return C of a network's functions.

    Args:
        equations: of the network.
        cells: their number.
        each: every row of p has one number for each cell.
        lanes: their number in ``c/lanes.c``, where every row has one number for each cell and
            lane; 0 for other files.

    """
    parts = lowered_parts(equations)
    names = _Names(equations, cells, each, lanes)
    functions = [_c_function(part, names) for part in parts]
    size = cells if lanes else 'CPG_CELLS'
    sources = [f'static CPG_ROM uint8_t source_{number}[{size}] = '
               f'{{{", ".join(map(str, source))}}};' for source, number in names.sources.items()]
    return FieldSource('\n'.join(['', *sources, '', *'\n\n'.join(functions).splitlines(), '']),
                       len(parts[0].results) if len(parts) > 1 else 0, names.size)

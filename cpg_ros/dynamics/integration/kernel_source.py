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

"""Kernel code of a network's right-hand side, in Python and C: loops over all cells and lanes.

A function of another cell's variables is computed once, at that cell, and then fetched. Each
elementary function and each result has a loop of its own, which compilers vectorise.
"""

from collections.abc import Sequence
from textwrap import fill
from typing import Any, NamedTuple

from cpg_ros.dynamics.integration.c_text import WIDTH
from cpg_ros.networks.definition import Argument, Source
from cpg_ros.networks.derivation import expressions, print_float
from cpg_ros.networks.equations import Equations
import sympy
from sympy.printing.c import C99CodePrinter
from sympy.printing.pycode import PythonCodePrinter


class _KernelPrinter(PythonCodePrinter):  # type: ignore[misc]
    """Printer of Python, with all digits of numbers."""

    _print_Float = print_float


_PRINTER = _KernelPrinter({'fully_qualified_modules': False})


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
                there = part.xreplace({symbol: self.own(argument.variable)
                                       for symbol, argument in self._arguments.items()})
                result = self._function(self._inner(there))
                return result if source is None else self._fetch(result, source)
            return self._function(part.func(*(self.lowered(arg) for arg in part.args)))
        return part.func(*(self.lowered(arg) for arg in part.args))

    def _inner(self, call: Any) -> Any:
        """Replace functions within a function's arguments."""
        return call.func(*(arg.xreplace({inner: self._function(self._inner(inner))
                                         for inner in arg.atoms(sympy.Function)})
                           for arg in call.args))


class Writer:
    """Writer of a program's loops as the body of a function."""

    def __init__(self, program: LoopProgram, sources: dict[Source, int]) -> None:
        self._program, self.sources = program, sources
        self.lines: list[str] = []
        #: Fetched array -> by how many cells it is behind the array that it is fetched from.
        self.rings: dict[str, int] = {}
        self._allot()

    def _allot(self) -> None:
        """Assign every array a place in the scratch memory."""
        program = self._program
        behind: dict[Any, Any] = {}
        for symbol, what, source in program.fetched:
            shift = -source[0] % len(source)
            ring = tuple((cell - shift) % len(source) for cell in range(len(source)))
            if source == ring and what not in behind.values() and any(
                    what == name for name, _ in program.functions):
                behind[symbol] = what
                self.rings[str(symbol)] = shift
        self.arrays, self.extra = 0, 0
        for symbol, *_ in (*program.functions, *program.fetched):
            if symbol in behind.values():
                continue
            used = f'{self.arrays} * m + {self.extra} * lanes'
            self.lines.append(f'{symbol} = work[{used}:{used} + m]')
            if symbol in behind:
                shift = self.rings[str(symbol)]
                used += f' + {shift} * lanes'
                self.lines.append(f'{behind[symbol]} = work[{used}:{used} + m]')
                self.extra += shift
            self.arrays += 1

    def _elements(self, part: Any) -> str:
        """Return the code of an expression at index i."""
        names = {symbol: sympy.Symbol(f'{symbol}[i]') for symbol in part.free_symbols}
        return str(_PRINTER.doprint(part.xreplace(names)))

    def loops(self, results: Sequence[tuple[str, Any]]) -> None:
        """Return the code of all loops: functions, fetched arrays and results (name, value)."""
        program = self._program
        done: set[Any] = set()
        waiting_f = list(program.functions)
        waiting_g = list(program.fetched)
        needed = {symbol for symbol, _ in waiting_f} | {symbol for symbol, _, _ in waiting_g}
        while waiting_f or waiting_g:
            ready_f = [call for call in waiting_f if not call[1].free_symbols & needed - done]
            ready_g = [call for call in waiting_g if not call[1].free_symbols & needed - done]
            for symbol, call in ready_f:
                self._loop(str(symbol), self._elements(call))
                done.add(symbol)
                waiting_f.remove((symbol, call))
            for symbol, what, source in ready_g:
                self._copy(str(symbol), str(what), source)
                done.add(symbol)
                waiting_g.remove((symbol, what, source))
        for name, part in results:
            self._loop(name, self._elements(part))

    def _loop(self, target: str, code: str) -> None:
        self.lines += ['for i in range(m):', f'    {target}[i] = {code}']

    def _copy(self, target: str, array: str, source: Source) -> None:
        """Fetch the inputs of each cell, in blocks of cells that lie evenly in both arrays."""
        if target in self.rings:
            # The ring lies straight in memory: only what it begins with has to be copied.
            shift = self.rings[target]
            self.lines += [f'to, of = {target}[:{shift} * lanes], {array}[m - {shift} * lanes:m]',
                           f'for i in range({shift} * lanes):', '    to[i] = of[i]']
            return
        index = self.sources.setdefault(source, len(self.sources))
        self.lines.append(f'fetch(lanes, SOURCE_{index}, {array}, {target})')


# Kernel code for a network's right-hand side, written from its equations.

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


def _function(name: str, head: str, doc: str, slices: Sequence[str], lines: Sequence[str]) -> str:
    body = ''.join(f'        {line}\n' for line in (*slices, *lines))
    return f'    @decorate\n    def {name}({head}):\n        """{doc}"""\n{body}'


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


def kernel_source(equations: Equations) -> str:
    """Write a module with ``compiled(decorate)``, which returns (drive or None, field).

    ``drive(n, past, p, lanes, work, out)`` fills ``DRIVEN`` arrays of length n / variables;
    ``field(n, z, driven, p, lanes, work, out)`` fills the rates. ``p`` has a row for each
    parameter of the equations, ``work`` memory for ``WORK`` such arrays and ``EXTRA`` cells.
    """
    parts = lowered_parts(equations)
    driven = len(parts[0].results) if len(parts) > 1 else 0
    variables = len(parts[-1].results)
    texts, most, extra = [], 0, 0
    sources: dict[Source, int] = {}
    for name, program, lowered in parts:
        state = 'past' if name == 'drive' else 'z'
        used = {str(symbol) for part in (*lowered, *(call for _, call in program.functions),
                                         *(what for _, what, _ in program.fetched))
                for symbol in part.free_symbols}
        slices = [f'm = n // {variables}']
        slices += [f'z{v} = {state}[{v} * m:{v + 1} * m]' for v in range(variables)
                   if f'z{v}' in used]
        slices += [f'd{k} = driven[{k} * m:{k + 1} * m]' for k in range(driven)
                   if f'd{k}' in used]
        slices += [f'p_{row} = p[{r}]' for r, row in enumerate(equations.rows)
                   if f'p_{row}' in used]
        slices += [f'o{k} = out[{k} * m:{k + 1} * m]' for k in range(len(lowered))]
        writer = Writer(program, sources)
        most, extra = max(most, writer.arrays), max(extra, writer.extra)
        writer.loops([(f'o{k}', part) for k, part in enumerate(lowered)])
        head = ('n, past, p, lanes, work, out' if name == 'drive'
                else 'n, z, driven, p, lanes, work, out')
        doc = ('What depends on delayed states alone.' if name == 'drive'
               else 'Right-hand side at z.')
        texts.append(_function(name, head, doc, slices, writer.lines))
    code = '\n'.join(texts)
    helpers = [word for word in ('exp', 'fetch', 'tanh') if f'{word}(' in code]
    others = [word for word in ('cos', 'log', 'sin', 'sqrt') if f'{word}(' in code]
    head = ''.join(line + '\n' for line in (
        f'from math import {", ".join(others)}' if others else '',
        f'from cpg_ros.dynamics.integration.compilation import {", ".join(helpers)}' if helpers
        else '') if line)
    head += 'from numpy import array\n' if sources else ''
    definitions = ''.join(f'SOURCE_{k} = array({source!r})\n' for source, k in sources.items())
    return (f'{head}\n{definitions}DRIVEN, WORK, EXTRA = {driven}, {most}, {extra}\n\n\n'
            f'def compiled(decorate):\n{code}\n    return {"drive" if driven else None}, field\n')


# C functions of a network's right-hand side, from the loops that its compiled kernel has.

HEADS = {'drive': 'static void drive(const cpg_real *past, const cpg_real *p, cpg_real *driven)',
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


def _c_function(part: LoweredPart, names: _Names) -> str:
    """Return C of a function: a loop for the terms of other cells, and one for all results."""
    waiting, done = list(part.program.functions), set[Any]()
    lines: list[str] = []
    inputs = {symbol: what for symbol, what, _ in part.program.fetched}
    needed = {symbol for symbol, _ in waiting}
    while waiting:
        ready = [call for call in waiting if not
                 {inputs.get(symbol, symbol) for symbol in call[1].free_symbols} & needed - done]
        lines += _loop([f'{symbol}[i] = {names.element(part, call)};' for symbol, call in ready])
        done |= {symbol for symbol, _ in ready}
        waiting = [call for call in waiting if call not in ready]
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
    """Return C of a network's functions.

    Args:
        equations: of the network.
        cells: their number.
        each: every row of p has one number for each cell.

    """
    parts = lowered_parts(equations)
    names = _Names(equations, cells, each)
    functions = [_c_function(part, names) for part in parts]
    sources = [f'static CPG_ROM uint8_t source_{number}[CPG_CELLS] = '
               f'{{{", ".join(map(str, source))}}};' for source, number in names.sources.items()]
    return FieldSource('\n'.join(['', *sources, '', *'\n\n'.join(functions).splitlines(), '']),
                       len(parts[0].results) if len(parts) > 1 else 0, names.size)

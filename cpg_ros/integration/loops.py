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

"""Loops over all cells and lanes that work out expressions, as kernel code.

A function of what another cell has is worked out where it is and then fetched, so that it is
worked out once. Loops are short: one for every elementary function and one for every result, which
compilers turn into vector instructions.
"""

from collections.abc import Sequence
from typing import Any

from cpg_ros.networks.cell import Argument, Source
from cpg_ros.networks.derivation import print_float
import sympy
from sympy.printing.pycode import PythonCodePrinter


class _KernelPrinter(PythonCodePrinter):  # type: ignore[misc]
    """Python, numbers to the last digit."""

    _print_Float = print_float


_PRINTER = _KernelPrinter({'fully_qualified_modules': False})


class LoopProgram:
    """Loops that work out expressions of arguments that are all heard at one time."""

    def __init__(self, arguments: Sequence[tuple[Any, Argument]], powers: dict[Any, Any]
                 ) -> None:
        self._arguments, self._powers = dict(arguments), powers
        self.functions: list[tuple[Any, Any]] = []
        self.fetched: list[tuple[Any, Any, Source]] = []

    def own(self, variable: int) -> Any:
        """Return the symbol of a cell's own variable."""
        return sympy.Symbol(f'z{variable}', real=True)

    def _fetch(self, what: Any, source: Source) -> Any:
        for symbol, known, place in self.fetched:
            if known == what and place == source:
                return symbol
        symbol = sympy.Symbol(f'g{len(self.fetched)}', real=True)
        self.fetched.append((symbol, what, source))
        return symbol

    def _function(self, call: Any) -> Any:
        for symbol, known in self.functions:
            if known == call:
                return symbol
        symbol = sympy.Symbol(f'w{len(self.functions)}', real=True)
        self.functions.append((symbol, call))
        return symbol

    def lowered(self, part: Any) -> Any:
        """Replace arguments and functions in an expression by what the loops have worked out."""
        if part in self._arguments:
            one = self._arguments[part]
            own = self.own(one.variable)
            return own if one.source is None else self._fetch(own, one.source)
        if part in self._powers:
            return self.lowered(self._powers[part])
        if not part.args:
            return part
        if isinstance(part, sympy.Function):
            heard = [self._arguments[symbol] for symbol in part.free_symbols
                     if symbol in self._arguments]
            sources = {one.source for one in heard}
            if len(sources) == 1 and len(heard) == len(part.free_symbols):
                # Worked out where the cell is that is heard.
                source = sources.pop()
                there = part.xreplace({symbol: self.own(one.variable)
                                       for symbol, one in self._arguments.items()})
                found = self._function(self._inner(there))
                return found if source is None else self._fetch(found, source)
            return self._function(part.func(*(self.lowered(arg) for arg in part.args)))
        return part.func(*(self.lowered(arg) for arg in part.args))

    def _inner(self, call: Any) -> Any:
        """Replace functions within a function's arguments."""
        return call.func(*(arg.xreplace({inner: self._function(self._inner(inner))
                                         for inner in arg.atoms(sympy.Function)})
                           for arg in call.args))


class Writer:
    """Writes the loops of a program as the body of a function."""

    def __init__(self, program: LoopProgram, sources: dict[Source, int]) -> None:
        self._program, self.sources = program, sources
        self.lines: list[str] = []
        #: Fetched array -> by how many cells it is behind the array that it is fetched from.
        self.rings: dict[str, int] = {}
        self._allot()

    def _allot(self) -> None:
        """Give every array its place in the room for work."""
        program = self._program
        behind: dict[Any, Any] = {}
        for symbol, what, source in program.fetched:
            turn = -source[0] % len(source)
            ring = tuple((cell - turn) % len(source) for cell in range(len(source)))
            if source == ring and what not in behind.values() and any(
                    what == name for name, _ in program.functions):
                behind[symbol] = what
                self.rings[str(symbol)] = turn
        self.arrays, self.extra = 0, 0
        for symbol, *_ in (*program.functions, *program.fetched):
            if symbol in behind.values():
                continue
            used = f'{self.arrays} * m + {self.extra} * lanes'
            self.lines.append(f'{symbol} = work[{used}:{used} + m]')
            if symbol in behind:
                turn = self.rings[str(symbol)]
                used += f' + {turn} * lanes'
                self.lines.append(f'{behind[symbol]} = work[{used}:{used} + m]')
                self.extra += turn
            self.arrays += 1

    def _elements(self, part: Any) -> str:
        """Code of an expression at place i."""
        names = {symbol: sympy.Symbol(f'{symbol}[i]') for symbol in part.free_symbols}
        return str(_PRINTER.doprint(part.xreplace(names)))

    def loops(self, results: Sequence[tuple[str, Any]]) -> None:
        """Write all loops: functions, what is fetched, and results (array name, expression)."""
        program = self._program
        done: set[Any] = set()
        waiting_f = list(program.functions)
        waiting_g = list(program.fetched)
        needed = {symbol for symbol, _ in waiting_f} | {symbol for symbol, _, _ in waiting_g}
        while waiting_f or waiting_g:
            ready_f = [one for one in waiting_f if not one[1].free_symbols & needed - done]
            ready_g = [one for one in waiting_g if not one[1].free_symbols & needed - done]
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
        """Fetch what each cell hears, in blocks of cells that lie evenly in both arrays."""
        if target in self.rings:
            # The ring lies straight in memory: only what it begins with has to be copied.
            turn = self.rings[target]
            self.lines += [f'to, of = {target}[:{turn} * lanes], {array}[m - {turn} * lanes:m]',
                           f'for i in range({turn} * lanes):', '    to[i] = of[i]']
            return
        place = self.sources.setdefault(source, len(self.sources))
        self.lines.append(f'fetch(lanes, SOURCE_{place}, {array}, {target})')

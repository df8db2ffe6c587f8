"""Kernel code for a network's right-hand side, written from its equations.

It takes ``lanes`` copies of the network at once, component ``cell * lanes + lane`` of each
variable. What depends on delayed states alone is worked out apart (drive), since two stages of a
step share it.
"""

from collections.abc import Sequence
from typing import Any

import sympy

from cpg_ros.integration.loops import Program, Writer
from cpg_ros.networks.derivation import expressions
from cpg_ros.networks.equations import Equations


def _share_exponentials(parts: list[Any]) -> tuple[list[Any], dict[Any, Any]]:
    """Write hyperbolic functions of multiples of one argument by one exponential.

    Returns:
        The expressions, and what exponentials the new symbols in them (e0 ...) stand for.

    """
    calls = sorted({call for part in parts for call in part.atoms(sympy.tanh, sympy.cosh)},
                   key=str)
    known: dict[Any, Any] = {}
    powers: dict[Any, Any] = {}
    for call in calls:
        if call.func is not sympy.cosh:
            continue
        base, power = call.args[0], sympy.Symbol(f'e{len(powers)}', real=True)
        powers[power] = sympy.exp(base)
        known[call] = (power + 1 / power) / 2
        for other in calls:
            ratio = sympy.nsimplify(sympy.simplify(other.args[0] / base), rational=True)
            if other.func is sympy.tanh and ratio.is_Integer and ratio > 0:
                known[other] = 1 - 2 / (power**(2 * ratio) + 1)
    return [part.xreplace(known) for part in parts], powers


def _split(rates: list[Any], delayed: set[Any], now: set[Any]) -> tuple[list[Any], list[Any]]:
    """Part rates into what is heard a delay ago and the rest.

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


def _split(rates: list[Any], delayed: set[Any], now: set[Any]) -> tuple[list[Any], list[Any]]:
    """Part rates into what is heard a delay ago and the rest.

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


class _Writer:
    """Writes the loops of a program as the body of a function."""

    def __init__(self, program: _Program) -> None:
        self._program = program
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
        for block in _blocks(source):
            indent, here, there, length = self._places(block)
            self.lines += [f'{indent}a, b = {here}, {there}',
                           f'{indent}to, of = {target}[a:a + {length} * lanes], '
                           f'{array}[b:b + {length} * lanes]',
                           f'{indent}for i in range({length} * lanes):',
                           f'{indent}    to[i] = of[i]']

    def _places(self, block: tuple[int, int, int, int, int, int]) -> tuple[str, str, str, int]:
        """Open a loop over a block; return the indentation, its two places, and its length."""
        begin, there, length, count, stride, step = block
        if count == 1:
            return '', f'{begin} * lanes', f'{there} * lanes', length
        self.lines.append(f'for k in range({count}):')
        return ('    ', f'({begin} + {stride} * k) * lanes', f'({there} + {step} * k) * lanes',
                length)


def _blocks(source: Source) -> list[tuple[int, int, int, int, int, int]]:
    """Part the cells into blocks (begin, source, length, how many, their stride, its step)."""
    runs = []
    for _, group in groupby(enumerate(source), lambda at: at[1] - at[0]):
        run = list(group)
        runs.append((run[0][0], run[0][1], len(run)))
    found = []
    while runs:
        begin, there, length = runs[0]
        best = [runs[0]]
        for other in runs[1:]:
            stride, step = other[0] - begin, other[1] - there
            chain = [(begin + k * stride, there + k * step, length) for k in range(len(runs))]
            kept = list(takewhile(lambda one: one in runs, chain))
            best = max(best, kept, key=len)
        stride = best[1][0] - begin if len(best) > 1 else 0
        step = best[1][1] - there if len(best) > 1 else 0
        found.append((begin, there, length, len(best), stride, step))
        runs = [run for run in runs if run not in best]
    return found


def _function(name: str, head: str, doc: str, slices: Sequence[str], lines: Sequence[str]) -> str:
    body = ''.join(f'        {line}\n' for line in (*slices, *lines))
    return f'    @decorate\n    def {name}({head}):\n        """{doc}"""\n{body}'


def kernel_source(equations: Equations) -> str:
    """Write a module with ``compiled(decorate)``, which returns (drive or None, field).

    ``drive(n, past, p, lanes, work, out)`` fills ``DRIVEN`` arrays of the length n / variables;
    ``field(n, z, driven, p, lanes, work, out)`` the rates. ``p`` has a row for each parameter of
    the equations, ``work`` room for ``WORK`` such arrays and ``EXTRA`` cells.
    """
    rates, symbols = expressions(equations)
    count = len(equations.arguments)
    arguments = list(zip(symbols[:count], equations.arguments, strict=True))
    delayed = {symbol for symbol, one in arguments if one.delayed}
    now = {symbol for symbol, one in arguments if not one.delayed}
    driven, rest = _split(rates, delayed, now)
    variables = len(rates)
    texts, most, extra = [], 0, 0
    for name, results, state in (('drive', driven, 'past'), ('field', rest, 'z')):
        if not results:
            continue
        results, powers = _share_exponentials(results)
        program = Program([(symbol, one) for symbol, one in arguments
                            if one.delayed == (name == 'drive')], powers)
        lowered = [program.lowered(part) for part in results]
        used = {str(symbol) for part in (*lowered, *(call for _, call in program.functions),
                                         *(what for _, what, _ in program.fetched))
                for symbol in part.free_symbols}
        slices = [f'm = n // {variables}']
        slices += [f'z{v} = {state}[{v} * m:{v + 1} * m]' for v in range(variables)
                   if f'z{v}' in used]
        slices += [f'd{k} = driven[{k} * m:{k + 1} * m]' for k in range(len(driven))
                   if f'd{k}' in used]
        slices += [f'p_{row} = p[{r}]' for r, row in enumerate(equations.rows)
                   if f'p_{row}' in used]
        slices += [f'o{k} = out[{k} * m:{k + 1} * m]' for k in range(len(results))]
        writer = Writer(program)
        most, extra = max(most, writer.arrays), max(extra, writer.extra)
        writer.loops([(f'o{k}', part) for k, part in enumerate(lowered)])
        head = ('n, past, p, lanes, work, out' if name == 'drive'
                else 'n, z, driven, p, lanes, work, out')
        doc = ('What depends on delayed states alone.' if name == 'drive'
               else 'Right-hand side at z.')
        texts.append(_function(name, head, doc, slices, writer.lines))
    code = '\n'.join(texts)
    known = [word for word in ('exp', 'fetch', 'tanh') if f'{word}(' in code]
    others = [word for word in ('cos', 'log', 'sin', 'sqrt') if f'{word}(' in code]
    head = ''.join(line + '\n' for line in (
        f'from math import {", ".join(others)}' if others else '',
        f'from cpg_ros.integration.jit import {", ".join(known)}' if known else '') if line)
    return (f'{head}\nDRIVEN, WORK, EXTRA = {len(driven)}, {most}, {extra}\n\n\n'
            f'def compiled(decorate):\n{code}\n    return {"drive" if driven else None}, field\n')

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

"""Kernel code for a network's right-hand side, written from its equations.

It takes ``lanes`` copies of the network at once, component ``cell * lanes + lane`` of each
variable. What depends on delayed states alone is worked out apart (drive), since two stages of a
step share it.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

from cpg_ros.integration.loops import LoopProgram, Writer
from cpg_ros.networks.cell import Source
from cpg_ros.networks.derivation import expressions
from cpg_ros.networks.equations import Equations
import sympy


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


def _function(name: str, head: str, doc: str, slices: Sequence[str], lines: Sequence[str]) -> str:
    body = ''.join(f'        {line}\n' for line in (*slices, *lines))
    return f'    @decorate\n    def {name}({head}):\n        """{doc}"""\n{body}'


class LoweredPart(NamedTuple):
    """A part of the right-hand side, as loops over the cells work it out.

    Attributes:
        name: ``drive``, what depends on delayed states alone, or ``field``, the rates.
        program: the functions that are worked out first.
        results: expressions of what the part fills in, one for each array.

    """

    name: str
    program: LoopProgram
    results: list[Any]


def lowered_parts(equations: Equations) -> list[LoweredPart]:
    """Return ``drive``, where anything is heard a delay ago, and ``field``.

    The results of ``drive`` stand in those of ``field`` as d0, d1 ...
    """
    rates, symbols = expressions(equations)
    count = len(equations.arguments)
    arguments = list(zip(symbols[:count], equations.arguments, strict=True))
    delayed = {symbol for symbol, one in arguments if one.delayed}
    now = {symbol for symbol, one in arguments if not one.delayed}
    driven, rest = _split(rates, delayed, now)
    parts = []
    for name, results in (('drive', driven), ('field', rest)):
        if not results:
            continue
        results, powers = _share_exponentials(results)
        program = LoopProgram([(symbol, one) for symbol, one in arguments
                               if one.delayed == (name == 'drive')], powers)
        parts.append(LoweredPart(name, program, [program.lowered(part) for part in results]))
    return parts


def kernel_source(equations: Equations) -> str:
    """Write a module with ``compiled(decorate)``, which returns (drive or None, field).

    ``drive(n, past, p, lanes, work, out)`` fills ``DRIVEN`` arrays of the length n / variables;
    ``field(n, z, driven, p, lanes, work, out)`` the rates. ``p`` has a row for each parameter of
    the equations, ``work`` room for ``WORK`` such arrays and ``EXTRA`` cells.
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
    known = [word for word in ('exp', 'fetch', 'tanh') if f'{word}(' in code]
    others = [word for word in ('cos', 'log', 'sin', 'sqrt') if f'{word}(' in code]
    head = ''.join(line + '\n' for line in (
        f'from math import {", ".join(others)}' if others else '',
        f'from cpg_ros.integration.jit import {", ".join(known)}' if known else '') if line)
    head += 'from numpy import array\n' if sources else ''
    places = ''.join(f'SOURCE_{k} = array({source!r})\n' for source, k in sources.items())
    return (f'{head}\n{places}DRIVEN, WORK, EXTRA = {driven}, {most}, {extra}\n\n\n'
            f'def compiled(decorate):\n{code}\n    return {"drive" if driven else None}, field\n')

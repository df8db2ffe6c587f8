"""Loops over all cells and lanes that work out expressions, as kernel code.

A function of what another cell has is worked out where it is and then fetched, so that it is
worked out once. Loops are short: one for every elementary function and one for every result, which
compilers turn into vector instructions.
"""

from collections.abc import Sequence
from typing import Any

import sympy
from sympy.printing.pycode import PythonCodePrinter

from cpg_ros.networks.derivation import print_float
from cpg_ros.networks.equations import Argument, Source


class _Printer(PythonCodePrinter):
    """Python, numbers to the last digit."""

    _print_Float = print_float


_PRINTER = _Printer({'fully_qualified_modules': False})


class Program:
    """Loops that work out expressions of arguments that are all heard at one time."""

    def __init__(self, arguments: Sequence[tuple[Any, Argument]], powers: dict[Any, Any]
                 ) -> None:
        self._arguments, self._powers = dict(arguments), powers
        self.functions: list[tuple[Any, Any]] = []
        self.fetched: list[tuple[Any, Any, Source]] = []

    def own(self, variable: int) -> Any:
        """The symbol of a cell's own variable."""
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




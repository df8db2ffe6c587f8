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

"""C text: expressions of sympy, and numbers, as float or double."""

from typing import Any

import numpy as np
from sympy.printing.c import C99CodePrinter

WIDTH = 98


class CPrinter(C99CodePrinter):  # type: ignore[misc]
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


def number(value: float, real: str) -> str:
    """Return a number to the last digit of its type, float32 or float64."""
    text = f'{value:.9g}' if real == 'float32' else repr(float(value))
    if not any(mark in text for mark in '.e'):
        text += '.0'
    return f'{text}f' if real == 'float32' else text


def braces(values: Any, real: str, indent: int = 4) -> str:
    """Return an initializer of an array of any shape; integers as such."""
    values = np.asarray(values)
    if values.ndim > 1:
        inner = ',\n'.join(' ' * indent + braces(row, real, indent + 4) for row in values)
        return '{\n' + inner + '}'
    words = ([str(value) for value in values] if values.dtype.kind in 'iu'
             else [number(value, real) for value in values])
    lines = [' ' * indent]
    for word in words:
        if len(lines[-1]) + len(word) > WIDTH - 2:
            lines.append(' ' * indent)
        lines[-1] += f'{"" if lines[-1].isspace() else " "}{word},'
    text = '\n'.join(lines).rstrip(',')
    return f'{{{text.strip()}}}' if len(lines) == 1 else '{\n' + text + '}'

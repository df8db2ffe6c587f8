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

"""What equations are written with: terms that remember how they were made.

A network's equations are a Python function of its cells' variables and its parameters. Called
with terms instead of numbers it leaves a text, from which everything else is derived; nothing
heavy is loaded for that.
"""

from typing import Union

#: What may stand in an equation.
Number = Union['Term', float]


class Term:
    """A part of an equation, as text that sympy reads."""

    def __init__(self, text: str) -> None:
        """Wrap a text."""
        self.text = text

    def __add__(self, other: Number) -> 'Term':
        return Term(f'({self.text} + {_text(other)})')

    def __radd__(self, other: Number) -> 'Term':
        return Term(f'({_text(other)} + {self.text})')

    def __sub__(self, other: Number) -> 'Term':
        return Term(f'({self.text} - {_text(other)})')

    def __rsub__(self, other: Number) -> 'Term':
        return Term(f'({_text(other)} - {self.text})')

    def __mul__(self, other: Number) -> 'Term':
        return Term(f'({self.text} * {_text(other)})')

    def __rmul__(self, other: Number) -> 'Term':
        return Term(f'({_text(other)} * {self.text})')

    def __truediv__(self, other: Number) -> 'Term':
        return Term(f'({self.text} / {_text(other)})')

    def __rtruediv__(self, other: Number) -> 'Term':
        return Term(f'({_text(other)} / {self.text})')

    def __pow__(self, power: int) -> 'Term':
        return Term(f'({self.text} ** {power!r})')

    def __neg__(self) -> 'Term':
        return Term(f'(-{self.text})')


def _text(value: Number) -> str:
    return value.text if isinstance(value, Term) else repr(value)


def tanh(x: Number) -> Term:
    """Hyperbolic tangent."""
    return Term(f'tanh({_text(x)})')


def cosh(x: Number) -> Term:
    """Hyperbolic cosine."""
    return Term(f'cosh({_text(x)})')


def exp(x: Number) -> Term:
    """Exponential."""
    return Term(f'exp({_text(x)})')


def sin(x: Number) -> Term:
    """Sine."""
    return Term(f'sin({_text(x)})')


def cos(x: Number) -> Term:
    """Cosine."""
    return Term(f'cos({_text(x)})')


def sqrt(x: Number) -> Term:
    """Square root."""
    return Term(f'sqrt({_text(x)})')


def positive(x: Number) -> Term:
    """max(0, x): differentiable but at 0, where a network that has it states a kink."""
    return Term(f'(({_text(x)} + Abs({_text(x)})) / 2)')

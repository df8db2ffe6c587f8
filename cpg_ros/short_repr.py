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

"""Results that print in one line, whatever arrays they hold.

A dataclass of results is declared ``@dataclass(frozen=True, eq=False, repr=False)`` and derives
from ShortRepr: arrays are shown by their shape, collections by their length, and two results are
equal only if they are the same object, since comparing arrays has no single answer.
"""

from collections.abc import Mapping, Sequence
from dataclasses import fields
from typing import Any

#: Longest text of one value, and of all, in characters.
LONGEST, LONGEST_OF_ALL = 60, 300
#: Collections of fewer entries are shown whole, if their text is short.
MOST = 9


class ShortRepr:
    """A dataclass whose repr is one short line, such as ``Multipliers(period=1.2783, ...)``."""

    def __repr__(self) -> str:
        text = self._summary()
        if len(text) > LONGEST_OF_ALL:
            text = text[:LONGEST_OF_ALL - 3] + '...'
        return f'{type(self).__name__}({text})'

    def _summary(self) -> str:
        """Return what stands between the parentheses: by default, each field and its value."""
        return ', '.join(f'{field.name}={shown(getattr(self, field.name))}'
                         for field in fields(self))  # type: ignore[arg-type]


def shown(value: Any) -> str:
    """Return a value in a few characters: an array as its shape, an object as its type."""
    if isinstance(value, (float, complex)):
        return f'{value:.6g}'
    if hasattr(value, 'shape') and hasattr(value, 'dtype'):
        if value.ndim == 0:
            return shown(value.item())
        return f'array{tuple(value.shape)}'
    if value is None or isinstance(value, (bool, int, str)):
        text = repr(value)
        return text if len(text) <= LONGEST else text[:LONGEST - 4] + "...'"
    if isinstance(value, Mapping):
        text = ', '.join(f'{key}: {shown(one)}' for key, one in list(value.items())[:MOST])
        few = len(value) < MOST and len(text) < LONGEST
        return f'{{{text}}}' if few else f'{{{len(value)} keys}}'
    if isinstance(value, Sequence):
        text = ', '.join(shown(one) for one in value[:MOST])
        few = len(value) < MOST and len(text) < LONGEST
        return f'({text})' if few else f'({len(value)} items)'
    return type(value).__name__

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

"""Errors of the package, whose messages tell users what is wrong with their input.

Any other exception, such as a ValueError of numpy for arrays of a wrong shape, is a bug in the
calling program: the package does not catch it and does not report it as the user's mistake.
"""

from collections.abc import Mapping, Sequence
from dataclasses import fields
from importlib.util import find_spec
import sys
from types import TracebackType
from typing import Any, ClassVar

# Results that print in one line, whatever arrays they hold.

#: Longest texts of one value, and of all values, characters.
MAX_VALUE_LENGTH, MAX_LENGTH = 60, 300
#: MAX_ENTRIES: from which on a collection is abbreviated.
MAX_ENTRIES = 9


class ShortRepr:
    """A dataclass whose repr is one short line, such as ``Multipliers(period=1.2783, ...)``."""

    def __repr__(self) -> str:
        text = self._summary()
        if len(text) > MAX_LENGTH:
            text = text[:MAX_LENGTH - 3] + '...'
        return f'{type(self).__name__}({text})'

    def _summary(self) -> str:
        """Return the text between the parentheses: by default, each field and its value."""
        return ', '.join(f'{field.name}={short(getattr(self, field.name))}'
                         for field in fields(self))  # type: ignore[arg-type]


def short(value: Any) -> str:
    """Return a value in a few characters: an array as its shape, an object as its type."""
    if isinstance(value, (float, complex)):
        return f'{value:.6g}'
    if hasattr(value, 'shape') and hasattr(value, 'dtype'):
        if value.ndim == 0:
            return short(value.item())
        return f'array{tuple(value.shape)}'
    if value is None or isinstance(value, (bool, int, str)):
        text = repr(value)
        return text if len(text) <= MAX_VALUE_LENGTH else text[:MAX_VALUE_LENGTH - 4] + "...'"
    if isinstance(value, Mapping):
        items = list(value.items())[:MAX_ENTRIES]
        text = ', '.join(f'{key}: {short(item)}' for key, item in items)
        few = len(value) < MAX_ENTRIES and len(text) < MAX_VALUE_LENGTH
        return f'{{{text}}}' if few else f'{{{len(value)} keys}}'
    if isinstance(value, Sequence):
        text = ', '.join(short(item) for item in value[:MAX_ENTRIES])
        few = len(value) < MAX_ENTRIES and len(text) < MAX_VALUE_LENGTH
        return f'({text})' if few else f'({len(value)} items)'
    return type(value).__name__


class CpgError(ValueError):
    """A request cannot be met; the message says what and why, in one line.

    Subclasses are defined beside the functions that raise them.

    Attributes:
        exit_code: of a tool that it ends: 2 for unusable input; 1 for a negative result, such as a
            recording without a gait.

    """

    exit_code: ClassVar[int] = 2


class InputError(CpgError):
    """A name, a number or data cannot be used; the message says which, and what can be."""


class MissingLibraryError(CpgError, ImportError):
    """A library from PyPI is not installed; the message says how to install it."""


def needed(library: str, part: str = '') -> None:
    """Check that a library is installed, with a part that old versions lack.

    Raises:
        MissingLibraryError: it is not installed; uncaught, it prints one line.

    """
    try:
        if find_spec(part or library) is not None:
            return
    except ModuleNotFoundError:
        pass  # of a part: the library itself is not installed
    usual = sys.excepthook

    def report(kind: type[BaseException], error: BaseException, trace: TracebackType | None
             ) -> None:
        if isinstance(error, MissingLibraryError):
            print(error, file=sys.stderr)
        else:
            usual(kind, error, trace)

    sys.excepthook = report
    raise MissingLibraryError(
        f'cpg_ros needs {library}, which is not installed: python3 -m venv '
        f'--system-site-packages .venv && .venv/bin/pip install {library}, and run colcon from '
        'that environment')

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

"""C text: the parts in ``c``, and numbers as float or double."""

from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

FOLDER = Path(__file__).parent / 'c'
WIDTH = 98


def part(name: str, values: Mapping[str, str] = MappingProxyType({})) -> str:
    """Return a file of ``c`` with names between @ replaced by these values."""
    text = (FOLDER / name).read_text()
    for key, value in values.items():
        text = text.replace(f'@{key}@', value)
    return text


def number(value: float, real: str) -> str:
    """Return a number with all digits of its type, float32 or float64."""
    text = f'{value:.9g}' if real == 'float32' else repr(float(value))
    if not any(mark in text for mark in '.e'):
        text += '.0'
    return f'{text}f' if real == 'float32' else text


def braces(values: Any, real: str, indent: int = 4) -> str:
    """Return an initializer of an array of any shape and of integers or floats."""
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

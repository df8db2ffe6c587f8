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

"""Plain text: JSON without numbers that it lacks, and tables in aligned columns."""

import json
import math
import re
from typing import Any

#: What Python makes of the bytes of a file's name that are not UTF-8.
_BYTE = re.compile('[\udc80-\udcff]')


def printable(text: str) -> str:
    r"""Return a text as UTF-8 has it: bytes of names of files that are not stand as \xff."""
    text = _BYTE.sub(lambda byte: f'\\x{ord(byte[0]) - 0xdc00:02x}', text)
    return text.encode(errors='backslashreplace').decode()


def finite(tree: Any) -> Any:
    """Return the tree with None for numbers that JSON does not know."""
    if isinstance(tree, dict):
        return {key: finite(value) for key, value in tree.items()}
    if isinstance(tree, list | tuple):
        return [finite(value) for value in tree]
    return None if isinstance(tree, float) and not math.isfinite(tree) else tree


def as_json(tree: Any) -> str:
    """Return a tree of plain types as JSON."""
    return json.dumps(finite(tree), indent=2)


def table(rows: list[tuple[str, ...]], right: str = '') -> list[str]:
    """Align rows in columns, the first row being the head.

    Args:
        rows: texts.
        right: for each column '<' or '>', '<' for those not given.

    """
    widths = [max(len(row[k]) for row in rows) for k in range(len(rows[0]))]
    sides = right.ljust(len(widths), '<')
    return ['  '.join(f'{text:{side}{width}}' for text, side, width
                      in zip(row, sides, widths, strict=True)).rstrip() for row in rows]

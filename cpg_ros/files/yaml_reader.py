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

"""Reading YAML files that people write: what is wrong is said with its file, key and reason."""

from collections.abc import Mapping, Set
import math
from pathlib import Path
from typing import Any

from cpg_ros.errors import CpgError
import yaml


class _UniqueKeys(yaml.SafeLoader):
    """YAML without silently overwritten keys."""

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict:
        seen = set()
        for key_node, _ in node.value:
            key = self.construct_object(key_node, deep=True)
            if not isinstance(key, str):
                raise yaml.constructor.ConstructorError(
                    None, None, f'the key {shown(key)} is not a name', key_node.start_mark)
            if key in seen:
                raise yaml.constructor.ConstructorError(
                    None, None, f"the key '{key}' appears twice", key_node.start_mark)
            seen.add(key)
        return super().construct_mapping(node, deep)


def shown(value: Any) -> str:
    """Return a value as it is shown in a message."""
    return 'nothing' if value is None else repr(value)[:60]


class Reader:
    """Takes checked values out of one file's tree, and says where a bad one stands."""

    def __init__(self, path: Path, what: str, error: type[CpgError], largest: float) -> None:
        """Read for a file that is called ``what``; failures are of the type ``error``.

        No number may be larger than ``largest``.
        """
        self.path, self.what, self.error, self.largest = path, what, error, largest

    def fail(self, where: str, why: str) -> CpgError:
        """Return the error that says where and why."""
        return self.error(' '.join(f'{self.what} {self.path}: {where}: {why}'.split()))

    def tree(self) -> Any:
        """Parse the file."""
        try:
            return yaml.load(self.path.read_text(encoding='utf-8'), Loader=_UniqueKeys)
        except OSError as error:
            raise self.error(f'{self.what} {self.path}: {error.strerror}') from error
        except (yaml.YAMLError, UnicodeDecodeError) as error:
            mark = getattr(error, 'problem_mark', None)
            line = f'line {mark.line + 1}' if mark else 'file'
            raise self.fail(line, str(getattr(error, 'problem', error))) from error

    def keys(self, tree: Any, where: str, required: Set[str], optional: Set[str] = frozenset()
             ) -> Mapping[str, Any]:
        """Return a mapping that has all required keys and none unknown."""
        if not isinstance(tree, Mapping):
            raise self.fail(where, f'must be a mapping, not {shown(tree)}')
        for key in tree:
            if key not in required | optional:
                allowed = ', '.join(sorted(required | optional))
                raise self.fail(f'{where}.{key}', f'unknown key (allowed: {allowed})')
        for key in sorted(required - set(tree)):
            raise self.fail(f'{where}.{key}', 'is missing')
        return tree

    def number(self, value: Any, where: str) -> float:
        """Return a finite number."""
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise self.fail(where, f'must be a number, not {shown(value)}')
        if value != value or value in (math.inf, -math.inf):
            raise self.fail(where, f'must be finite, not {value}')
        if abs(value) > self.largest:
            raise self.fail(where, f'must be at most {self.largest:g}, not {shown(value)}')
        return float(value)

    def text(self, value: Any, where: str) -> str:
        """Return a name."""
        if not isinstance(value, str) or not value.strip():
            raise self.fail(where, f'must be a name, not {shown(value)}')
        return value

    def items(self, value: Any, where: str) -> list:
        """Return a list with at least one entry."""
        if not isinstance(value, list) or not value:
            raise self.fail(where, f'must be a list with at least one entry, not {shown(value)}')
        return value

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

"""Reading YAML files that people write: an error names the file, the key and the reason."""

from collections.abc import Callable, Collection, Mapping, Sequence, Set
from dataclasses import fields, is_dataclass, MISSING
from functools import partial
from itertools import pairwise
import math
from pathlib import Path
from types import UnionType
from typing import Annotated, Any, get_args, get_origin, TypeVar

from cpg_ros.common.errors import CpgError
from cpg_ros.common.files import one_line, read_bytes, write_atomically
import yaml

#: MAX_NODES: including those that aliases stand for.
MAX_DEPTH, MAX_NODES = 50, 1_000_000
#: MAX_SIZE: of a file, bytes: a robot of a hundred joints has 30 thousand.
MAX_SIZE = 4_000_000

Value = TypeVar('Value')
#: Returns why a number cannot be used, or ''.
Check = Callable[[float], str]


class _UniqueKeys(yaml.SafeLoader):
    """YAML without silently overwritten keys, of a bounded depth and size."""

    def __init__(self, stream: str) -> None:
        super().__init__(stream)
        self._depth = self._nodes = 0
        self._sizes: dict[int, int] = {}

    def compose_node(self, parent: yaml.Node | None, index: int) -> yaml.Node | None:
        """Count nodes; an alias counts as its target, which may contain aliases."""
        event, before = self.peek_event(), self._nodes  # type: ignore[no-untyped-call]
        mark, alias = event.start_mark, isinstance(event, yaml.AliasEvent)
        self._depth += 1
        if self._depth > MAX_DEPTH:
            raise yaml.composer.ComposerError(None, None, f'nested more than {MAX_DEPTH} deep',
                                              mark)
        node = super().compose_node(parent, index)
        self._depth -= 1
        if alias and id(node) not in self._sizes:
            raise yaml.composer.ComposerError(None, None, 'an alias of what it is part of', mark)
        self._nodes += self._sizes[id(node)] if alias else 1
        if self._nodes > MAX_NODES:
            raise yaml.composer.ComposerError(None, None, f'more than {MAX_NODES} nodes, with '
                                              'those that aliases stand for', mark)
        self._sizes.setdefault(id(node), self._nodes - before)
        return node

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict:
        seen = set()
        for key_node, _ in node.value:
            key = self.construct_object(key_node, deep=True)
            if not isinstance(key, str):
                raise yaml.constructor.ConstructorError(
                    None, None, f'the key {quoted(key)} is not a name', key_node.start_mark)
            if key in seen:
                raise yaml.constructor.ConstructorError(
                    None, None, f"the key '{key}' appears twice", key_node.start_mark)
            seen.add(key)
        return super().construct_mapping(node, deep)


def parsed(text: str) -> Any:
    """Parse YAML.

    Raises:
        yaml.YAMLError: it is none, is nested too deep or is too much, has a key twice or one that
            is no name.

    """
    try:
        return yaml.load(text, Loader=_UniqueKeys)
    # PyYAML raises these for values that do not fit their tags: '!!int x', '2020-13-01'.
    except (ArithmeticError, AttributeError, LookupError, TypeError, ValueError) as error:
        raise yaml.YAMLError(f'a value cannot be used: {type(error).__name__}: {error}') from error


def quoted(value: Any) -> str:
    """Return a value as it is shown in a message."""
    try:
        return 'nothing' if value is None else repr(value)[:60]
    except ValueError:  # whole numbers of thousands of digits
        return 'a huge number'


def positive(value: float) -> str:
    """Check that a number is above 0."""
    return '' if value > 0.0 else f'{value:g} must be positive'


def within(low: float, high: float, text: str = '') -> Check:
    """Return a check that a number is from ``low`` to ``high``, which messages call ``text``."""
    return lambda value: '' if low <= value <= high else (
        f'{value:g} is not from {text or f"{low:g} to {high:g}"}')


def required(kind: Any) -> set[str]:
    """Return the names of a dataclass' fields without a default."""
    return {field.name for field in fields(kind)
            if field.default is MISSING and field.default_factory is MISSING}


def plain(value: Any) -> Any:
    """Return a value for YAML: dataclasses become mappings, without empty optional fields."""
    if is_dataclass(value):
        value = {name: entry for name, entry in vars(value).items()
                 if name in required(value) or entry not in (None, '', (), {})}
    if isinstance(value, dict):
        return {name: plain(entry) for name, entry in value.items()}
    return [plain(entry) for entry in value] if isinstance(value, tuple) else value


def write_yaml(path: str | Path, tree: Any, comment: str = '') -> None:
    """Write a YAML file that opens with a comment."""
    lines = ''.join(f'# {line}\n' for line in comment.splitlines())
    write_atomically(path, lines + yaml.safe_dump(tree, sort_keys=False, default_flow_style=None,
                                                  width=96))


class YamlReader:
    """Takes checked values out of one file's tree; errors name the place of a bad value."""

    def __init__(self, path: Path, what: str, error: type[CpgError], largest: float) -> None:
        """Read for a file that is called ``what``; failures are of the type ``error``.

        No number may be larger than ``largest``.
        """
        self.path, self.what, self.error, self.largest = path, what, error, largest

    def fail(self, where: str, why: str) -> CpgError:
        """Return the error that says where and why."""
        return self.error(one_line(f'{self.what} {self.path}: {where}: {why}'))

    def tree(self) -> Any:
        """Parse the file."""
        data = read_bytes(self.path, self.error, self.what, MAX_SIZE)
        try:
            return parsed(data.decode())
        except (yaml.YAMLError, UnicodeDecodeError) as error:
            mark = getattr(error, 'problem_mark', None)
            line = f'line {mark.line + 1}' if mark else 'file'
            raise self.fail(line, str(getattr(error, 'problem', error))) from error

    def keys(self, tree: Any, where: str, required: Set[str], optional: Set[str] = frozenset()
             ) -> Mapping[str, Any]:
        """Return a mapping that has all required keys and none unknown."""
        if not isinstance(tree, Mapping):
            raise self.fail(where, f'must be a mapping, not {quoted(tree)}')
        for key in tree:
            if key not in required | optional:
                allowed = ', '.join(sorted(required | optional))
                raise self.fail(f'{where}.{key}', f'unknown key (allowed: {allowed})')
        for key in sorted(required - set(tree)):
            raise self.fail(f'{where}.{key}', 'is missing')
        return tree

    def mapping(self, tree: Any, where: str, read: Callable[[Any, str], Value],
                required: Set[str] = frozenset()) -> dict[str, Value]:
        """Return a mapping with keys of the user's own, its values as ``read`` returns them."""
        tree = self.keys(tree, where, required, set(tree) if isinstance(tree, Mapping) else set())
        return {name: read(value, f'{where}.{name}') for name, value in tree.items()}

    def record(self, kind: type[Value], tree: Any, where: str, **own: Callable[[Any, str], Any]
               ) -> Value:
        """Return a mapping as a dataclass; fields with a default are optional.

        Args:
            kind: the dataclass; ``Annotated`` types of its fields give further arguments of the
                methods that read them, such as a length and a check.
            tree: the mapping.
            where: its place in the file.
            own: field -> reader, for fields whose type does not tell how to read them.

        """
        record: Any = kind
        needed = required(record)
        tree = self.keys(tree, where, needed, {field.name for field in fields(record)} - needed)
        result: Value = record(**self.values(record, tree, where, **own))
        return result

    def values(self, kind: Any, tree: Mapping[str, Any], where: str,
               **own: Callable[[Any, str], Any]) -> dict[str, Any]:
        """Return those fields of a dataclass that a mapping has; arguments as of record."""
        readers: dict[str, Any] = own
        return {field.name: readers.get(field.name, partial(self._value, field.type))(
            tree[field.name], f'{where}.{field.name}')
            for field in fields(kind) if field.name in tree}

    def _value(self, kind: Any, value: Any, where: str) -> Any:
        kind, *more = get_args(kind) if get_origin(kind) is Annotated else (kind,)
        kind = get_args(kind)[0] if isinstance(kind, UnionType) else kind
        if get_origin(kind) is dict:
            return self.mapping(value, where, partial(self._value, get_args(kind)[1]))
        read: Any = {float: self.number, str: self.text, bool: self.switch,
                     tuple[float, ...]: self.numbers, tuple[str, ...]: self.texts}[kind]
        return read(value, where, *more)

    def switch(self, value: Any, where: str) -> bool:
        """Return true or false."""
        if not isinstance(value, bool):
            raise self.fail(where, f'must be true or false, not {quoted(value)}')
        return value

    def number(self, value: Any, where: str, check: Check = lambda value: '') -> float:
        """Return a finite number that passes a check."""
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise self.fail(where, f'must be a number, not {quoted(value)}')
        if value != value or value in (math.inf, -math.inf):
            raise self.fail(where, f'must be finite, not {value}')
        if abs(value) > self.largest:
            raise self.fail(where, f'must be at most {self.largest:g}, not {quoted(value)}')
        if reason := check(value):
            raise self.fail(where, reason)
        return float(value)

    def numbers(self, value: Any, where: str, count: int | None = None,
                check: Check = lambda value: '') -> tuple[float, ...]:
        """Return a list of finite numbers, at least one, or as many as ``count``."""
        listed = self.items(value, where)
        if count not in (None, len(listed)):
            raise self.fail(where, f'takes {count} numbers, not {len(listed)}')
        return tuple(self.number(entry, f'{where}[{k}]', check) for k, entry in enumerate(listed))

    def check_rising(self, values: Sequence[float], where: str) -> None:
        """Check that each number is above the one before it."""
        for k, (before, after) in enumerate(pairwise(values)):
            if not before < after:
                raise self.fail(f'{where}[{k + 1}]', f'{after:g} is not above {before:g}')

    def text(self, value: Any, where: str) -> str:
        """Return a name."""
        if not isinstance(value, str) or not value.strip():
            raise self.fail(where, f'must be a name, not {quoted(value)}')
        return value

    def texts(self, value: Any, where: str) -> tuple[str, ...]:
        """Return a list of names, at least one."""
        return tuple(self.text(name, f'{where}[{k}]')
                     for k, name in enumerate(self.items(value, where)))

    def name_of(self, value: Any, where: str, names: Collection[str]) -> str:
        """Return one of the names."""
        name = self.text(value, where)
        if name not in names:
            raise self.fail(where, f"'{name}' is not one of {', '.join(names)}")
        return name

    def items(self, value: Any, where: str) -> list:
        """Return a list with at least one entry."""
        if not isinstance(value, list) or not value:
            raise self.fail(where, f'must be a list with at least one entry, not {quoted(value)}')
        return value

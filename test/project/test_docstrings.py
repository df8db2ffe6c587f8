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

"""Docstrings hold what signatures say: parameters, attributes and errors by their names."""

import builtins
from collections.abc import Iterator
import dataclasses
import inspect
import re
from typing import Any

import cpg_ros
from modules import modules
import pytest

MODULES = modules()
ERRORS = {name for module in MODULES for name, one in vars(module).items()
          if inspect.isclass(one) and issubclass(one, BaseException)}


def sections(text: str) -> dict[str, list[str]]:
    """Section -> what its entries name; 'low, high: bounds' names two."""
    found: dict[str, list[str]] = {}
    entries: list[str] | None = None
    for line in inspect.cleandoc(text).splitlines():
        if head := re.fullmatch(r'(\w+):', line):
            entries = found.setdefault(head[1], [])
        elif entries is not None and (entry := re.match(r'    (\*{0,2}[\w.]+(?:, \w+)*):', line)):
            entries.extend(entry[1].lstrip('*').split(', '))
    return found


def own(module: Any) -> Iterator[tuple[str, Any, type | None]]:
    """Public functions, classes and methods that a module defines, and whose they are."""
    for name, thing in vars(module).items():
        thing = getattr(thing, 'py_func', thing)
        if name.startswith('_') or getattr(thing, '__module__', '') != module.__name__:
            continue
        if inspect.isclass(thing):
            yield f'{module.__name__}.{name}', thing, thing
            for inner, method in vars(thing).items():
                method = inspect.unwrap(getattr(method, '__func__', None)
                                        or getattr(method, 'fget', None)
                                        or getattr(method, 'func', None) or method)
                if inspect.isfunction(method) and (inner == '__init__' or inner[0] != '_'):
                    yield f'{module.__name__}.{name}.{inner}', method, thing
        elif callable(thing):
            yield f'{module.__name__}.{name}', inspect.unwrap(thing), None


EVERYTHING = [one for module in MODULES for one in own(module)]
WITH = {section: [(where, one, of) for where, one, of in EVERYTHING
                  if section in sections(one.__doc__ or '')]
        for section in ('Args', 'Attributes', 'Raises')}


def cases(section: str) -> Any:
    return pytest.mark.parametrize('where, one, of', WITH[section],
                                   ids=[where for where, _, _ in WITH[section]])


def test_every_section_is_found():
    assert all(len(found) > 50 for found in WITH.values())


@cases('Args')
def test_arguments_are_the_parameters(where, one, of):
    parameters = [name for name in inspect.signature(one).parameters
                  if name not in ('self', 'cls')]
    assert sections(one.__doc__)['Args'] == parameters


@cases('Attributes')
def test_attributes_are_there(where, one, of):
    named = sections(one.__doc__)['Attributes']
    assert len(set(named)) == len(named)
    if dataclasses.is_dataclass(one):
        # Fields that are inherited are described where they are declared first.
        fields = {field.name for field in dataclasses.fields(one)}
        inherited = {name for base in one.__mro__[1:] for name in inspect.get_annotations(base)}
        declared = {name for name in fields - inherited if name[0] != '_'}
        assert declared <= set(named) <= fields
        return
    known = {*dir(one), *(name for base in one.__mro__ for name in inspect.get_annotations(base))}
    for name in named:
        assert name in known or re.search(rf'self\.{name}\b[^=\n]*[:=]',
                                          inspect.getsource(one)), name


@cases('Raises')
def test_errors_are_known(where, one, of):
    for name in sections(one.__doc__)['Raises']:
        assert (name in ERRORS or hasattr(builtins, name)
                or re.search(rf'\b{re.escape(name)}\b', inspect.getsource(one))), name


def test_the_door_is_documented():
    assert all(inspect.getdoc(getattr(cpg_ros, name)) for name in cpg_ros.__all__)

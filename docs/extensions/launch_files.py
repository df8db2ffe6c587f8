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

"""Arguments of the launch files, read from the files: launch itself is not needed."""

import ast
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
LAUNCH = ROOT / 'launch'
#: Declares the arguments that every launch file has.
EVERY = ROOT / 'cpg_ros' / 'ros' / 'launch_arguments.py'


def arguments(name: str) -> dict[str, tuple[str, str]]:
    """Return argument -> (default, what it is) of a launch file."""
    source, shared = (LAUNCH / f'{name}.launch.py').read_text(), EVERY.read_text()
    found = _constants(source, ast.Assign)
    if name == 'rviz':
        return {**arguments('generator'), **found}
    if 'declared(' not in source:
        return found
    if 'GENERATOR' in source:
        found = {**_constants(shared, ast.AnnAssign), **found}
    return {**found, **_constants(shared, ast.FunctionDef)}


def _constants(source: str, kind: type[ast.stmt]) -> dict[str, tuple[str, str]]:
    """Return what dictionaries in top-level statements of a kind say of arguments."""
    found: dict[str, tuple[str, str]] = {}
    for statement in ast.parse(source).body:
        if not isinstance(statement, kind):
            continue
        for group in ast.walk(statement):
            if not isinstance(group, ast.Dict):
                continue
            for key, value in zip(group.keys, group.values, strict=True):
                if isinstance(key, ast.Constant) and isinstance(value, ast.Tuple):
                    default, text = value.elts[0], value.elts[-1]
                    found[key.value] = (default.value if isinstance(default, ast.Constant) else
                                        'the shipped one', ast.literal_eval(text))
    return found

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

LAUNCH = Path(__file__).resolve().parents[2] / 'launch'


def arguments(name: str) -> dict[str, tuple[str, str]]:
    """Return argument -> (default, what it is) of a launch file."""
    tree = ast.parse((LAUNCH / f'{name}.launch.py').read_text())
    found: dict[str, tuple[str, str]] = {}
    for statement in tree.body:
        if not (isinstance(statement, ast.Assign) and isinstance(statement.value, ast.Dict)):
            continue
        for key, value in zip(statement.value.keys, statement.value.values, strict=True):
            if isinstance(key, ast.Constant) and isinstance(value, ast.Tuple):
                default, text = value.elts[0], value.elts[-1]
                found[key.value] = (default.value if isinstance(default, ast.Constant) else
                                    'the shipped one', ast.literal_eval(text))
    if name == 'rviz':
        found = {**arguments('generator'), **found}
    return {**found, 'namespace': ('', 'namespace of all its topics'),
            'panel': ('false', 'show it in a browser, at http://127.0.0.1:8080/')}

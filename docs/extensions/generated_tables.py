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

"""Directives whose tables come from the code: parameters, topics, options, robot files, presets.

What only a person can say (what a topic is for) stands in the page, one line `name: text` each.
The page and the code must name the same things, or the build fails.
"""

from collections.abc import Iterable, Sequence
import importlib
from pathlib import Path
import re
from typing import Any

import cpg_ros
from cpg_ros.dynamics.solve_orbit import solve_preset
from cpg_ros.motion.robot_file import load_robot
from cpg_ros.networks.registry import find_network, SHIPPED
from cpg_ros.ros import generator_parameters, inversion_node, robot_sim
from cpg_ros.ros.bridges.servos import bridge as servo_bridge
from cpg_ros.ros.bridges.servos import bus as servo_bus
from cpg_ros.ros.bridges.unitree import bridge as unitree_parameters
from cpg_ros.ros.cli.executables import EXECUTABLES
from cpg_ros.ros.feedback import switch
from cpg_ros.ros.node.parameters import Spec
from cpg_ros.ros.panel import panel_node
from docutils import nodes
import graph_names
import launch_files
import robot_keys
from sphinx.application import Sphinx
from sphinx.errors import ExtensionError
from sphinx.util.docutils import SphinxDirective
import yaml


def cell(text: object) -> str:
    """Return text for a cell of a table in Markdown."""
    return str(text).replace('|', r'\|').replace('*', r'\*')


def table(head: Sequence[str], rows: Iterable[Sequence[object]]) -> str:
    """Return a table in Markdown."""
    lines = [head, ['---'] * len(head), *([cell(one) for one in row] for row in rows)]
    return '\n'.join('| ' + ' | '.join(line) + ' |' for line in lines)


def code(text: object) -> str:
    """Return text as code, nothing for nothing."""
    return f'`{text}`' if str(text) else ''


def parameter_rows(specs: dict[str, Spec], defaults: bool = True) -> list[list[str]]:
    """Return a row for each parameter."""
    rows = []
    for name, spec in specs.items():
        span = '' if spec.low is None else f'{spec.low:g} to {spec.high:g}'
        kind = type(spec.default).__name__
        kind = {'str': 'string', 'float': 'double', 'int': 'integer'}.get(kind, kind)
        if isinstance(spec.default, list):
            first = type(spec.default[0]) if spec.default else str
            kind = {float: 'double[]', int: 'integer[]', str: 'string[]'}[first]
        default = str(spec.default).lower() if isinstance(spec.default, bool) else spec.default
        text = spec.text + (f' ({spec.constraints})' if spec.constraints else '')
        rows.append([code(name), kind + (', read-only' if spec.read_only else ''),
                     code(default) if defaults else "the preset's", span, text])
    return rows


HEAD = ('parameter', 'type', 'default', 'range', 'what')


#: Nodes whose parameters are read-only.
FIXED = {'robot_sim': robot_sim.SPECS, 'unitree_bridge': unitree_parameters.SPECS,
         'servo_bridge': servo_bridge.SPECS, 'servo_bus': servo_bus.SPECS}


def parameters(what: str) -> str:
    """Return the parameters of a node, or those of a network in the generator."""
    if what in FIXED:
        return table(HEAD, parameter_rows(FIXED[what]))
    if what == 'panel':
        return table(HEAD, parameter_rows(panel_node.SPECS))
    if what == 'feedback':
        return table(HEAD, parameter_rows(switch.TOPICS))
    if what == 'feedback_gains':
        return table(HEAD, parameter_rows(switch.GAINS))
    if what == 'biped_gains':
        return table(HEAD, parameter_rows(switch.BIPED_GAINS))
    if what == 'inversion':
        return table(HEAD, parameter_rows(inversion_node.SPECS))
    usual = SHIPPED['delayed' if what == 'generator' else what]
    planner = generator_parameters.Planner(usual, usual.presets(), load_robot(usual.usual_robot))
    own = planner.specs(usual.usual_gait)
    frequency = {'frequency': own.pop('frequency')}
    if what != 'generator':
        return table(HEAD, parameter_rows(own, defaults=False))
    rows = parameter_rows({'network': generator_parameters.NETWORK,
                           **generator_parameters.specs(usual), **frequency})
    exclusive = parameter_rows({'exclusive': generator_parameters.exclusive('none')})[0]
    exclusive[2] = '`true` with `command`, else `false`'
    feedback = parameter_rows({switch.ENABLED: switch.SWITCH})
    return table(HEAD, [*rows, exclusive, *feedback])


def presets(name: str) -> str:
    """Return the gaits and presets of a network with their parameters and exact periods."""
    rows = []
    for preset_name, preset in find_network(name).presets().items():
        symmetry = preset.network.symmetry(preset.gait)
        phases = ', '.join(str(phase) for phase in symmetry.phases)
        values = ', '.join(f'{key} {value:g}' for key, value in preset.network.as_dict().items()
                           if value)
        rows.append([code(preset_name), code(preset.gait), phases,
                     f'{solve_preset(preset).period:.4f}', values])
    return table(('preset', 'gait', 'phases of the cells', 'period, model time', 'parameters'),
                 rows)


def options(name: str) -> str:
    """Return what a tool does, its options and exit codes, from its own argument parser."""
    place = 'fitting.inversion.inversion' if name == 'inversion' else EXECUTABLES[name]
    module = importlib.import_module(f'cpg_ros.{place}')
    parser = (getattr(module, '_parser', None) or module.parser)()
    rows = []
    for action in parser._actions:
        if action.dest == 'help':
            continue
        names = ', '.join(action.option_strings) or str(action.metavar or action.dest)
        value = action.metavar or '|'.join(map(str, action.choices or ()))
        if action.nargs == 0 or not action.option_strings:
            value = ''
        more = ' ...' if action.nargs in ('+', '*') else ''
        text = parser._get_formatter()._expand_help(action) if action.help else ''
        rows.append([code(f'{names} {value}{more}'.strip()),
                     'yes' if action.required else '', text])
    told = [parser.description or '', '', table(('option', 'required', 'what'), rows)]
    if parser.epilog:
        told += ['', '```text', parser.epilog, '```']
    return '\n'.join(told)


def described(name: str, found: dict[str, Any], lines: Sequence[str], where: str
              ) -> dict[str, str]:
    """Return what the page says of each thing found in the code.

    Raises:
        ExtensionError: the page says nothing of one, or speaks of one that is not there.

    """
    texts = dict(line.split(': ', 1) for line in lines if line.strip())
    if missing := set(found) - set(texts):
        raise ExtensionError(f'{where}: {name} without a word: {", ".join(sorted(missing))}')
    if extra := set(texts) - set(found):
        raise ExtensionError(f'{where}: {name} that the code has not: {", ".join(sorted(extra))}')
    return texts


class Generated(SphinxDirective):
    """A table made by a function of the argument."""

    required_arguments = 1
    has_content = True
    make: Any = None

    def run(self) -> list[nodes.Node]:
        """Return the table's nodes."""
        text = type(self).make(self)
        return self.parse_text_to_nodes(text, allow_section_headings=True)


class Topics(Generated):
    """Topics and services of a node, as it makes them; what they are for is in the page."""

    def make(self) -> str:
        """Return the table."""
        found = graph_names.of(self.arguments[0])
        texts = described('topics', found, self.content, self.env.docname)
        return table(('name', 'direction, type', 'what'),
                     [[code(name), f'{direction} {code(kind)}', texts[name]]
                      for name, (direction, kind) in ((name, found[name]) for name in texts)])


class RobotFile(Generated):
    """Keys that the reader of robot files asks for; what they mean is in the page."""

    def make(self) -> str:
        """Return the table."""
        found = robot_keys.asked_for()
        texts = described('keys', found, self.content, self.env.docname)
        return table(('key', 'required', 'what'),
                     [[code(key), 'yes' if found[key] else '', text]
                      for key, text in texts.items()])


def made_by(function: Any) -> type[Generated]:
    """Return a directive that calls a function with its argument."""
    return type(function.__name__.title(), (Generated,),
                {'make': lambda self: function(self.arguments[0]), 'has_content': False})


def arguments(name: str) -> str:
    """Return the arguments of a launch file."""
    return table(('argument', 'default', 'what'),
                 [[code(key), code(default), text]
                  for key, (default, text) in launch_files.arguments(name).items()])


def door(_: str) -> str:
    """Return what `import cpg_ros` gives."""
    kinds = {name: 'autoclass' if isinstance(thing := getattr(cpg_ros, name), type) else
             'autofunction' if callable(thing) else 'autodata' for name in cpg_ros.__all__}
    # Attributes and methods stand in the module's page.
    return rst(f'.. {kind}:: cpg_ros.{name}\n' + '   :no-value:\n' * (kind == 'autodata')
               for name, kind in kinds.items())


#: Where the pages of modules are written, one each: together they would be endless.
MODULES = Path(__file__).parents[1] / 'reference' / 'python' / 'generated'


def modules(name: str) -> list[str]:
    """Return the modules of a room, those of its subpackages after its own."""
    place = importlib.import_module(f'cpg_ros.{name}')
    # What only ROS brings cannot be imported here.
    listed = [one for one in place.__all__ if one not in ('launch_arguments', 'rosbag2_library')]
    folders = [one for one in listed if (Path(place.__path__[0]) / one).is_dir()]
    return [*(f'{name}.{one}' for one in listed if one not in folders),
            *(one for folder in folders for one in modules(f'{name}.{folder}'))]


def room(name: str) -> str:
    """Return a table of the modules of a room, with their pages."""
    place, found = importlib.import_module(f'cpg_ros.{name}'), modules(name)
    rows = [[f'[`{one}`](generated/{one}.md)',
             (importlib.import_module(f'cpg_ros.{one}').__doc__ or '').split('\n\n')[0]
             .replace('\n', ' ')] for one in found]
    return '\n\n'.join([place.__doc__ or '', table(('module', 'what'), rows),
                        '\n'.join(['```{toctree}', ':hidden:', '',
                                   *(f'generated/{one}' for one in found), '```'])])


def write_modules(app: Sphinx) -> None:
    """Write a page for each module; one that is as it was keeps its time."""
    MODULES.mkdir(exist_ok=True)
    rooms = [path.stem for path in MODULES.parent.glob('*.md')]
    pages = {f'{one}.md': f'# `{one}`\n\n' + rst([
        f'.. automodule:: cpg_ros.{one}\n   :members:\n   :exclude-members: '
        f'{", ".join(reexported(*one.rpartition(".")[::2]))}\n'])
        for name in rooms for one in modules(name)}
    for path in MODULES.iterdir():
        if path.name not in pages:
            path.unlink()
    for name, text in pages.items():
        if not (MODULES / name).is_file() or (MODULES / name).read_text() != text:
            (MODULES / name).write_text(text)


def private(app: Sphinx, what: str, name: str, thing: Any, skip: bool, options: Any
            ) -> bool | None:
    """Leave out constants of a module, except those that `import cpg_ros` gives."""
    return True if what == 'module' and name.isupper() and name not in cpg_ros.__all__ else None


def reexported(room: str, module: str) -> list[str]:
    """Return what a module passes on from elsewhere, where it is described."""
    place = importlib.import_module(f'cpg_ros.{room}.{module}')
    return [name for name in getattr(place, '__all__', ())
            if getattr(getattr(place, name, None), '__module__', place.__name__)
            != place.__name__ and not hasattr(place, '__path__')]


def errata(_: str) -> str:
    """Return the errata of the papers, each with how it was verified."""
    def plain(text: str) -> str:
        return re.sub(r'([_*<^])', r'\\\1', text)

    path = Path(cpg_ros.__file__).parent / 'analysis' / 'papers' / 'errata.yaml'
    return '\n'.join(
        f"{number}. **{erratum['paper']}.** {plain(erratum['text'])} *Verified:* "
        f"{erratum['verified']}"
        for number, erratum in yaml.safe_load(path.read_text('utf-8')).items())


def rst(blocks: Iterable[str]) -> str:
    """Return reStructuredText within Markdown."""
    return '```{eval-rst}\n' + '\n'.join(blocks) + '```\n'


#: Docstring of a constant, as it is.
_PLAIN: dict[str, list[str]] = {}


def escaped(app: Sphinx, what: str, name: str, thing: Any, options: Any, lines: list[str]
            ) -> None:
    """Make of a docstring, which is plain text, what reStructuredText reads as such."""
    for k, line in enumerate(lines):
        parts = line.split('``')
        parts[::2] = [re.sub(r'([|`]|(?<![\w*])\*+(?=\w+[^*]*$))', r'\\\1', part)
                      for part in parts[::2]]
        lines[k] = '``'.join(parts)
    if what in ('data', 'attribute'):
        _PLAIN[name] = list(lines)


def restored(app: Sphinx, what: str, name: str, thing: Any, options: Any, lines: list[str]
             ) -> None:
    """Undo what napoleon does to a constant, whose text before a colon it takes for a type."""
    if name in _PLAIN:
        lines[:] = _PLAIN.pop(name)


def setup(app: Sphinx) -> dict[str, bool]:
    """Name the directives."""
    for name, directive in {'parameters': made_by(parameters), 'presets': made_by(presets),
                            'options': made_by(options), 'launch': made_by(arguments),
                            'door': made_by(door), 'room': made_by(room),
                            'errata': made_by(errata), 'topics': Topics,
                            'robotfile': RobotFile}.items():
        app.add_directive(name, directive)
    app.connect('builder-inited', write_modules)
    app.connect('autodoc-skip-member', private)
    app.connect('autodoc-process-docstring', escaped, priority=400)
    app.connect('autodoc-process-docstring', restored, priority=600)
    return {'parallel_read_safe': False}

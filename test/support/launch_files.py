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

"""Launch files described without starting anything: nodes, parameters, arguments."""

import ast
from pathlib import Path
import sys
from types import ModuleType, SimpleNamespace

from ament_index_python.packages import get_package_share_directory
from cpg_ros.motion.robot_file import load_robot
from cpg_ros.networks.registry import NETWORKS, PRESETS
from cpg_ros.ros.feedback.switch import ENABLED, SWITCH
from cpg_ros.ros.generator_parameters import Planner, specs

SOURCE = Path(__file__).resolve().parents[2]
SHARE = Path(get_package_share_directory('cpg_ros'))
FILES = ('generator', 'inversion', 'go2', 'go2_robot', 'servo_robot', 'rviz', 'two_go2')


def executables():
    """Names of the entry points in setup.py, which cannot be imported without building."""
    tree = ast.parse((SOURCE / 'setup.py').read_text())
    (points,) = (ast.literal_eval(word.value) for call in ast.walk(tree)
                 if isinstance(call, ast.Call) for word in call.keywords
                 if word.arg == 'entry_points')
    return {line.partition(' = ')[0] for line in points['console_scripts']}


def of_generator(network):
    """Parameters of the generator: name -> spec."""
    kind = NETWORKS[network]
    planner = Planner(kind, PRESETS[network], load_robot(kind.usual_robot))
    return specs(kind) | planner.specs(kind.usual_gait) | {ENABLED: SWITCH}


class Stub:
    """Stands for an action or substitution; keeps what it was given."""

    def __init__(self, *arguments, **options):
        self.arguments, self.options = arguments, options

    @property
    def name(self):
        return self.arguments[0]

    def perform(self, context):
        return context[self.name] if 'default' not in self.options else context.get(
            self.name, self.options['default'])


class Context(dict):
    """Stands for a LaunchContext: the configurations by name."""

    @property
    def launch_configurations(self):
        return self


def describing(monkeypatch):
    """Yield what runs a launch file with stand-ins for launch, which is not on PyPI."""
    kinds = {name: type(name, (Stub,), {}) for name in (
        'LaunchDescription', 'LaunchDescriptionEntity', 'LaunchContext', 'DeclareLaunchArgument',
        'LogInfo', 'GroupAction', 'OpaqueFunction',
        'IncludeLaunchDescription', 'Shutdown', 'SetEnvironmentVariable', 'ExecuteProcess',
        'RegisterEventHandler', 'OnProcessExit', 'LaunchConfiguration', 'Node',
        'ParameterValue', 'PythonLaunchDescriptionSource')}
    for name in ('launch', 'launch.actions', 'launch.substitutions', 'launch.launch_context',
                 'launch.launch_description_entity',
                 'launch.launch_description_sources', 'launch.event_handlers', 'launch_ros',
                 'launch_ros.actions',
                 'launch_ros.parameter_descriptions'):
        module = ModuleType(name)
        vars(module).update(kinds)
        monkeypatch.setitem(sys.modules, name, module)
    monkeypatch.delitem(sys.modules, 'cpg_ros.ros.launch_arguments', raising=False)

    def run(name, installed=True, **given):
        space = {'__file__': str(SOURCE / 'launch' / f'{name}.launch.py')}
        exec(compile(Path(space['__file__']).read_text(), space['__file__'], 'exec'), space)
        shared = sys.modules.get('cpg_ros.ros.launch_arguments')
        if shared is not None and installed:
            shared.get_package_prefix = lambda package: f'/opt/{package}'
        described = SimpleNamespace(arguments={}, includes=[])
        # Those of the files that rviz and two_go2 include.
        context = Context({'namespace': '', 'use_sim_time': 'false'} if name == 'rviz' else {})
        context.update(given)
        made = []
        for entity in space['generate_launch_description']().arguments[0]:
            if isinstance(entity, kinds['DeclareLaunchArgument']):
                described.arguments[entity.name] = entity.options['default_value']
                context.setdefault(entity.name, entity.options['default_value'])
                assert entity.options['description']
            elif isinstance(entity, kinds['OpaqueFunction']):
                made += entity.options['function'](context) or ()
            elif isinstance(entity, kinds['GroupAction']):
                described.includes += entity.arguments[0]
            else:
                described.includes.append(entity.arguments[0].arguments[0])
        assert not set(given) - set(described.arguments) - {'feedback'} or name == 'rviz'

        def of_kind(kind):
            return [one for one in made if isinstance(one, kinds[kind])]

        described.nodes, described.handlers = of_kind('Node'), of_kind('RegisterEventHandler')
        described.environment = {one.arguments[0]: one.arguments[1]
                                 for one in of_kind('SetEnvironmentVariable')}
        described.lines = [one.options['msg'] for one in of_kind('LogInfo')]
        described.processes = [one.options['cmd'] for one in of_kind('ExecuteProcess')]
        described.context = context
        return described
    yield run
    sys.modules.pop('cpg_ros.ros.launch_arguments', None)


def parameters(described, node):
    """Return what a node is given, as it will be after launch has typed it."""
    types = {str: str, float: float, int: int, bool: lambda text: {'true': True,
                                                                   'false': False}[text]}
    (given,) = node.options['parameters']
    values = {}
    for name, value in given.items():
        if isinstance(value, Stub):
            (text,), kind = value.arguments, value.options['value_type']
            text = text.perform(described.context) if isinstance(text, Stub) else text
            value = types.get(kind, str)(text)
        values[name] = value
    return values


def node_of(described, executable):
    (node,) = (node for node in described.nodes if node.options['executable'] == executable)
    return node

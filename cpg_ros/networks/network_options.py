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

"""The options --network, --presets, --preset and --set: a network and its parameters."""

from argparse import ArgumentParser, Namespace
from dataclasses import replace
from pathlib import Path
from typing import Any

from cpg_ros.common.command_line import assignment, refuse_repeated
from cpg_ros.common.errors import InputError
from cpg_ros.common.yaml_reader import YamlReader
from cpg_ros.networks.network import Network, Preset
from cpg_ros.networks.presets import PresetError, read_presets
from cpg_ros.networks.registry import find_network, NetworkError, SHIPPED
import numpy as np

#: MAX_VALUE: of a parameter, absolute.
MAX_VALUE = 1e6
DEFAULT_NETWORK = 'delayed'


def add_network_options(parser: ArgumentParser) -> None:
    """Add the options to a parser."""
    parser.add_argument('--network', metavar='NAME',
                        help=f'{", ".join(SHIPPED)}, or the path of a Python file that defines '
                        f'one; quadruped+current is the quadruped with its constant current as a '
                        f'parameter (default: {DEFAULT_NETWORK}, or that of --presets)')
    parser.add_argument('--presets', type=Path, metavar='FILE', help='take --preset from this '
                        'file: preset.yaml of optimize, or the parameter file of inversion')
    parser.add_argument('--preset', metavar='NAME', help='shipped preset that supplies the '
                        'parameters not given by --set, or that of --presets (default: the only '
                        'one of --presets, or ' + ', '.join(
                            f'{name} {kind.usual_gait}' for name, kind in SHIPPED.items()) + ')')
    parser.add_argument('--set', nargs='+', action='extend', default=[], type=assignment,
                        metavar='PARAMETER=VALUE', help='parameter values, such as c=6.5 tau=0.4; '
                        'w_a sets all four weights of the biped; a constant of the equations '
                        'becomes a parameter')


def _presets(args: Namespace) -> tuple[type[Network], dict[str, Preset], str]:
    """Return the network, its presets, and the name of the default preset or ''."""
    name, file = args.network or DEFAULT_NETWORK, args.presets
    reader = None if file is None else YamlReader(file, 'preset file', PresetError, MAX_VALUE)
    tree = reader.tree() if reader else {}
    parameters = tree.get('/**') if isinstance(tree, dict) else None
    if reader and args.network is None:
        inner = parameters.get('ros__parameters') if isinstance(parameters, dict) else tree
        if not isinstance(inner, dict) or 'network' not in inner:
            raise reader.fail('network', 'is not given')
        name = reader.text(inner['network'], 'network')
    try:
        kind = find_network(name)
    except NetworkError as error:
        raise InputError(f'{"--network" if args.network else file or "--network"}: {error}'
                         ) from error
    if not reader:
        return kind, kind.presets(), kind.usual_gait
    presets = read_presets(file, kind) if parameters is None else _fitted(reader, parameters, kind)
    return kind, presets, next(iter(presets)) if len(presets) == 1 else ''


def _fitted(reader: YamlReader, tree: Any, kind: type[Network]) -> dict[str, Preset]:
    """Return the preset in a parameter file of the generator, as inversion writes it."""
    inner = reader.keys(tree, '/**', {'ros__parameters'})['ros__parameters']
    where = '/**.ros__parameters'
    inner = reader.keys(inner, where, {'gait', kind.name},
                        {'network', 'robot', 'frequency', 'amplitude'})
    gait = reader.name_of(inner['gait'], f'{where}.gait', kind.gaits())
    where = f'{where}.{kind.name}'
    values = reader.keys(inner[kind.name], where, set(kind.parameters()))
    return {gait: Preset(gait, kind(*(reader.number(values[name], f'{where}.{name}')
                                      for name in kind.parameters())))}


def network_from(args: Namespace) -> Network:
    """Return the network that the options select; errors as of preset_from."""
    return preset_from(args)[1]


def preset_from(args: Namespace) -> tuple[Preset, Network]:
    """Return the preset that the options select, and its network with the values of --set.

    Raises:
        InputError: an unknown name or an invalid value.
        PresetError: the file of --presets cannot be used.

    """
    kind, presets, default = _presets(args)
    name = args.preset or default
    if name not in presets:
        wrong = f"'{name}' is not one of" if name else f'{args.presets} has several, choose from'
        raise InputError(f'--preset: {wrong} {", ".join(presets)}')
    preset = presets[name]
    constants = [key for key, _ in args.set if key in kind.constants]
    if constants:
        kind = kind.varying(*constants)
        preset = replace(preset, network=kind(**preset.network.as_dict()))
    network = preset.network
    for key, _ in args.set:
        if key not in (names := (*kind.groups, *kind.parameters())):
            raise InputError(f"--set: '{key}' is not a parameter of the {kind.name} network: "
                             f'{", ".join(names)}')
    refuse_repeated('--set', [member for key, _ in args.set for member in kind.members(key)])
    for key, value in args.set:
        if not np.isfinite(value):
            raise InputError(f'--set: {key} is {value:g}, it must be finite')
        if abs(value) > MAX_VALUE:
            raise InputError(f'--set: {key} is {value:g}, it must be at most {MAX_VALUE:g}')
        network = network.replace(**{key: value})
    delay = kind.delay_parameter
    if delay and network.delay <= 0.0:
        raise InputError(f'--set: {delay} is {network.delay:g}, a delay must be positive')
    if network.delay > kind.longest_delay > 0.0:
        raise InputError(f'--set: {delay} is {network.delay:g}, delays go up to '
                         f'{kind.longest_delay:g}: use another unit of time')
    for key, purpose in kind.needed.items():
        if network.as_dict()[key] == 0.0:
            raise InputError(f'--set: {key} is 0: {purpose}')
    return preset, network

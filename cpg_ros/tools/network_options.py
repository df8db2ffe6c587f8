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

"""The options --network, --preset and --set, which choose a network and its parameters."""

from argparse import ArgumentParser, Namespace
from dataclasses import replace

from cpg_ros.errors import InputError
from cpg_ros.networks.network import Network
from cpg_ros.networks.registry import find_network, NetworkError, SHIPPED
from cpg_ros.tools.arguments import assignment, refuse_repeated
import numpy as np

#: No parameter is larger: beyond, the arithmetic breaks down before it tells anything.
LARGEST = 1e6


def add_network_options(parser: ArgumentParser) -> None:
    """Add the options to a tool's."""
    parser.add_argument('--network', default='delayed', metavar='NAME',
                        help=f'{", ".join(SHIPPED)}, or the path of a Python file that defines '
                        'one (default: %(default)s)')
    parser.add_argument('--preset', metavar='NAME', help='shipped preset that supplies the '
                        'parameters not given by --set (default: ' + ', '.join(
                            f'{name} {kind.usual_gait}' for name, kind in SHIPPED.items()) + ')')
    parser.add_argument('--set', nargs='+', action='extend', default=[], type=assignment,
                        metavar='PARAMETER=VALUE', help='parameter values, such as c=6.5 tau=0.4; '
                        'w_a sets all four weights of the biped')


def chosen_network(chosen: Namespace) -> Network:
    """Return the network that the options choose: a preset's parameters, some of them changed.

    Raises:
        InputError: an unknown name, or a value that makes no sense; the message says which.

    """
    try:
        kind = find_network(chosen.network)
    except NetworkError as error:
        raise InputError(f'--network: {error}') from error
    presets = kind.presets()
    preset = kind.usual_gait if chosen.preset is None else chosen.preset
    if preset not in presets:
        raise InputError(f"--preset: '{preset}' is not one of {', '.join(presets)}")
    network = presets[preset].network
    refuse_repeated('--set', [member for key, _ in chosen.set
                              for member in kind.groups.get(key, (key,))])
    for key, value in chosen.set:
        if key not in (*kind.parameters(), *kind.groups):
            known = ', '.join((*kind.groups, *kind.parameters()))
            raise InputError(f"--set: '{key}' is not a parameter of the {kind.name} network: "
                             f'{known}')
        if not np.isfinite(value):
            raise InputError(f'--set: {key} is {value:g}, it must be finite')
        if abs(value) > LARGEST:
            raise InputError(f'--set: {key} is {value:g}, it must be at most {LARGEST:g}')
        members = kind.groups.get(key, (key,))
        network = replace(network, **dict.fromkeys(members, value))  # type: ignore[type-var]
    delay = kind.delay_parameter
    if delay and network.delay <= 0.0:
        raise InputError(f'--set: {delay} is {network.delay:g}, a delay must be positive')
    if network.delay > kind.longest_delay > 0.0:
        raise InputError(f'--set: {delay} is {network.delay:g}, delays go up to '
                         f'{kind.longest_delay:g}: use another unit of time')
    for key, lost in kind.needed.items():
        if network.as_dict()[key] == 0.0:
            raise InputError(f'--set: {key} is 0: {lost}')
    return network

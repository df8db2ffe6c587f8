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

"""Preset files: named parameter sets, each with its gait and a state on its orbit."""

from dataclasses import dataclass
from functools import cache
import inspect
from pathlib import Path
from typing import Any, Generic

from cpg_ros.common.errors import CpgError, ShortRepr
from cpg_ros.common.files import resource_folder
from cpg_ros.common.yaml_reader import positive, within, write_yaml, YamlReader
from cpg_ros.networks.definition import AnyDefinition

#: MAX_VALUE: of a number in a preset.
MAX_VALUE = 1e3


@dataclass(frozen=True, repr=False)
class Preset(ShortRepr, Generic[AnyDefinition]):
    """A named parameter set and its gait.

    Attributes:
        gait: one of the network's gaits.
        network: parameters.
        start: a state on the gait's orbit, shape (components,), that distinguishes it from other
            orbits and from rest; None where the solver needs none.
        period: of that orbit, model time, to about a per cent.

    """

    gait: str
    network: AnyDefinition
    start: tuple[float, ...] | None = None
    period: float = 0.0

    def _summary(self) -> str:
        return f'{self.gait} of {self.network.name}: ' + ', '.join(
            f'{name} {value:.6g}' for name, value in self.network.as_dict().items())


class PresetError(CpgError):
    """A preset file cannot be used; the message names the file, the key and the reason."""


def read_presets(path: str | Path, network: type[AnyDefinition]
                 ) -> dict[str, Preset[AnyDefinition]]:
    """Read a preset file of a network: name -> preset.

    Raises:
        PresetError: the file cannot be read, is for another network, or has a bad value.

    """
    reader = YamlReader(Path(path), 'preset file', PresetError, MAX_VALUE)
    tree = reader.keys(reader.tree(), 'file', {'network', 'presets'})
    if tree['network'] != network.name:
        raise reader.fail('network', f"is '{tree['network']}', not '{network.name}'")
    if not isinstance(tree['presets'], dict) or not tree['presets']:
        raise reader.fail('presets', 'must be a mapping with at least one name')
    presets = {}
    for name, entry in tree['presets'].items():
        where = f'presets.{name}'
        entry = reader.keys(entry, where, {'gait', 'parameters'}, {'start', 'period'})
        gait = reader.name_of(entry['gait'], f'{where}.gait', network.gaits())
        names = network.parameters()
        values = reader.keys(entry['parameters'], f'{where}.parameters', set(names))
        parameters = network(*(reader.number(
            values[key], f'{where}.parameters.{key}',
            within(network.ranges[key].low, network.ranges[key].high)) for key in names))
        if ('start' in entry) != ('period' in entry):
            raise reader.fail(where, "'start' and 'period' go together")
        if 'start' not in entry:
            presets[name] = Preset(gait, parameters)
            continue
        if parameters.delay:
            raise reader.fail(f'{where}.start', f'is not for the network {network.name}, which '
                              'has a delay')
        start = reader.numbers(entry['start'], f'{where}.start')
        if len(start) != parameters.components:
            raise reader.fail(f'{where}.start', f'has {len(start)} numbers, not '
                              f'{parameters.components}: the first variable of each cell, then '
                              'the second')
        presets[name] = Preset(gait, parameters, start, reader.number(
            entry['period'], f'{where}.period', positive))
    return presets


@cache
def own_presets(network: type[AnyDefinition]) -> dict[str, Preset[AnyDefinition]]:
    """Read a network's own presets, from the file beside its module or the shipped one.

    Raises:
        PresetError: as of read_presets.

    """
    beside = Path(inspect.getfile(network)).with_suffix('.yaml')
    path = resource_folder('config') / 'presets' / f'{network.name}.yaml'
    return read_presets(beside if beside.is_file() else path, network)


def write_presets(path: str | Path, network: type[AnyDefinition],
                  presets: dict[str, Preset[AnyDefinition]], comment: str = '') -> None:
    """Write a preset file."""
    tree: dict[str, Any] = {'network': network.name, 'presets': {}}
    for name, preset in presets.items():
        tree['presets'][name] = {
            'gait': preset.gait, 'parameters': preset.network.as_dict(),
            **({'start': list(preset.start), 'period': preset.period} if preset.start else {})}
    write_yaml(path, tree, comment)

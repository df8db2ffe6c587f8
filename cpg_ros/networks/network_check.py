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

"""What a network states, checked: for those that do not come with the package."""

from collections.abc import Iterator
from itertools import chain
from typing import Any

from cpg_ros.networks.leg_numbers import GIRDLES
from cpg_ros.networks.network import Network
from cpg_ros.networks.parameter_line import ParameterLine

#: What every network has to state.
STATED = ('name', 'cells', 'states', 'readout', 'step', 'ranges', 'legs', 'usual_gait', 'free',
          'line')


def flaw(network: type[Network]) -> str:
    """Say what is wrong with what a network states, one line, or ''.

    Raises:
        ValueError: its presets cannot be read, or its line is none.

    """
    lacking = [name for name in STATED if not hasattr(network, name)]
    if lacking:
        return f'{network.__name__} does not state {", ".join(lacking)}'
    return next(chain(_names(network), _legs(network), _gaits(network)), '')


def _unknown(where: str, names: Any, known: Any) -> Iterator[str]:
    for name in names:
        if name not in known:
            yield f"{where}: '{name}' is not one of {', '.join(map(str, known))}"


def _names(network: type[Network]) -> Iterator[str]:
    parameters = network.parameters()
    either = (*network.groups, *parameters)
    if not (isinstance(network.name, str) and network.name.isidentifier()):
        yield f'name: {network.name!r} is not of letters, digits and _'
    for name in parameters:
        if name not in network.ranges:
            yield f"ranges: the parameter '{name}' has none"
        elif not network.ranges[name].low < network.ranges[name].high:
            yield f"ranges: that of '{name}' is empty"
    yield from _unknown('ranges', network.ranges, parameters)
    for group, members in network.groups.items():
        yield from _unknown(f'groups: {group}', members, parameters)
    yield from _unknown('free', network.free, either)
    yield from _unknown('needed', network.needed, parameters)
    yield from _unknown('couplings', network.couplings, parameters)
    yield from _unknown('offsets', network.offsets.values(), parameters)
    yield from _unknown('readout', [network.readout], ('waveform', 'phase'))
    if network.readout == 'phase' and network.variables < 2:
        yield 'readout: the phase is told by cells with two variables'
    for name, members in network.own_of_cells.items():
        yield from _unknown(f'own_of_cells: {name}', members, parameters)
        if len(members) != network.cells:
            yield f'own_of_cells: {name} names {len(members)} parameters for {network.cells} cells'
    if network.delay_parameter:
        yield from _unknown('delay_parameter', [network.delay_parameter], parameters)
        if not network.step <= network.longest_delay:
            yield 'longest_delay: it is below the step'
    elif network.span is None:
        yield 'span: it has to be given where there is no delay'
    if network.searched:
        yield from _unknown('searched', network.searched, either)
        given = {member for name in network.searched
                 for member in network.groups.get(name, (name,))}
        yield from (f"searched: the parameter '{name}' has no bounds" for name in parameters
                    if name not in given)
        if len(network.typical_cycle) != network.variables:
            yield 'typical_cycle: it needs a row for each variable'
    ParameterLine.parse(network.line, network)


def _legs(network: type[Network]) -> Iterator[str]:
    if not network.legs:
        yield 'legs: there is no assignment of cells'
        return
    first = next(iter(network.legs.values()))
    numbers = range(1, network.cells + 1)
    for assignment, legs in network.legs.items():
        where = f'legs: {assignment}'
        if set(legs) != set(first):
            yield f'{where}: it has other legs than the first assignment'
        for leg, cells in legs.items():
            if not cells:
                yield f'{where}: {leg} has no cell'
            yield from (f'{where}: {leg} has the cell {cell}, and there are {network.cells}'
                        for cell in cells if cell not in numbers)
    if network.offsets and set(network.offsets) != set(first):
        yield 'offsets: there must be one for each leg'
    for name, table, words in (('sides', network.sides, ('left', 'right')),
                               ('girdles', network.girdles, GIRDLES)):
        yield from _unknown(name, table, first)
        yield from _unknown(name, table.values(), words)
    yield from (f'muscles: {name} has the cell {cell}, and there are {network.cells}'
                for name, cell in network.muscles.items() if cell not in numbers)


def _gaits(network: type[Network]) -> Iterator[str]:
    gaits, presets = network.gaits(), network.presets()
    yield from _unknown('usual_gait', [network.usual_gait], gaits)
    if network.offsets:
        yield from _unknown('unnamed', [network.unnamed], gaits)
    for gait in gaits:
        if gait not in presets:
            yield f"presets: the gait '{gait}' has none of its own name"
    for name, preset in presets.items():
        where = f'presets: {name}'
        yield from _unknown(where, [preset.gait], gaits)
        if name in gaits and preset.gait != name:
            yield f"{where}: it is of the gait '{preset.gait}'"
        if type(preset.network) is not network:
            yield f'{where}: it is of another network, {type(preset.network).__name__}'
        else:
            phases = preset.network.symmetry(preset.gait).phases
            if len(phases) != network.cells:
                yield f'{where}: its symmetry is of {len(phases)} cells, not {network.cells}'

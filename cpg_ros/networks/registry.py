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

"""Networks by name: shipped ones, those of other packages, and those in users' files.

A package offers a network by an entry point of the group ``cpg_ros.networks``: ``my_network =
my_package.my_network:MyNetwork``. A file that defines one network class is named by its path; its
presets stand in it, or beside it in a file of the same stem with the suffix .yaml. A number after
the name of a network for any number of legs selects that number: ``delayed6``. Constants after a
plus are parameters, too: ``quadruped+current``.
"""

from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import suppress
from functools import cache, cached_property
from importlib.metadata import entry_points, EntryPoint
import importlib.util
from inspect import isabstract
from itertools import chain
from pathlib import Path
import sys
from typing import Any, TypeVar
from zlib import crc32

from cpg_ros.common import files
from cpg_ros.common.errors import CpgError, InputError
from cpg_ros.networks.leg_numbers import GIRDLES, split_name, with_legs
from cpg_ros.networks.library import shipped
from cpg_ros.networks.network import asymmetry, MAX_ASYMMETRY, Network, ParameterLine, Preset

#: Attributes that every network has.
REQUIRED_ATTRIBUTES = ('name', 'cells', 'states', 'readout', 'step', 'ranges', 'legs',
                       'usual_gait', 'free', 'line')


def definition_error(network: type[Network]) -> str:
    """Return the first error in a network's definition, one line, or ''.

    Raises:
        ValueError: its presets or its line cannot be read.

    """
    lacking = [name for name in REQUIRED_ATTRIBUTES if not hasattr(network, name)]
    if lacking:
        return f'{network.__name__} does not state {", ".join(lacking)}'
    return next(chain(_names(network), _legs(network), _gaits(network)), '')


def _unknown(where: str, names: Any, known_names: Any) -> Iterator[str]:
    for name in names:
        if name not in known_names:
            yield f"{where}: '{name}' is not one of {', '.join(map(str, known_names))}"


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
        yield "readout 'phase' needs cells with two variables"
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
            symmetry = preset.network.symmetry(preset.gait)
            count = symmetry.group.cells
            if count != network.cells:
                yield f'{where}: its symmetry is of {count} cells, not {network.cells}'
            elif not preset.network.broken(symmetry):
                change = asymmetry(preset.network, symmetry)
                if change > MAX_ASYMMETRY:
                    yield (f'symmetry: the equations do not have that of the {preset.gait}, '
                           f'which changes their rates by {change:.1g} of their size')


ENTRY_POINT_GROUP = 'cpg_ros.networks'
#: MAX_SIZE: of a network's file, bytes.
MAX_SIZE = 4_000_000
#: SHIPPED: name -> network that comes with the package.
SHIPPED: dict[str, type[Network]] = {network.name: network for network in shipped()}

Entry = TypeVar('Entry')


class NetworkError(CpgError):
    """There is no such network, or it cannot be used; the message is one line."""


class _Networks(Mapping[str, type[Network]]):
    """All networks by name; those of other packages are loaded on first use."""

    def __init__(self) -> None:
        #: Network of a file -> the file.
        self.files: dict[type[Network], Path] = {}

    @cached_property
    def _offered(self) -> dict[str, EntryPoint]:
        return {point.name: point for point in entry_points(group=ENTRY_POINT_GROUP)
                if point.name not in SHIPPED}

    def __repr__(self) -> str:
        return f'NETWORKS({", ".join(self)})'

    def __iter__(self) -> Iterator[str]:
        return iter((*SHIPPED, *self._offered, *(network.name for network in self.files)))

    def __len__(self) -> int:
        return len(tuple(iter(self)))

    def __getitem__(self, name: str) -> type[Network]:
        """Return a network.

        Raises:
            NetworkError: another package's entry point cannot be used, or a network does not take
                that number of legs.
            KeyError: there is no network of this name.

        """
        name, *constants = name.split('+')
        if constants:
            return _varying(self[name], constants)
        named = {**SHIPPED, **{network.name: network for network in self.files}}
        if name in named:
            return named[name]
        family = split_name(name)
        if name not in self._offered and family is not None and family[0] in self:
            return _numbered(*family)
        return _of_entry_point(self._offered[name])


class _Presets(Mapping[str, dict[str, Preset]]):
    """Name of a network -> name of a preset -> preset."""

    def __repr__(self) -> str:
        return f'PRESETS({", ".join(f"{name}: {len(self[name])}" for name in self)})'

    def __iter__(self) -> Iterator[str]:
        return iter(NETWORKS)

    def __len__(self) -> int:
        return len(NETWORKS)

    def __getitem__(self, name: str) -> dict[str, Preset]:
        return NETWORKS[name].presets()


NETWORKS, PRESETS = _Networks(), _Presets()


def is_path(name: str) -> bool:
    """Tell whether a network's name is a path."""
    return name.endswith('.py') or '/' in name


def find_network(name: str, folder: Path | None = None) -> type[Network]:
    """Return a network by name, or the network in a file, which its name then finds, too.

    Args:
        name: of a network, or path of a file.
        folder: base of relative paths, by default the working directory.

    Raises:
        NetworkError: there is no such network or file, or its definition cannot be used; the
            message names the file and the reason.

    """
    name, *constants = name.split('+')
    if constants:
        return _varying(find_network(name, folder), constants)
    if is_path(name):
        try:
            path = ((folder or Path()) / Path(name).expanduser()).resolve()
            exists = path.is_file()
        except (OSError, RuntimeError, ValueError) as error:
            raise NetworkError(' '.join(f'{name}: {error}'.split())) from error
        if not exists:
            raise NetworkError(f'{path}: there is no such file')
        return _of_file(path)
    if name not in NETWORKS:
        raise NetworkError(f"'{name}' is not one of {', '.join(NETWORKS)}")
    return NETWORKS[name]


def reference(name: str) -> str:
    """Return the name or file by which find_network finds a network in another process."""
    name, *constants = name.split('+')
    return '+'.join((str(NETWORKS.files.get(NETWORKS[name], name)), *constants))


def numbered(legs: int) -> tuple[type[Network], ...]:
    """Return the shipped networks for a number of legs."""
    networks = []
    for network in SHIPPED.values():
        with suppress(InputError):
            networks.append(with_legs(network, legs))
    return tuple(networks)


def with_legs_of(network: type[Network], legs: Collection[str]) -> type[Network]:
    """Return a network for a number of legs, or itself if it does not take that number."""
    try:
        return with_legs(network, len(legs))
    except InputError:
        return network


def _varying(network: type[Network], constants: list[str]) -> type[Network]:
    try:
        return network.varying(*constants)
    except InputError as error:
        raise NetworkError(str(error)) from error


def _numbered(family: str, legs: int) -> type[Network]:
    try:
        return _checked(f'{family}{legs}', with_legs(NETWORKS[family], legs))
    except InputError as error:
        raise NetworkError(f"'{family}{legs}': {error}") from error


def _usable(source: str, load: Callable[[], Entry]) -> Entry:
    """Run foreign code; turn an error into one line."""
    try:
        return load()
    except Exception as error:
        raise NetworkError(' '.join(f'{source}: {type(error).__name__}: {error}'.split())
                           ) from error


def _checked(source: str, network: type[Network]) -> type[Network]:
    reason = _usable(source, lambda: definition_error(network))
    if reason:
        raise NetworkError(f'{source}: {reason}')
    return network


@cache
def _of_entry_point(point: EntryPoint) -> type[Network]:
    source = f"entry point '{point.name} = {point.value}'"
    network = _usable(source, point.load)
    if not (isinstance(network, type) and issubclass(network, Network)):
        raise NetworkError(f'{source}: it is not a network class')
    if network.name != point.name:
        raise NetworkError(f"{source}: its network has the name '{network.name}'")
    return _checked(source, network)


@cache
def _of_file(path: Path) -> type[Network]:
    # A dataclass looks its module up by name, and so does what unpickles it.
    name = f'cpg_ros_network_{path.stem}_{crc32(bytes(path)):x}'
    spec = importlib.util.spec_from_file_location(name, path)
    if spec is None or spec.loader is None:
        raise NetworkError(f'{path}: it is not a Python file')
    with files.opened(path, NetworkError, largest=MAX_SIZE):
        pass
    module = sys.modules[name] = importlib.util.module_from_spec(spec)
    loader = spec.loader
    try:
        _usable(str(path), lambda: loader.exec_module(module))
        classes = [value for value in vars(module).values()
                   if isinstance(value, type) and issubclass(value, Network)
                   and value.__module__ == name and not isabstract(value)]
        if len(classes) != 1:
            names = ', '.join(network.__name__ for network in classes)
            raise NetworkError(f'{path}: it must define one class of networks, not '
                               + (f'{len(classes)}: {names}' if classes else 'none'))
        network = _checked(str(path), classes[0])
        if network.name in NETWORKS:
            raise NetworkError(f"{path}: the name '{network.name}' is that of another network")
    except NetworkError:
        del sys.modules[name]
        raise
    NETWORKS.files[network] = path
    return network

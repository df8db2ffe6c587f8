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

"""The networks by name: shipped ones, those of other packages, and those in files of users.

A package offers a network by an entry point of the group ``cpg_ros.networks`` with the network's
name: ``my_network = my_package.my_network:MyNetwork``. A file that defines one class of networks
is named by its path; its presets stand in it or beside it, in a file of the same name but .yaml.
A number after the name of one that takes any number of legs is that number: ``delayed6``.
"""

from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import suppress
from functools import cache, cached_property
from importlib.metadata import entry_points, EntryPoint
import importlib.util
from inspect import isabstract
from pathlib import Path
import sys
from typing import TypeVar
from zlib import crc32

from cpg_ros.errors import CpgError, InputError
from cpg_ros.files import regular_file
from cpg_ros.networks import biped, delayed, oscillators, quadruped
from cpg_ros.networks.leg_numbers import parted, with_legs
from cpg_ros.networks.network import Network, Preset
from cpg_ros.networks.network_check import flaw

GROUP = 'cpg_ros.networks'
#: Largest file of a network, bytes.
LARGEST = 4_000_000
_OWN: list[type[Network]] = [delayed.Delayed, quadruped.Quadruped, biped.Biped,
                             *oscillators.shipped()]
#: Those that come with the package.
SHIPPED: dict[str, type[Network]] = {network.name: network for network in _OWN}

Entry = TypeVar('Entry')


class NetworkError(CpgError):
    """There is no such network, or it cannot be used; one line."""


class _Networks(Mapping[str, type[Network]]):
    """All networks by name; those of other packages are loaded on first use."""

    def __init__(self) -> None:
        #: Network of a file -> the file.
        self.files: dict[type[Network], Path] = {}

    @cached_property
    def _offered(self) -> dict[str, EntryPoint]:
        return {point.name: point for point in entry_points(group=GROUP)
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
            NetworkError: the entry point of another package is of no use, or a network does not
                take that number of legs.
            KeyError: there is none of this name.

        """
        own = {**SHIPPED, **{network.name: network for network in self.files}}
        if name in own:
            return own[name]
        known = parted(name)
        if name not in self._offered and known is not None and known[0] in self:
            return _numbered(*known)
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
    """Tell whether a network is named by its file."""
    return name.endswith('.py') or '/' in name


def find_network(name: str, folder: Path | None = None) -> type[Network]:
    """Return a network by its name, or the one that a file defines; from then on it has a name.

    Args:
        name: of a network, or path of a file.
        folder: that relative paths start from, instead of the working directory.

    Raises:
        NetworkError: there is no such network or file, or what it states cannot be used; the
            message names the file and the reason.

    """
    if is_path(name):
        try:
            path = ((folder or Path()) / Path(name).expanduser()).resolve()
            there = path.is_file()
        except (OSError, RuntimeError, ValueError) as error:
            raise NetworkError(' '.join(f'{name}: {error}'.split())) from error
        if not there:
            raise NetworkError(f'{path}: there is no such file')
        return _of_file(path)
    if name not in NETWORKS:
        raise NetworkError(f"'{name}' is not one of {', '.join(NETWORKS)}")
    return NETWORKS[name]


def reference(name: str) -> str:
    """Return what find_network finds a network by in another process: its name or its file."""
    return str(NETWORKS.files.get(NETWORKS[name], name))


def numbered(legs: int) -> tuple[type[Network], ...]:
    """Return the shipped networks for a number of legs."""
    found = []
    for network in SHIPPED.values():
        with suppress(InputError):
            found.append(with_legs(network, legs))
    return tuple(found)


def with_legs_of(network: type[Network], legs: Collection[str]) -> type[Network]:
    """Return a network's like for as many legs, if it takes so many, or else itself."""
    try:
        return with_legs(network, len(legs))
    except InputError:
        return network


def _numbered(family: str, legs: int) -> type[Network]:
    try:
        return _checked(f'{family}{legs}', with_legs(NETWORKS[family], legs))
    except InputError as error:
        raise NetworkError(f"'{family}{legs}': {error}") from error


def _usable(source: str, load: Callable[[], Entry]) -> Entry:
    """Run code of others, and say in one line what goes wrong in it."""
    try:
        return load()
    except Exception as error:
        raise NetworkError(' '.join(f'{source}: {type(error).__name__}: {error}'.split())
                           ) from error


def _checked(source: str, network: type[Network]) -> type[Network]:
    why = _usable(source, lambda: flaw(network))
    if why:
        raise NetworkError(f'{source}: {why}')
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
    with regular_file.opened(path, NetworkError, largest=LARGEST):
        pass
    module = sys.modules[name] = importlib.util.module_from_spec(spec)
    loader = spec.loader
    try:
        _usable(str(path), lambda: loader.exec_module(module))
        found = [value for value in vars(module).values()
                 if isinstance(value, type) and issubclass(value, Network)
                 and value.__module__ == name and not isabstract(value)]
        if len(found) != 1:
            listed = ', '.join(network.__name__ for network in found)
            raise NetworkError(f'{path}: it must define one class of networks, not '
                               + (f'{len(found)}: {listed}' if found else 'none'))
        network = _checked(str(path), found[0])
        if network.name in NETWORKS:
            raise NetworkError(f"{path}: the name '{network.name}' is that of another network")
    except NetworkError:
        del sys.modules[name]
        raise
    NETWORKS.files[network] = path
    return network

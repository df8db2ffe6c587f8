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

"""The shipped networks, one file each; every file of this folder is loaded."""

from importlib import import_module
from inspect import isabstract
from pkgutil import iter_modules

from cpg_ros.networks.network import Network

__all__ = ['biped', 'delayed', 'families', 'hopf', 'matsuoka', 'morris_lecar', 'phase',
           'quadruped']

#: Networks of the papers come first, then the others by the names of their files.
_FIRST = 'delayed', 'quadruped', 'biped'


def shipped() -> list[type[Network]]:
    """Return the networks of all files in this folder, in the order in which they are defined."""
    names = sorted((module.name for module in iter_modules(__path__)),
                   key=lambda name: (_FIRST.index(name) if name in _FIRST else len(_FIRST), name))
    modules = [import_module(f'{__name__}.{name}') for name in names]
    return [value for module in modules for value in vars(module).values()
            if isinstance(value, type) and issubclass(value, Network)
            and value.__module__ == module.__name__ and not isabstract(value)
            and hasattr(value, 'name')]

"""Networks of oscillators that drive legs, each a file of its own: every file here is found.

Imports ``networks``; knows nothing of ROS.
"""

from importlib import import_module
from inspect import isabstract
from pkgutil import iter_modules

from cpg_ros.networks.network import Network

__all__ = ['hopf', 'matsuoka', 'phase', 'shipped']


def shipped() -> list[type[Network]]:
    """Return the networks of all files of this folder, in the order in which they stand there."""
    modules = [import_module(f'{__name__}.{module.name}') for module in iter_modules(__path__)]
    return [value for module in modules for value in vars(module).values()
            if isinstance(value, type) and issubclass(value, Network)
            and value.__module__ == module.__name__ and not isabstract(value)
            and hasattr(value, 'name')]

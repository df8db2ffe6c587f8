"""The modules of the package."""

import pkgutil
from importlib import import_module
from importlib.util import find_spec
from types import ModuleType

import cpg_ros


def modules() -> list[ModuleType]:
    """Import every module of the package; that for launch files only where ROS's launch is."""
    names = [one.name for one in pkgutil.walk_packages(cpg_ros.__path__, 'cpg_ros.')
             if not one.name.endswith('launch_arguments') or find_spec('launch_ros')]
    return [import_module(name) for name in names]

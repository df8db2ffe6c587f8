"""The modules of the package."""

import pkgutil
from importlib import import_module
from importlib.util import find_spec
from types import ModuleType

import cpg_ros

#: Ends of modules' names -> what they need.
ONLY_WITH = {'launch_arguments': 'launch_ros', 'rosbag2_library': 'rosbag2_py'}


def modules() -> list[ModuleType]:
    """Import every module of the package; those for what only ROS brings only where it is."""
    names = [one.name for one in pkgutil.walk_packages(cpg_ros.__path__, 'cpg_ros.')
             if all(find_spec(needed) for end, needed in ONLY_WITH.items()
                    if one.name.endswith(end))]
    return [import_module(name) for name in names]

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

"""The modules of the package."""

from importlib import import_module
from importlib.util import find_spec
import pkgutil
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

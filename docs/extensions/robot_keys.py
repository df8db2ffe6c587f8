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

"""Keys of robot files: those that the reader asks for when it reads a file that has them all."""

import re
from typing import Any
from unittest.mock import patch

from cpg_ros.common.yaml_reader import YamlReader
from cpg_ros.motion.robot_file import load_robot
from cpg_ros.networks.registry import SHIPPED

#: Keys that are names of the user's own, or of the network's.
NAMED = {'legs': 'LEG', 'gaits': 'GAIT', 'joints': 'JOINT', 'links': 'JOINT', 'soles': 'LEG'}
#: Shipped files that have all keys between them.
COMPLETE = ('unitree_go2', 'humanoid')


def asked_for() -> dict[str, bool]:
    """Return key -> whether it is required."""
    found: dict[str, bool] = {}
    legs = {leg for kind in SHIPPED.values() for part in kind.legs.values() for leg in part}
    gaits = {name for kind in SHIPPED.values() for name in kind.presets()}
    ask = YamlReader.keys

    def noted(self: Any, tree: Any, where: str, required: set[str],
              optional: set[str] = frozenset()) -> Any:  # type: ignore[assignment]
        if not (required | optional) <= (legs | gaits | names):
            place = '.'.join(_plain(where.partition(' (')[0].split('.')))
            for key in required | optional:
                found[f'{place}.{key}'.removeprefix('file.')] = key in required
        return ask(self, tree, where, required, optional)

    robots = [load_robot(name) for name in COMPLETE]
    names = {name for robot in robots for name in (*robot.order, *robot.held)}
    with patch.object(YamlReader, 'keys', noted):
        for name in COMPLETE:
            load_robot(name)
    return found


def _plain(parts: list[str]) -> list[str]:
    """Return a place in a file with a capital word for every name."""
    return [NAMED[before] if before in NAMED and '[' not in part else
            re.sub(r'\[\d+\]', '[]', part)
            for before, part in zip(['', *parts], parts, strict=False)]

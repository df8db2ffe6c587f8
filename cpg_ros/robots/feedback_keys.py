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

"""The feedback of a robot in its file, part ``feedback``: its own laws and gains, if it helps."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, TypeVar

from cpg_ros.files.yaml_reader import shown, YamlReader
from cpg_ros.short_repr import ShortRepr

Value = TypeVar('Value')


@dataclass(frozen=True, repr=False)
class OwnFeedback(ShortRepr):
    """What a robot's feedback has of its own, where that is not the usual.

    Attributes:
        enabled: whether the feedback is on where nothing else is said.
        made: how this was found, '' if it is not said.
        laws: whether laws are on, by name.
        gains: by name, dimensionless: lengths as shares of the legs' length l, times of
            sqrt(l/g).
        imu_mount: roll, pitch and yaw of the IMU's frame in the base's, rad; empty for the same.

    """

    enabled: bool = True
    made: str = ''
    laws: dict[str, bool] = field(default_factory=dict)
    gains: dict[str, float] = field(default_factory=dict)
    imu_mount: tuple[float, ...] = ()


def read_feedback(reader: YamlReader, tree: Any) -> OwnFeedback:
    """Take the part ``feedback``; who uses laws and gains knows their names."""
    tree = reader.keys(tree, 'feedback', set(), {'enabled', 'made', 'laws', 'gains',
                                                     'imu_mount'})

    def switch(value: Any, where: str) -> bool:
        if not isinstance(value, bool):
            raise reader.fail(where, f'must be true or false, not {shown(value)}')
        return value

    def listed(key: str, read: Callable[[Any, str], Value]) -> dict[str, Value]:
        own = tree.get(key, {})
        own = reader.keys(own, f'feedback.{key}', set(), set(own) if isinstance(own, dict) else
                          set())
        return {name: read(value, f'feedback.{key}.{name}') for name, value in own.items()}

    made = reader.text(tree['made'], 'feedback.made') if 'made' in tree else ''
    mount = tree.get('imu_mount', [])
    if not isinstance(mount, list) or len(mount) not in (0, 3):
        raise reader.fail('feedback.imu_mount', 'must be a list of roll, pitch and yaw in rad')
    return OwnFeedback(switch(tree.get('enabled', True), 'feedback.enabled'), made,
                       listed('laws', switch), listed('gains', reader.number),
                       tuple(reader.number(angle, 'feedback.imu_mount') for angle in mount))


def feedback_tree(own: OwnFeedback) -> dict[str, Any]:
    """Return what ``read_feedback`` reads back."""
    tree = {key: value for key, value in vars(own).items() if value not in ('', {}, ())}
    return {**tree, 'imu_mount': list(own.imu_mount)} if own.imu_mount else tree

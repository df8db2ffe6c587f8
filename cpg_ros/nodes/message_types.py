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

"""Message types by name: the class, and the text of the fields."""

from importlib import import_module
from pathlib import Path
from typing import Any

from ament_index_python.packages import get_package_share_directory, PackageNotFoundError
from cpg_ros.errors import CpgError


class UnknownType(CpgError):
    """A type of messages that is not installed here; one line."""

    exit_code = 1


def message_class(kind: str) -> Any:
    """Return the class of a type such as sensor_msgs/msg/JointState.

    Raises:
        UnknownType: its package is not installed.

    """
    package, _, name = kind.partition('/msg/')
    try:
        return getattr(import_module(f'{package}.msg'), name)
    except (ImportError, AttributeError):
        raise UnknownType(f'the type {kind} is not installed here') from None


def message_fields(kind: str) -> str:
    """Return the text of a type's .msg file.

    Raises:
        UnknownType: its package does not have it.

    """
    package, _, name = kind.partition('/msg/')
    try:
        return (Path(get_package_share_directory(package)) / 'msg' / f'{name}.msg').read_text()
    except (PackageNotFoundError, OSError):
        raise UnknownType(f'the fields of {kind} are not known here') from None

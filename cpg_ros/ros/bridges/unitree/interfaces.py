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

"""Unitree's message types and topics; a missing package is one line that says how to get it."""

from importlib import import_module
from pathlib import Path
import sys

from cpg_ros.common.errors import MissingLibraryError
from cpg_ros.ros.bridges.unitree.messages import LowCmd
from cpg_ros.ros.bridges.watchdog_link import RobotInterface
import rclpy


def message(name: str) -> type:
    """Return a message type, such as ``unitree_go/LowCmd``.

    Raises:
        MissingLibraryError: its package is not there; says how to get it.

    """
    package, kind = name.split('/')
    try:
        return getattr(import_module(f'{package}.msg'), kind)
    except ImportError as error:
        wheels = Path(rclpy.__file__).is_relative_to(sys.prefix)
        raise MissingLibraryError(
            f'the messages of {package} are missing ({error}): ' + (
                "'make messages' builds them" if wheels else
                'build unitree_go and unitree_api of '
                'https://github.com/unitreerobotics/unitree_ros2 with colcon, and source that '
                'workspace')) from error


class Unitree(RobotInterface):
    """Low-level commands and states of the robots that use ``unitree_go``."""

    maker = 'unitree'
    command_topic, state_topic = '/lowcmd', '/lowstate'
    raw_states = True

    @staticmethod
    def command_type() -> type:
        """Return ``LowCmd``; errors as of ``message``."""
        return message('unitree_go/LowCmd')

    @staticmethod
    def state_type() -> type:
        """Return ``LowState``; errors as of ``message``."""
        return message('unitree_go/LowState')

    @staticmethod
    def make_command() -> LowCmd:
        """Return a command in which no joint is driven."""
        return LowCmd()

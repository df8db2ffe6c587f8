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

"""The names, topics and messages that a bridge and its watchdog share."""

from typing import ClassVar

from cpg_ros.safety.robot_state import JointCommand


class RobotInterface:
    """Topics and messages of a robot; a bridge has a subclass, which is never instantiated.

    The watchdog is a process of its own, which imports the subclass's module by name: keep that
    module small.

    Attributes:
        maker: prefix of the names of the nodes ``..._bridge`` and ``..._watchdog``.
        command_topic: of the commands.
        state_topic: of the measured states.
        raw_states: whether ``RobotState.read`` takes the messages as bytes.

    """

    maker: ClassVar[str]
    command_topic: ClassVar[str]
    state_topic: ClassVar[str]
    raw_states: ClassVar[bool] = False

    @classmethod
    def bridge_name(cls) -> str:
        """Return the name of the bridge's node."""
        return f'{cls.maker}_bridge'

    @classmethod
    def watchdog_name(cls) -> str:
        """Return the name of the watchdog's node."""
        return f'{cls.maker}_watchdog'

    @classmethod
    def reference(cls) -> str:
        """Return the name by which ``pkgutil.resolve_name`` finds this class."""
        return f'{cls.__module__}:{cls.__name__}'

    @staticmethod
    def command_type() -> type:
        """Return the message type of commands."""
        raise NotImplementedError

    @staticmethod
    def state_type() -> type:
        """Return the message type of states."""
        raise NotImplementedError

    @staticmethod
    def make_command() -> JointCommand:
        """Return a command, to be filled and encoded."""
        raise NotImplementedError

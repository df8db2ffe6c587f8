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

"""What is used of the library `rosbags`."""

from typing import Any

from rosbags.rosbag2 import Reader, ReaderError
from rosbags.serde import SerdeError
from rosbags.typesys import get_typestore, Stores

__all__ = ['STORE', 'Reader', 'ReaderError', 'SerdeError', 'deserialize']

#: The layout of a JointState is the same in all ROS 2 distributions.
STORE = get_typestore(Stores.ROS2_JAZZY)


def deserialize(message: bytes) -> Any:
    """Return a JointState out of its bytes.

    Raises:
        SerdeError: they are none.

    """
    return STORE.deserialize_cdr(message, 'sensor_msgs/msg/JointState')

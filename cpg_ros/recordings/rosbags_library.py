"""What is used of the library `rosbags`."""

from typing import Any

from rosbags.rosbag2 import Reader, ReaderError
from rosbags.serde import SerdeError
from rosbags.typesys import Stores, get_typestore

__all__ = ['STORE', 'Reader', 'ReaderError', 'SerdeError', 'deserialize']

#: The layout of a JointState is the same in all ROS 2 distributions.
STORE = get_typestore(Stores.ROS2_JAZZY)


def deserialize(message: bytes) -> Any:
    """Return a JointState out of its bytes.

    Raises:
        SerdeError: they are none.

    """
    return STORE.deserialize_cdr(message, 'sensor_msgs/msg/JointState')

"""What is used of the library `rosbags`, and one line where it is missing."""

from cpg_ros.errors import needed

needed('rosbags')

from rosbags.rosbag2 import Reader, ReaderError  # noqa: E402
from rosbags.serde import SerdeError  # noqa: E402
from rosbags.typesys import Stores, get_typestore  # noqa: E402

__all__ = ['Reader', 'ReaderError', 'SerdeError', 'Stores', 'get_typestore']

"""What reads bags: the library `rosbags`, or ROS's ``rosbag2_py`` where that is not installed.

Ubuntu 24.04 has no apt package of `rosbags`; every ROS desktop has ``rosbag2_py``.
"""

from importlib.util import find_spec

from cpg_ros.errors import needed

if find_spec('rosbags') is not None or find_spec('rosbag2_py') is None:
    needed('rosbags')
    from cpg_ros.recordings.rosbags_library import Reader as Reader
    from cpg_ros.recordings.rosbags_library import ReaderError as ReaderError
    from cpg_ros.recordings.rosbags_library import SerdeError as SerdeError
    from cpg_ros.recordings.rosbags_library import deserialize as deserialize
else:
    from cpg_ros.recordings.rosbag2_library import Reader as Reader  # type: ignore[assignment]
    from cpg_ros.recordings.rosbag2_library import (  # type: ignore[assignment]
        ReaderError as ReaderError,
    )
    from cpg_ros.recordings.rosbag2_library import (  # type: ignore[assignment]
        SerdeError as SerdeError,
    )
    from cpg_ros.recordings.rosbag2_library import deserialize as deserialize

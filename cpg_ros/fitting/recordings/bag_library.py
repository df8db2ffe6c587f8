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

"""The library that reads bags: `rosbags`, or ROS's ``rosbag2_py`` if that is not installed.

Ubuntu 24.04 has no apt package of `rosbags`; every ROS desktop has ``rosbag2_py``.
"""

from importlib.util import find_spec

from cpg_ros.common.errors import needed

if find_spec('rosbags') is not None or find_spec('rosbag2_py') is None:
    needed('rosbags')
    from cpg_ros.fitting.recordings.rosbags_library import (
        deserialize,
        Reader,
        ReaderError,
        SerdeError,
        unpack_file,
    )
else:
    from cpg_ros.fitting.recordings.rosbag2_library import (  # type: ignore[assignment]
        deserialize,
        Reader,
        ReaderError,
        SerdeError,
        unpack_file,
    )

__all__ = ['Reader', 'ReaderError', 'SerdeError', 'deserialize', 'unpack_file']

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

"""Recorded and live joint states: bags, files of laboratories, messages as bytes.

Imports ``files``; knows nothing of ROS, but for ``rosbag2_library``, which reads bags by it.
"""

__all__ = ['bag_library', 'bag_reader', 'bag_storage', 'bag_writer', 'bvh_reader', 'c3d_process',
           'c3d_reader', 'cdr', 'csv_reader', 'foot_loads', 'formats', 'frame_stamps',
           'joint_patterns', 'joint_streams', 'live_buffer', 'load_stream', 'markers',
           'mot_reader', 'npz_reader', 'number_rows', 'pose_reader', 'recording',
           'recording_format', 'rosbag2_library', 'rosbags_library', 'segments', 'servo',
           'stray_samples', 'table_columns', 'table_text', 'thinned', 'trc_reader',
           'unfinished_mcap', 'unpacked_size']

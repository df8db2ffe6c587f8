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

"""Recorded and live joint states: bags, laboratory files, messages as bytes."""

__all__ = ['bag_library', 'bag_reader', 'bag_storage', 'bag_writer', 'bvh_reader', 'c3d_reader',
           'cdr', 'csv_reader', 'downsampling', 'formats', 'joint_streams', 'low_state',
           'markers', 'npz_reader',
           'opensim_reader', 'pose_reader', 'reader_process', 'recording', 'rosbag2_library',
           'rosbags_library', 'tables']

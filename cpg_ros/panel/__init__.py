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

"""A page in the browser that shows, drives and records what is on the graph.

Speaks only ROS: topics, services and parameters of whatever runs. Imports ``nodes`` and what is
below; nothing but its executable imports it.
"""

from cpg_ros.errors import needed

# Before any of its modules: one line where the extra is missing, not a traceback.
needed('websockets', part='websockets.asyncio')

__all__ = [
           'access_control',
           'body_shape',
           'controls',
           'graph',
           'lease',
           'model_shape',
           'pages',
           'panel_node',
           'recorder',
           'request_handler',
           'requests',
           'robot_view',
           'shape_facts',
           'shape_source',
           'steering',
           'stick_figure',
           'teleop',
           'urdf_shape',
           'web_server',
]

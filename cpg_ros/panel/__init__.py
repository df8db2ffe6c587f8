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

"""A browser page that shows, drives and records the robots on the graph.

Its server uses topics, services and parameters only. Imports ``nodes`` and the subpackages below;
only its executable imports it.
"""

from cpg_ros.errors import needed

# Before any of its modules: one line where the extra is missing, not a traceback.
needed('websockets', part='websockets.asyncio')

__all__ = ['access_control', 'body_shape', 'bridge_views', 'controls', 'graph', 'lease',
           'model_shape', 'pages', 'panel_node', 'recorder', 'request_handler', 'requests',
           'robot_view', 'shape_source', 'start_watch', 'stick_figure', 'teleop', 'urdf_shape',
           'web_server']

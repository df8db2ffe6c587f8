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

Its server uses topics, services and parameters only.
"""

from cpg_ros.common.errors import needed

# One line where the extra is missing, before a module imports it.
needed('websockets', part='websockets.asyncio')

__all__ = ['pages', 'panel_node', 'robot_view', 'shape', 'teleop',
           'web_server']

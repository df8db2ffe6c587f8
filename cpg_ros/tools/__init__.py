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

"""Command-line tools: arguments, tables, figures.

Imports every subpackage; nothing imports it.
"""

__all__ = ['analysis_plot', 'analysis_report', 'analyze', 'arguments', 'atlas', 'bag_playing',
           'bag_recording', 'basin_report', 'branch_report', 'calibrate', 'check_robot',
           'command_line', 'completion', 'cpg', 'demo', 'demo_course', 'demo_operator',
           'demo_processes', 'executables', 'export', 'gait_diagram', 'graph_topics', 'inversion',
           'network_options', 'optimize', 'own_robot', 'phase_plot', 'phase_report', 'precompile',
           'reading_options', 'record_dataset', 'reproduce', 'reproduction_report',
           'schedule_playing', 'tune']

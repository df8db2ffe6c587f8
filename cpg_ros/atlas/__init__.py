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

"""Maps of where gaits live, over two parameters, with their exact boundaries.

Imports ``fleet``, ``dynamics`` and what is below; knows nothing of ROS.
"""

__all__ = ['bautin_folds', 'chart', 'codimension_two', 'fold_curves', 'fold_cusps',
           'grid_refinement', 'hopf_condition', 'hopf_curve_ends', 'hopf_curves',
           'hopf_degeneracies', 'hopf_starts', 'infinite_periods', 'map_page', 'map_picture',
           'orbit_curves', 'orbit_plane', 'resonances', 'row_job', 'stability_losses',
           'stored']

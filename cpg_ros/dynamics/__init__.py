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

"""Orbits, their stability, Hopf points and branches.

Imports ``integration`` and what is below; knows nothing of ROS.
"""

__all__ = ['arclength', 'bifurcation', 'branch_end', 'branch_orbits', 'characteristic',
           'coexisting_orbits', 'continuation', 'critical_disturbances', 'deflation',
           'delay_crossings', 'equilibrium',
           'expansion', 'floquet', 'fourier', 'gait_assessment', 'hopf_point',
           'hopf_search', 'isotypic', 'isotypic_split', 'mesh', 'normal_form', 'orbit',
           'orbit_method', 'orbit_normal_form', 'periodic', 'phase_reduction', 'phase_response',
           'seek', 'sign_changes', 'stability', 'switching']

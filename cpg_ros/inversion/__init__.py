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

"""A network fitted to a recorded gait: parameters, readouts, and how sure they are.

Imports ``gaits``, ``motion`` and what is below; knows nothing of ROS.
"""

__all__ = [
           'caveats',
           'coordinates',
           'cycle_fit',
           'fallback_fits',
           'fit_data',
           'fit_figures',
           'fit_report',
           'free_parameters',
           'gait_fit',
           'gait_schedule',
           'identifiability',
           'invert',
           'least_squares',
           'model_choice',
           'paper_fit',
           'parameter_files',
           'recording_fit',
           'stretch_fits',
           'stride_report',
           'trust_region',
           'variable_projection',
           'waveform_harmonics',
]

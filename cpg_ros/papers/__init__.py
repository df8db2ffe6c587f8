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

"""Published quantities of the papers, each beside what our own numerics give for it.

Imports ``inversion``, ``gaits``, ``dynamics`` and what is below; knows nothing of ROS.
"""

__all__ = ['buono_appendix', 'buono_blocks', 'buono_gaits', 'buono_golubitsky', 'buono_groups',
           'buono_hopf', 'buono_proofs', 'buono_tables', 'catalogue', 'cell_constants',
           'commentary', 'errata', 'figures', 'liu_zhang', 'oscillators', 'published_normal_form',
           'rashidi', 'reproduction', 'rhythm', 'row', 'taylor_terms', 'theorem_4_2']

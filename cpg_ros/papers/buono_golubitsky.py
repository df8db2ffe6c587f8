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

"""Buono & Golubitsky (2001), Models of central pattern generators for quadruped locomotion I."""

from cpg_ros.papers import (
    buono_appendix,
    buono_blocks,
    buono_gaits,
    buono_groups,
    buono_hopf,
    buono_proofs,
)
from cpg_ros.papers.row import Paper

PAPER = Paper('buono_golubitsky', buono_gaits.AUTHORS,
              'P.-L. Buono, M. Golubitsky: Models of central pattern generators for quadruped '
              'locomotion. I. Primary gaits (2001)',
              (buono_gaits.constants, buono_gaits.fast_gaits, buono_gaits.slow_gaits,
               buono_groups.dihedral, buono_groups.lattice, buono_groups.four_cells,
               buono_groups.legs,
               buono_blocks.phases, buono_blocks.tables, buono_blocks.coupled_variable,
               buono_blocks.equal_couplings, buono_hopf.the_stand, buono_hopf.existence,
               buono_hopf.table_12, buono_hopf.theorem_4_2, buono_proofs.genericity,
               buono_proofs.jump, buono_proofs.stable_points, buono_proofs.near_equal,
               buono_proofs.necessary_and_sufficient, buono_appendix.conditions,
               buono_appendix.one_variable))

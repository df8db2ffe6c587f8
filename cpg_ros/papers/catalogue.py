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

"""The papers by name."""

from cpg_ros.papers import buono_golubitsky, liu_zhang, oscillators, rashidi
from cpg_ros.papers.row import Paper

PAPERS: dict[str, Paper] = {paper.name: paper for paper in (
    liu_zhang.PAPER, buono_golubitsky.PAPER, rashidi.PAPER, *oscillators.PAPERS)}

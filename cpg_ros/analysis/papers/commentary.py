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

"""Statements of the papers on Hopf points of their networks, beside the computed ones."""

from typing import Any, cast

from cpg_ros.analysis.papers.buono_hopf import theorem_verdict
from cpg_ros.analysis.papers.liu_zhang import published_normal_form
from cpg_ros.dynamics.hopf import HopfPoint
from cpg_ros.networks.library.quadruped import Quadruped


class Commentary:
    """No statement, for other networks.

    Attributes:
        heads: of columns in a table of Hopf points.
        explained: what these columns are.
        title: above the remarks.

    """

    heads: tuple[str, ...] = ()
    explained = ''
    title = ''

    def numbers(self, point: HopfPoint) -> dict[str, float]:
        """Return the numbers of the columns, name -> number."""
        return {}

    def remark(self, point: HopfPoint) -> tuple[str, dict[str, Any]]:
        """Return a statement as text and in plain types; here, none."""
        return '', {}


class PublishedForm(Commentary):
    """The coefficients of the normal form by the formulas of Liu & Zhang (2024)."""

    heads = ("k1'", "k2'")
    explained = "k1', k2' as\nLiu & Zhang print them, which is wrong; "

    def numbers(self, point: HopfPoint) -> dict[str, float]:
        """Both real parts."""
        form = published_normal_form(point)
        return {'k1_published': form.k1.real, 'k2_published': form.k2.real}


class Theorem(Commentary):
    """Theorem 4.2 of Buono & Golubitsky (2001)."""

    title = 'Buono & Golubitsky at these points:'

    def remark(self, point: HopfPoint) -> tuple[str, dict[str, Any]]:
        """Return the verdict of the theorem."""
        verdict = theorem_verdict(cast(Quadruped, point.network), point.gait)
        return str(verdict), {'theorem_4_2': {
            'applies': verdict.applies, 'stable': verdict.stable, 'says': str(verdict)}}


#: Network -> commentary.
COMMENTARIES: dict[str, Commentary] = {'delayed': PublishedForm(), 'quadruped': Theorem()}

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

"""All rows and figures of the papers, their parts computed side by side."""

from collections.abc import Callable, Sequence
from concurrent.futures import as_completed
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path

from cpg_ros.analysis.papers import (
    buono_gaits,
    buono_hopf,
    buono_linear,
    liu_zhang,
    oscillators,
    rashidi,
)
from cpg_ros.analysis.papers.row import Paper, Picture, ReproducedRow
from cpg_ros.common.errors import CpgError
from cpg_ros.common.workers import processes
import yaml

# Buono & Golubitsky (2001), Models of central pattern generators for quadruped locomotion I.

PAPER = Paper('buono_golubitsky', buono_gaits.AUTHORS,
              'P.-L. Buono, M. Golubitsky: Models of central pattern generators for quadruped '
              'locomotion. I. Primary gaits (2001)',
              (buono_gaits.constants, buono_gaits.fast_gaits, buono_gaits.slow_gaits,
               buono_gaits.dihedral, buono_gaits.lattice, buono_gaits.four_cells,
               buono_gaits.legs,
               buono_linear.phases, buono_linear.tables, buono_linear.coupled_variable,
               buono_linear.equal_couplings, buono_hopf.the_stand, buono_hopf.existence,
               buono_hopf.table_12, buono_hopf.theorem_4_2, buono_hopf.genericity,
               buono_hopf.jump, buono_hopf.stable_points, buono_hopf.near_equal,
               buono_hopf.necessary_and_sufficient, buono_gaits.conditions,
               buono_gaits.one_variable))


# The papers by name.

PAPERS: dict[str, Paper] = {paper.name: paper for paper in (
    liu_zhang.PAPER, PAPER, rashidi.PAPER, *oscillators.PAPERS)}


#: Errata of the papers by number: paper and text.
ERRATA: dict[int, tuple[str, str]] = {
    number: (erratum['paper'], erratum['text']) for number, erratum in
    yaml.safe_load(Path(__file__).with_name('errata.yaml').read_text('utf-8')).items()}


#: Dots per inch of a figure.
RESOLUTION = 100


@dataclass(frozen=True)
class Drawn:
    """A figure as a picture: paper, number, caption, and PNG."""

    paper: str
    place: str
    caption: str
    png: bytes


@dataclass(frozen=True)
class Reproduction:
    """The rows and figures of some papers.

    Attributes:
        papers: whose they are.
        rows: in the order of the papers.
        figures: likewise; none if they were not drawn.

    """

    papers: tuple[Paper, ...]
    rows: tuple[ReproducedRow, ...]
    figures: tuple[Drawn, ...]

    @property
    def failed(self) -> tuple[ReproducedRow, ...]:
        """Rows that differ, but not as an erratum says."""
        return tuple(row for row in self.rows if not row.agrees and not row.explained)

    @property
    def explained(self) -> tuple[ReproducedRow, ...]:
        """Rows that differ as an erratum says."""
        return tuple(row for row in self.rows if not row.agrees and row.explained)

    @property
    def errata(self) -> dict[int, tuple[str, str]]:
        """Errata of these papers, by number: paper and text."""
        authors = {paper.authors for paper in self.papers}
        return {number: one for number, one in ERRATA.items() if one[0] in authors}

    @property
    def summary(self) -> str:
        """How many rows agree, in one line."""
        agree = sum(row.agrees for row in self.rows)
        return (f'{len(self.rows)} published quantities: {agree} agree, {len(self.explained)} '
                f'explained by errata, {len(self.failed)} fail')


def _section(paper: Paper, number: int, draw: bool) -> tuple[list[ReproducedRow], list[Drawn]]:
    """Compute a part of a paper; one that breaks off leaves a row that fails."""
    rows: list[ReproducedRow] = []
    figures: list[Drawn] = []
    section = paper.sections[number]
    try:
        for one in section():
            if isinstance(one, ReproducedRow):
                rows.append(one)
            elif draw:
                figures.append(_drawn(one))
    except (CpgError, ArithmeticError) as error:
        rows.append(ReproducedRow(paper.authors, section.__name__.replace('_', ' '),
                                  'what is printed here',
                                  'a result', f'no result: {error}', False, 'computed at all'))
    return rows, figures


def _drawn(picture: Picture) -> Drawn:
    file = BytesIO()
    picture.figure.savefig(file, format='png', dpi=RESOLUTION)
    return Drawn(picture.paper, picture.place, picture.caption, file.getvalue())


def reproduce(names: Sequence[str], jobs: int = 1, draw: bool = True,
              progress: Callable[[int], None] = lambda done: None) -> Reproduction:
    """Compute all rows of some papers.

    Args:
        names: of the papers, from ``registry.PAPERS``.
        jobs: processes to share the work; 1 does it in this one.
        draw: whether to draw the figures.
        progress: takes the number of parts done, out of ``parts(names)``.

    """
    papers = tuple(PAPERS[name] for name in names)
    tasks = [(paper, number, draw) for paper in papers for number in range(len(paper.sections))]
    done: dict[int, tuple[list[ReproducedRow], list[Drawn]]] = {}
    if jobs == 1:
        for place, task in enumerate(tasks):
            done[place] = _section(*task)
            progress(len(done))
    else:
        pool = processes(min(jobs, len(tasks)))
        try:
            waiting = {pool.submit(_section, *task): place for place, task in enumerate(tasks)}
            for future in as_completed(waiting):
                done[waiting[future]] = future.result()
                progress(len(done))
        finally:
            # After an error or Ctrl-C, jobs that are under way are of no use.
            pool.shutdown(wait=len(done) == len(tasks))
    parts = [done[place] for place in range(len(tasks))]
    return Reproduction(papers, tuple(row for rows, _ in parts for row in rows),
                        tuple(figure for _, figures in parts for figure in figures))


def parts(names: Sequence[str]) -> int:
    """Return the number of parts of the papers."""
    return sum(len(PAPERS[name].sections) for name in names)

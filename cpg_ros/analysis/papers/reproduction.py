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

from cpg_ros.analysis.papers import (
    buono_gaits,
    buono_hopf,
    buono_linear,
    buono_symmetry,
    liu_zhang,
    oscillators,
    rashidi,
)
from cpg_ros.analysis.papers import (
    buono_hopf as buono_proofs,
)
from cpg_ros.analysis.papers.row import Paper, Picture, ReproducedRow
from cpg_ros.common.errors import CpgError
from cpg_ros.common.workers import processes

# Buono & Golubitsky (2001), Models of central pattern generators for quadruped locomotion I.

PAPER = Paper('buono_golubitsky', buono_gaits.AUTHORS,
              'P.-L. Buono, M. Golubitsky: Models of central pattern generators for quadruped '
              'locomotion. I. Primary gaits (2001)',
              (buono_gaits.constants, buono_gaits.fast_gaits, buono_gaits.slow_gaits,
               buono_symmetry.dihedral, buono_symmetry.lattice, buono_symmetry.four_cells,
               buono_symmetry.legs,
               buono_linear.phases, buono_linear.tables, buono_linear.coupled_variable,
               buono_linear.equal_couplings, buono_hopf.the_stand, buono_hopf.existence,
               buono_hopf.table_12, buono_hopf.theorem_4_2, buono_proofs.genericity,
               buono_proofs.jump, buono_proofs.stable_points, buono_proofs.near_equal,
               buono_proofs.necessary_and_sufficient, buono_symmetry.conditions,
               buono_symmetry.one_variable))


# The papers by name.

PAPERS: dict[str, Paper] = {paper.name: paper for paper in (
    liu_zhang.PAPER, PAPER, rashidi.PAPER, *oscillators.PAPERS)}


# Errata of the three papers, by number. Rows of the report that differ name one of these.

LIU, BUONO, RASHIDI = 'Liu & Zhang 2024', 'Buono & Golubitsky 2001', 'Rashidi et al. 2016'

#: Number -> paper and text.
ERRATA: dict[int, tuple[str, str]] = {
    1: (LIU,
        'D lacks the factor tau and takes the eigenvector of the pace for every gait, so k1 '
        'and k2 are wrong for all of them. Their signs, hence the verdicts on the centre '
        'manifold, survive in the sets of the paper, not in all. Correct: '
        'q = 1 + tau B exp(-i omega tau), k1 = Re(i omega/q), k2 '
        '= -Re(tau (b + d i^(-j) + B exp(-i omega tau))/q).'),
    2: (LIU,
        "Example 2's omega is 3.5199, not 3.5119."),
    3: (LIU,
        "'Stable' holds on the centre manifold only. In the full network the rest state has "
        'roots with positive real part outside the class of the gait, and the gait itself a '
        'transverse Floquet multiplier above 1: disturbances that leave its symmetry grow, '
        'and the network freezes.'),
    4: (LIU,
        "Figure 7's start values (0.1, -0.1, 0.1, -0.1, 0.2, -0.2, 0.2, -0.2) lead to a walk, "
        'not to the trot that it is said to show; (0.1, -0.1, 0.2, -0.2, 0.1, -0.1, 0.2, '
        '-0.2) give the trot.'),
    5: (LIU,
        "The goats' curves are in two theses and were never published as data. Tables 1 and 2 "
        'can be checked as a procedure only, on a recording that is made up: all starts reach '
        'one minimum. Their iterations, the error 11.6591 and the precision 1.85 as well as '
        'Figures 5, 6, 8 and 9 cannot be had without the data.'),
    6: (BUONO,
        "Table 12's trot has wrong signs: the Hopf point is at alpha = beta = -0.15, gamma = "
        'delta = -0.16, xi = eta = +0.31. At the couplings printed the stand is stable.'),
    7: (LIU,
        'The walk, also that of the goat, is of diagonal sequence (LH, RF, RH, LF), as x_3 '
        'leads x_1 by a quarter where d < 0. Goats walk in lateral sequence (LH, LF, RH, RF), '
        'which d > 0 gives.'),
    8: (RASHIDI,
        "Eq. 1 has the sign of u' reversed; eq. 9 repeats eq. 8; eqs. 6 to 9 number the cells "
        'otherwise than Table 5, which is right: as printed, eq. 7 is met by the jump and eq. '
        '8 by the run.'),
    9: (BUONO,
        "Section 7: 'in the criss-cross network, the situation is reversed' does not hold for "
        'pronk, bound and jump. The two cells of a leg, 1 and 6, differ by twice the shift of '
        'omega and once that of kappa: in pronk and bound they stay in phase, in the jump '
        'half a cycle apart.'),
    10: (BUONO,
         "Table 1's walk runs the wrong way: u_3(t) = u_1(t + 1/4) would put the fore leg "
         "ahead of the hind leg, against Table 1's own jump, Table 2 with eq. 3.1 (u_3(t) = "
         'u_1(t - 1/4)), section 3 (LH, LF, RH, RF) and the text on Figure 2. From both senses '
         "of the wave Table 13's walk settles in u_3(t) = u_1(t - 1/4)."),
    11: (RASHIDI,
         'Table 5 lacks the asymmetric hop (H = K = <rho tau>) and the one-legged hop (H = K = '
         '<tau>). In both some cells are equal at all times, which section 5 says happens in '
         'primary gaits only.'),
    12: (BUONO,
         'Table 7: the trace of L_21 has the wrong sign of (xi + eta); Tables 6, 8 and 11 have '
         'it right.'),
    13: (BUONO,
         'Proposition 5.2 and Table 11 call the trace, and what is added to it, the real part '
         'of an eigenvalue: it is twice that. So is the speed of crossing in the proof of '
         'Theorem 4.1. Signs, and so the theorems, are not touched.'),
    14: (BUONO,
         'Section 2.1: in Z4 x Z2 the element omega kappa has order 4, as (omega kappa)^2 = '
         'omega^2. So the spatial symmetries of the trot are Z4(omega kappa), not Z2.'),
    15: (BUONO,
         'Proof of Theorem 3.2: Z4 in D4 is a fourth type with kappa as a half-period shift '
         'and a spatial symmetry. It is no pace or trot either, as cells 1 and 5 (LH and RH) '
         'are in phase: the theorem stands.'),
    16: (BUONO,
         'Theorem 3.3 needs more than F(1) = LH and eq. 3.2, which 18 assignments satisfy: its '
         'proof also takes F(2) = RH, F(3) = LF and F(4) = RF from the gaits; then there are '
         'two.'),
    17: (RASHIDI,
         'Section 5 calls K spatio-temporal and H spatial; it is the other way round. The '
         'entries of Table 5 are right.'),
    18: (RASHIDI,
         'Section 5: the asymmetric and the one-legged hop could not be reached. Both can, as '
         'stable orbits, with directed weights that keep their symmetry.'),
    19: (BUONO,
         'Eqs. 4.3 and 4.4 have delta x_{i + eps} in the equation of y_i; Tables 7 to 10 and '
         'eq. 5.2 take delta y_{i + eps}. Linear synaptic coupling is h(x_i, x_j) = x_i from '
         'cell i, not x_j.'),
    20: (BUONO,
         'Lemma 5.8: sigma_21 = 0 gives nu_0 = 2 alpha + 2 gamma - 2 xi, not - xi, and it is '
         'sigma_01 that becomes 4 alpha, not sigma_10. The values that follow are right.'),
    21: (BUONO,
         'Proof of Proposition 5.6: nu = 2 gamma makes sigma_11 vanish, not sigma_10.'),
    22: (BUONO,
         'Proposition 5.5, Lemma 5.8: that the solution is asymptotically stable needs a '
         'supercritical bifurcation. With the cells of section 6 those of Table 12 are '
         'subcritical (first Lyapunov coefficients 2.2 and 2.3 > 0): what branches off is '
         'unstable, and the gaits of Table 13 coexist with a stable stand nearby.'),
    23: (BUONO,
         'Theorem 4.2 (e, f) and Proposition 5.7 take traces for real parts, as if the '
         'eigenvalues of the real blocks were never real; that needs small couplings. At alpha '
         '= -beta = 0.05, gamma = delta = -0.9966 there is a Hopf bifurcation to the walk with '
         'gamma < 0 that is not stable: L_21 has a real eigenvalue 0.10.'),
    24: (BUONO,
         'Eq. 5.3 holds for Psi >= 0 only: for Psi < 0 its square is Phi - i Psi. Only the '
         'real part is used, which is right.'),
    25: (LIU,
         'Section 2: the third row of F_3 has d phi_3^3(0) for d phi_1^3(0), as F_0 has it. As '
         'F = F_2/2! + F_3/3!, F_2 lacks the factor 2! and F_3 the factor 3!.'),
    26: (RASHIDI,
         'Section 5: the gallop by way of the two-legged jump and the hesitation walk by way of '
         'the run, which Pinto & Golubitsky predict, could not be reached. Both can, with '
         'directed weights that keep the symmetry of the gait.')}


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

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

"""Buono & Golubitsky (2001), sections 4 and 5: what the proofs claim beside their numbers.

The genericity condition of Theorem 4.1 (eq. 5.6), its Hopf points beyond the lines of the proof,
Theorem 4.1 for the jump, 4.3 for the trot, and 4.2 near equal couplings and at many points.
"""

from collections.abc import Iterator

from cpg_ros.dynamics.hopf_point import HopfPoint
from cpg_ros.dynamics.hopf_search import hopf_points
from cpg_ros.networks.quadruped import Quadruped
from cpg_ros.papers.buono_blocks import Sample, UNCOUPLED
from cpg_ros.papers.buono_gaits import AUTHORS
from cpg_ros.papers.buono_hopf import FAILING, hopf, stand_sample, THEOREM
from cpg_ros.papers.row import Citation, Picture, ReproducedRow
from cpg_ros.papers.theorem_4_2 import SIGNS
import numpy as np

#: Gait -> the line of the proof, the parameter that eq. 5.6 differentiates by, what it multiplies
#: in E = nu + ..., and the Hopf point on the line in units of nu_0.
PROOFS = {'walk': ('gamma=delta=-alpha=-beta', 'gamma=delta', -2.0, 0.5),
          'jump': ('gamma=delta=-alpha=-beta', 'gamma=delta', 2.0, -0.5),
          'pace': ('gamma=delta=-alpha=-beta', 'gamma=delta', -2.0, 0.25),
          'bound': ('gamma=delta=-alpha=-beta', 'gamma=delta', 2.0, -0.25),
          'trot': ('xi=eta=-alpha=-beta', 'xi=eta', 2.0, -0.25)}
#: Differences for the gradient of nu; how far off its line a Hopf point is followed; determinants
#: and speeds above this are not 0.
DIFFERENCE, OFF, NONZERO = 1e-5, 0.02, 1e-6
#: A critical pair's real part is 0 within this.
ON_AXIS = 1e-7
#: Theorem 4.2 'remains valid if |alpha - beta| and |gamma - delta| are nonzero and small'.
SMALL = (0.004, -0.003)
#: Values of alpha at which Hopf points are searched, and how far in gamma.
ALPHAS, GAMMAS = (-0.3, 0.1), (-1.2, 0.5)


def genericity_matrix(gait: str) -> np.ndarray:
    """Return the matrix of eq. 5.6 for a gait, at the uncoupled stand, shape (3, 3).

    Rows are the gradients of F, G and E by x, y and the gait's coupling.
    """
    sample = stand_sample(UNCOUPLED)
    matrix = np.empty((3, 3))
    matrix[:2, :2] = sample.blocks['L_00'].now.real
    matrix[2, :2] = [(_nu(sample.state + step) - _nu(sample.state - step)) / (2.0 * DIFFERENCE)
                     for step in DIFFERENCE * np.eye(2)]
    matrix[:2, 2], matrix[2, 2] = sample.state, PROOFS[gait][2]
    return matrix


def _nu(state: np.ndarray) -> float:
    return Sample(UNCOUPLED, state).trace('L_00').real


def _on_line(gait: str) -> HopfPoint:
    line, _, _, share = PROOFS[gait]
    there = share * stand_sample(UNCOUPLED).trace('L_00').real
    return hopf(UNCOUPLED, line, gait, there - 0.05, there + 0.05)


def genericity() -> Iterator[ReproducedRow | Picture]:
    """Eq. 5.6, and Hopf points beyond the lines of the proofs."""
    for gait, (_, free, _, _) in PROOFS.items():
        found = float(np.linalg.det(genericity_matrix(gait)))
        place = ('section 6', 'easily verified') if gait in ('pace', 'bound', 'trot') else (
            'eq. 5.6', 'generically nonzero')
        yield Citation(AUTHORS, place[0]).holds(
            f'{gait}: the determinant of eq. 5.6, of the genericity condition, is not 0',
            abs(found) > NONZERO, note=f'{place[1]}: {found:.4f}')
        point = _on_line(gait)
        network = point.network
        assert isinstance(network, Quadruped)
        beside = network.replace(alpha=network.alpha + OFF, beta=network.beta + OFF)
        start = getattr(network, free.split('=')[0])
        near = hopf(beside, free, gait, start - 4.0 * OFF, start + 4.0 * OFF)
        speed = near.normal_form.k1.real
        yield Citation(AUTHORS, 'Theorem 4.1').holds(
            f'{gait}: a branch of Hopf points leaves the line of the proof, at nonzero speed',
            abs(speed) > NONZERO,
            note=f'at alpha = beta = {beside.alpha:.4f}: {free} = {near.value:.4f}, speed '
                 f'{speed:.3f}')


def jump() -> Iterator[ReproducedRow | Picture]:
    """Theorem 4.1 for the jump, 'done in a similar way'."""
    nu, point = stand_sample(UNCOUPLED).trace('L_00').real, _on_line('jump')
    at = Citation(AUTHORS, 'Theorem 4.1')
    yield at.formula('jump: gamma at the Hopf point, gamma=delta=-alpha=-beta', '-nu_0/2',
                     -nu / 2.0, point.value, note='where sigma_10 = nu + 2 gamma vanishes')
    yield at.word('jump: gait of the class whose eigenvalues cross', 'jump', point.gait)
    yield at.formula('jump: speed at which the eigenvalues cross', '2', 2.0,
                     point.normal_form.k1.real, erratum=(13, 1.0))


def stable_points() -> Iterator[ReproducedRow | Picture]:
    """Theorem 4.3: the Hopf points of the proof are stable; the trot's by Lemma 5.8."""
    nu = stand_sample(UNCOUPLED).trace('L_00').real
    at = Citation(AUTHORS, 'Theorem 4.3')
    # alpha = gamma = nu_0/8, so that -(alpha + gamma) = -nu_0/4.
    eighth = nu / 8.0
    trot = hopf(Quadruped(eighth, eighth, eighth, eighth), 'xi=eta', 'trot', -nu / 4.0 - 0.05,
                -nu / 4.0 + 0.05)
    yield at.formula('trot: xi at the Hopf point, alpha = gamma = nu_0/8', '-nu_0/4', -nu / 4.0,
                     trot.value)
    yield Citation(AUTHORS, 'Lemma 5.8').holds(
        'trot: alpha_0 < 0, gamma_0 < 0 and xi_0 > alpha_0/2 there',
        eighth < 0.0 and trot.value > eighth / 2.0)
    for gait, point in (('pace', _on_line('pace')), ('bound', _on_line('bound')),
                        ('trot', trot)):
        yield at.word(f'{gait}: Hopf bifurcation at the point of the proof', 'stable',
                      'stable' if point.stable else 'unstable',
                      note=f'leading other eigenvalue {point.leading_other:.4f}')


def near_equal() -> Iterator[ReproducedRow | Picture]:
    """Theorem 4.2 where alpha and beta, gamma and delta differ a little."""
    for clause, gait, alpha, sign, (low, high), stable in THEOREM:
        if not stable or (gait, alpha) == FAILING:
            continue
        first = hopf(Quadruped(alpha, sign * alpha, 0.0, 0.0), 'gamma=delta', gait, low, high)
        beta, delta = sign * alpha + SMALL[0], first.value + SMALL[1]
        point = hopf(Quadruped(alpha, beta, 0.0, delta), 'gamma', gait, first.value - 0.05,
                     first.value + 0.05)
        yield Citation(AUTHORS, f'Theorem 4.2 ({clause})').word(
            f'remains valid near: Hopf bifurcation to the {gait}, alpha {alpha:g}, beta '
            f'{beta:.4f}, gamma {point.value:.4f}, delta {delta:.4f}', 'stable',
            'stable' if point.stable else 'unstable',
            note=f'alpha + beta {alpha + beta:+.3f}, gamma + delta {point.value + delta:+.3f}')


def necessary_and_sufficient() -> Iterator[ReproducedRow | Picture]:
    """Theorem 4.2 at all Hopf points with gamma = delta for some alpha = beta, or -beta."""
    points = {mirror: [(alpha, point) for alpha in ALPHAS for point in hopf_points(
        Quadruped(alpha, mirror * alpha, 0.0, 0.0), 'gamma=delta', *GAMMAS)]
        for mirror in (1, -1)}
    for gait, (mirror, along, across) in SIGNS.items():
        found = [(along * alpha >= 0.0 and across * point.value > 0.0, point.stable)
                 for alpha, point in points[mirror] if point.gait == gait
                 # 'We always refer to the eigenvalue with greatest real part' (section 5.3).
                 and point.block.roots(2).real.max() < ON_AXIS]
        otherwise = sum(met != stable for met, stable in found)
        yield Citation(AUTHORS, 'Theorem 4.2').holds(
            f'{gait}: the conditions are necessary and sufficient at equal couplings',
            bool(found) and not otherwise, erratum=23 if mirror < 0 else None,
            note=f'{len(found)} Hopf points, {sum(stable for _, stable in found)} of them '
                 f'stable, {otherwise} otherwise than by the conditions')

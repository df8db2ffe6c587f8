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

"""Hopf points against the whole linearisation, exact orbits beyond onset, and simulation."""

from functools import cache

from cpg_ros.analysis.papers.buono_hopf import theorem_verdict
from cpg_ros.dynamics import hopf
from cpg_ros.dynamics.arclength import crossings
from cpg_ros.dynamics.equilibrium import equilibrium, NoEquilibrium
from cpg_ros.dynamics.floquet import multipliers
from cpg_ros.dynamics.hopf import hopf_points
from cpg_ros.dynamics.integration.simulate import simulate
from cpg_ros.dynamics.isotypic import everywhere
from cpg_ros.dynamics.mesh.solve import from_path
from cpg_ros.networks.library.biped import Biped
from cpg_ros.networks.library.quadruped import Quadruped
from cpg_ros.networks.network import ParameterLine
from depth import in_depth, spread
import numpy as np
import pytest

WALK = Biped.symmetric(0.229, 0.254, 0.390, -0.681, 0.489)
PACE, JUMP = Quadruped(0.3, 0.3, -0.32, -0.32), Quadruped(0.01, -0.01, 0.2, 0.2)
LINES = [(PACE, 'alpha=beta', -1.0, 0.6), (JUMP, 'gamma=delta', -1.3, 0.3),
         (Quadruped(0.2, 0.1, -0.1, 0.15, 0.1, -0.2), 'alpha=-beta', -0.8, 0.8),
         (WALK, 'current', 0.12, 0.6),
         (Biped.symmetric(0.29, 0.394, -0.2, 0.1, 0.15), 'w_a', -1.0, 1.0)]
EVERY = pytest.mark.parametrize('line', spread(range(len(LINES)), 2))


@cache
def found(line):
    network, text, low, high = LINES[line]
    return hopf_points(network, ParameterLine.parse(text, type(network)), low, high)


def spectrum(point, value):
    network = point.line.at(point.network, value)
    return np.linalg.eigvals(network.jacobian(everywhere(network, equilibrium(network))))


def exact(point, mu):
    """Return the orbit at a distance mu of the parameter, on the side where the orbits lie."""
    value = point.value + point.normal_form.side * mu
    return value, from_path(point.line.at(point.network, value), point.block.symmetry,
                            lambda theta: point.path(value, theta), point.period(value))


def first_harmonic(orbit):
    theta = np.arange(512) / 512
    return 2.0 * abs(np.exp(-2j * np.pi * theta) @ orbit.waveform(theta)) / 512


@EVERY
def test_points_lie_where_the_whole_linearisation_crosses(line):
    points = found(line)
    assert points
    for point in points:
        values = spectrum(point, point.value)
        assert min(abs(values - 1j * point.omega)) < 1e-9
        rest = np.delete(values, [int(np.abs(values - root).argmin())
                                  for root in (1j * point.omega, -1j * point.omega)])
        assert point.unstable_roots == (rest.real > 1e-7).sum()
        assert point.simple == (np.abs(rest.real) > 1e-7).all()
        # Outside the gait's fixed-point space, which the linearisation keeps apart.
        basis = point.network.symmetry(point.gait).basis
        outside = np.eye(point.network.components) - basis.T @ basis
        whole = point.network.jacobian(point.state)
        transverse = np.linalg.eigvals(outside @ whole @ outside)
        assert point.unstable_transverse_roots == (transverse.real > 1e-7).sum()
        # How fast the pair crosses, by differences of the whole spectrum.
        ahead, behind = (spectrum(point, point.value + side * 1e-5) for side in (1, -1))
        moved = [near[np.abs(near - 1j * point.omega - side * 1e-5 * point.normal_form.k1)
                      .argmin()] for near, side in ((ahead, 1), (behind, -1))]
        assert abs((moved[0] - moved[1]) / 2e-5 - point.normal_form.k1) < 1e-5 * (
            1.0 + abs(point.normal_form.k1)**2)


@EVERY
def test_no_crossing_is_missed(line):
    # Between the points the number of eigenvalues to the right changes by real ones only.
    network, text, low, high = LINES[line]
    points, along = found(line), ParameterLine.parse(text, type(network))
    grid = np.linspace(low, high, 161)
    counts = []
    for value in grid:
        there = along.at(network, value)
        values = np.linalg.eigvals(there.jacobian(everywhere(there, equilibrium(there))))
        # A real eigenvalue changes the sign of the determinant.
        counts.append(((values.real > 0).sum(), np.sign(np.prod(values).real)))
    for k in range(len(grid) - 1):
        inside = sum(2 * point.direction for point in points
                     if grid[k] <= point.value < grid[k + 1])
        change = counts[k + 1][0] - counts[k][0]
        assert change == inside or (counts[k][1] != counts[k + 1][1]
                                    and abs(change - inside) == 1)


@EVERY
def test_normal_form_predicts_the_exact_orbits(line):
    for point in found(line):
        # As far from onset as makes the amplitude 0.01, and half as far.
        far = 1e-4 / point.amplitude(point.value + point.normal_form.side)**2
        sizes, turns = [], []
        for mu in (far, far / 2.0):
            value, orbit = exact(point, mu)
            sizes.append(first_harmonic(orbit) / point.amplitude(value) - 1.0)
            turns.append(orbit.period / point.period(value) - 1.0)
        # Errors of first order in the amplitude, of second order in the period.
        assert abs(sizes[1]) < 4e-3 and sizes[1] / sizes[0] == pytest.approx(0.5, abs=0.03)
        assert turns[1] / turns[0] == pytest.approx(0.25, abs=0.03)
        shift = orbit.period * point.omega / (2.0 * np.pi) - 1.0
        assert abs(turns[1]) < 0.03 * abs(shift)
        with pytest.raises(ValueError, match='no orbit'):
            point.amplitude(point.value - point.normal_form.side * 1e-3)


@EVERY
def test_stability_of_exact_orbits_is_that_of_the_normal_form(line):
    for point in found(line):
        if not point.stable:
            continue
        side = point.normal_form.side
        value, orbit = exact(point, 1e-4 / point.amplitude(point.value + side)**2)
        mine = multipliers(orbit)
        leading = mine.leading
        assert (leading < 1.0) == point.supercritical
        # The radius obeys r' = k1 mu r + k2 r^3: at the orbit disturbances grow by 2 k2 r^2.
        square = point.normal_form.radius(value - point.value)**2
        growth = np.log(leading) / orbit.period
        assert growth == pytest.approx(2.0 * point.normal_form.k2.real * square, rel=0.03)


@pytest.mark.parametrize('line', [0, 3])
def test_oscillations_grow_in_simulation_as_the_pair_says(line):
    # Started along the critical eigenvector, a hundredth from onset on either side.
    point = next(point for point in found(line) if point.stable)
    for mu in (0.01, -0.01):
        network = point.line.at(point.network, point.value + mu)
        rest = everywhere(network, equilibrium(network))
        swing = 1e-6 * np.kron(point.vector, point.block.vector).real
        run = simulate(network, rest + swing, 60.0, network.step, progress=False)
        left = point.block.vector.conj() / network.cells
        v = (run.x[:, :network.cells] - rest[:network.cells]) @ left
        peaks = np.flatnonzero((v.real[1:-1] > v.real[:-2]) & (v.real[1:-1] >= v.real[2:])) + 1
        rate = np.diff(np.log(v.real[peaks[[1, -1]]])) / np.diff(run.t[peaks[[1, -1]]])
        assert rate[0] == pytest.approx(point.normal_form.k1.real * mu, rel=0.12)


def planar(point):
    """Re k2 by Guckenheimer & Holmes, section 3.4, from a polynomial fit to an uncoupled cell.

    With ``x = stand + Re(q) x1 - Im(q) x2`` and z = (x1 + i x2)/2, their a is Re k2 / 4.
    """
    frame = np.array([point.vector.real, -point.vector.imag]).T
    radius = 0.04 / np.abs(frame).max()
    x, y = np.meshgrid(*[radius * np.cos(np.pi * (np.arange(20) + 0.5) / 20)] * 2)
    states = point.rest + np.stack([x, y], axis=-1) @ frame.T
    rates = point.network.rates(everywhere(point.network, states))[..., ::point.network.cells]
    rates = (rates @ np.linalg.inv(frame).T).reshape(-1, 2)
    powers = [(i, j) for i in range(12) for j in range(12 - i)]
    columns = np.array([(x / radius)**i * (y / radius)**j for i, j in powers]).reshape(
        len(powers), -1).T
    fit = np.linalg.lstsq(columns, rates, rcond=None)[0]

    def d(i, j):
        scale = [1.0, 1.0, 2.0, 6.0]
        return fit[powers.index((i, j))] * scale[i] * scale[j] / radius**(i + j)

    (fxx, gxx), (fxy, gxy), (fyy, gyy) = d(2, 0), d(1, 1), d(0, 2)
    omega = d(1, 0)[1]
    assert abs(abs(omega) - point.omega) < 1e-6
    third = d(3, 0)[0] + d(1, 2)[0] + d(2, 1)[1] + d(0, 3)[1]
    return 4.0 * (third / 16.0 + (fxy * (fxx + fyy) - gxy * (gxx + gyy) - fxx * gxx
                                  + fyy * gyy) / (16.0 * omega))


def test_lyapunov_coefficient_of_a_single_cell():
    # Hopping cells and pronking ones are all alike: a planar system.
    hop, = (point for point in found(3) if point.gait == 'two_legged_hop')
    pronk, = (point for point in found(0) if point.gait == 'pronk')
    for point in (hop, pronk):
        assert point.lyapunov * point.omega == pytest.approx(planar(point), rel=1e-5)
        assert np.linalg.norm(point.vector) == pytest.approx(point.network.cells**-0.5)
    assert hop.lyapunov > 0.0 > pronk.lyapunov


@pytest.mark.parametrize(('network', 'gait', 'text', 'distance'), [
    (PACE, 'pace', 'alpha=beta', 0.0157), (PACE, 'pace', 'gamma=delta', 0.0276),
    (Quadruped(-0.32, -0.32, 0.3, 0.3), 'bound', 'alpha=beta', 0.0276),
    (Quadruped(-0.15, -0.15, -0.16, -0.16, 0.31, 0.31), 'trot', 'xi=eta', 7.3e-5)])
def test_table_12(network, gait, text, distance):
    # Printed points are near exact ones, stable in the paper's sense; trot as in the erratum.
    along = ParameterLine.parse(text, Quadruped)
    value = along.value(network)
    point, = (point for point in hopf_points(network, along, value - 0.04, value + 0.04)
              if point.gait == gait)
    assert point.value - value == pytest.approx(distance, rel=0.01)
    assert point.stable and not point.supercritical
    verdict = theorem_verdict(point.network, gait)
    assert verdict.stable is (None if gait == 'trot' else True)


def test_hopf_points_where_the_stand_does_not_move():
    # Proof of theorem 4.3: with gamma = -alpha pace and bound branch off at alpha = -+ nu0/4.
    along = ParameterLine.parse('alpha=beta=-gamma=-delta', Quadruped)
    bound, pace = hopf_points(Quadruped(0, 0, 0, 0), along, -0.5, 0.5)
    assert (bound.gait, pace.gait) == ('bound', 'pace')
    assert pace.value == pytest.approx(1.240676187 / 4.0, abs=1e-9)
    assert bound.value == pytest.approx(-pace.value, abs=1e-12)
    assert pace.normal_form.k1 == pytest.approx(2.0, abs=1e-9)


@pytest.mark.parametrize('sign', ['', '-'])
@pytest.mark.parametrize('alpha', [-0.45, 0.01, *in_depth(-0.05, 0.2)])
def test_theorem_4_2_against_the_roots(sign, alpha):
    network = Quadruped(alpha, float(f'{sign}1') * alpha, 0.0, 0.0)
    along = ParameterLine.parse('gamma=delta', Quadruped)
    judged = 0
    for point in hopf_points(network, along, -1.3, 0.4):
        verdict = theorem_verdict(point.network, point.gait)
        if verdict.applies and not verdict.overlooked:
            assert verdict.stable == point.stable, str(verdict)
            judged += 1
        assert verdict.applies == ((point.gait in ('jump', 'walk')) == bool(sign))
    assert judged


@pytest.mark.parametrize(('alpha', 'gait', 'gamma', 'words'), [
    (0.1, 'walk', -0.8306, 'the real blocks have complex eigenvalues'),
    (0.01, 'jump', 0.1276, 'the critical pair is the rightmost of its class')])
def test_theorem_4_2_fails_where_its_proof_does(alpha, gait, gamma, words):
    along = ParameterLine.parse('gamma=delta', Quadruped)
    points = hopf_points(Quadruped(alpha, -alpha, 0.0, 0.0), along, gamma - 0.01,
                         gamma + 0.01)
    point = min(points, key=lambda point: (point.gait != gait, abs(point.value - gamma)))
    verdict = theorem_verdict(point.network, gait)
    assert verdict.stable and not point.stable and words in str(verdict)


def test_theorem_4_2_names_what_it_lacks():
    assert str(theorem_verdict(Quadruped(0.3, 0.3, -0.32, -0.32), 'pace')).endswith(
        'the bifurcation to pace is stable, as alpha > 0 and gamma < 0 holds')
    assert theorem_verdict(Quadruped(0.3, 0.2, -0.3, -0.2, 0.1), 'walk').unmet == (
        'delta = gamma', 'xi = 0', 'beta = -alpha')
    with pytest.raises(ValueError, match="'canter' is not one of"):
        theorem_verdict(PACE, 'canter')


def test_crossings_come_in_pairs_between_points_of_the_grid():
    grid = np.linspace(-1.0, 1.0, 21)
    assert crossings(lambda x: (x - 0.031)**2 - 1e-4, grid) == pytest.approx([0.021, 0.041])
    assert crossings(lambda x: (x - 0.031)**2 + 1e-4, grid) == []
    assert crossings(lambda x: np.nan if x < 0.0 else x - 0.5, grid) == pytest.approx([0.5])


@pytest.mark.parametrize(('zero', 'found'), [(0.52, [0.52]), (0.61, [0.61]), (0.57, [])])
def test_a_crossing_beside_a_gap_between_points_of_the_grid_is_found(zero, found):
    """The gap lies where the method looks first: in the middle."""
    assert crossings(lambda x: np.nan if 0.53 < x < 0.6 else x - zero,
                     np.array([0.0, 0.5, 0.63, 1.0])) == pytest.approx(found)


def test_refusals(monkeypatch):
    monkeypatch.setattr(hopf, 'GRID_SIZE', 5)
    along = ParameterLine.parse('gamma=delta', Quadruped)
    with pytest.raises(ValueError, match='low 1 must be less than high 0'):
        hopf_points(PACE, along, 1, 0)
    with pytest.raises(NoEquilibrium, match='fold'):
        hopf_points(PACE, along, 0.6, 0.7)

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

"""Hopf points, roots and normal forms against a discretised delay operator and exact orbits."""

from dataclasses import replace

from cpg_ros.analysis.papers.liu_zhang import published_normal_form
from cpg_ros.dynamics.equilibrium import equilibrium
from cpg_ros.dynamics.hopf import first_hopf, hopf_points
from cpg_ros.dynamics.integration.simulate import simulate
from cpg_ros.dynamics.isotypic import blocks
from cpg_ros.dynamics.solve_orbit import solve_orbit
from cpg_ros.networks.library.delayed import Delayed, PRESETS
from cpg_ros.networks.network import ParameterLine
from depth import examples
from hypothesis import assume, given
from hypothesis import strategies as st
import numpy as np
import pytest

EXAMPLE_1, EXAMPLE_2 = Delayed(-4.5, 1.0, 6.5, -2.0, 0.4), Delayed(-3.0, 0.1, 4.0, 1.0, 0.7)
GOAT_TROT, GOAT_WALK = Delayed(-2.0, 1.0, 6.43, -2.0, 0.25), Delayed(-2.0, 1.0, 6.5, -2.0, 0.245)
#: docs/numbers_and_errata.md, section Hopf points of the delayed network: network, gait, omega,
#: tau, k1 and k2, k1 and k2 as published.
VERIFIED = [
    (EXAMPLE_1, 'walk', 7.4772, 0.2861, 1.8135, -0.9177, 0.4179, -0.2349),
    (EXAMPLE_1, 'trot', 6.3246, 0.2852, 2.1557, -0.9610, 0.6486, -0.2544),
    (EXAMPLE_2, 'pace', 3.5199, 0.5869, 0.8319, -0.9142, 0.5957, -0.5951),
    (GOAT_TROT, 'trot', 6.3518, 0.2227, 3.4488, -0.9010, 1.0000, -0.2227),
    (GOAT_WALK, 'walk', 8.4226, 0.2048, 3.4819, -0.8683, 0.8232, -0.1867)]
TAU = ParameterLine(('tau',), (1.0,))
MODES = [(j, k) for j in range(4) for k in (0, 1)]
rates = st.floats(-4.0, 4.0)
strengths = st.floats(0.5, 8.0) | st.floats(-8.0, -0.5)
networks = st.builds(Delayed, st.floats(-6.0, 1.0), rates, strengths, rates,
                     st.floats(0.05, 1.5))


def generator(network, points=56):
    """Return the infinitesimal generator of the linearised network, on Chebyshev points.

    Eight components at each point, that of time 0 first (Breda, Maset & Vermiglio 2005). Modes
    are not used.
    """
    k = np.arange(points + 1)
    x = np.cos(np.pi * k / points)
    weights = np.where((k == 0) | (k == points), 2.0, 1.0) * (-1.0) ** k
    matrix = np.outer(weights, 1.0 / weights) / (x[:, None] - x + np.eye(points + 1))
    matrix -= np.diag(matrix.sum(axis=1))
    unit = np.eye(8)
    whole = np.kron(2.0 / network.tau * matrix, unit)
    whole[:8] = 0.0
    whole[:8, :8] = ((network.a + network.b) * unit
                     + network.d * unit[[6, 7, 0, 1, 2, 3, 4, 5]])
    whole[:8, -8:] += network.c * unit[[1, 0, 3, 2, 5, 4, 7, 6]]
    return whole


def classes(network):
    """Return the blocks of the linearisation at rest, by mode."""
    return {block.mode: block for block in blocks(network, equilibrium(network))}


def rightmost(network):
    """Roots of the whole network by the discretised operator, by falling real part."""
    roots = np.linalg.eigvals(generator(network))
    return roots[np.argsort(-roots.real)]


@pytest.mark.parametrize(('network', 'gait', 'omega', 'tau', 'k1', 'k2', 'p1', 'p2'), VERIFIED)
def test_verified_figures(network, gait, omega, tau, k1, k2, p1, p2):
    point = first_hopf(network, gait)
    printed = published_normal_form(point)
    assert point.gait == gait
    found = (point.omega, point.value, point.in_delays.k1.real, point.in_delays.k2.real,
             printed.k1.real, printed.k2.real)
    assert found == pytest.approx((omega, tau, k1, k2, p1, p2), abs=6e-5)
    assert point.direction == 1 and point.supercritical and point.normal_form.side == 1
    # None of them is stable in the full network (erratum 3).
    assert point.unstable_transverse_roots > 0


@pytest.mark.parametrize(('network', 'gait'), [row[:2] for row in VERIFIED[:3]])
def test_the_normal_form_predicts_the_orbit_and_the_published_one_does_not(network, gait):
    point = first_hopf(network, gait)
    theta = np.arange(256) / 256
    late = []
    for mu in (5e-4, 1e-3):
        orbit = solve_orbit(replace(network, tau=point.value + mu), gait)
        first = 2.0 * abs(np.mean(orbit.waveform(theta) * np.exp(-2j * np.pi * theta)))
        late.append(abs(point.period(point.value + mu) - orbit.period))
        if mu == 5e-4:
            assert point.amplitude(point.value + mu) == pytest.approx(first, rel=1e-3)
            assert 0.04 < abs(2.0 * published_normal_form(point).radius(mu) / first - 1.0) < 0.07
    # The period's error is of second order.
    assert late[1] < 1e-5 and late[1] / late[0] == pytest.approx(4.0, rel=0.05)
    with pytest.raises(ValueError, match='no orbit'):
        point.amplitude(point.value - 1e-3)


@examples(40)
@given(networks)
def test_lambert_roots_are_those_of_the_delay_operator(network):
    ours = np.concatenate([block.roots(9) for block in classes(network).values()])
    # To the right of this line we have them all, and the discretisation has them exactly.
    edge = max(max(block.roots(9)[-1].real for block in classes(network).values()),
               -3.0 / network.tau)
    theirs = rightmost(network)
    theirs = theirs[(theirs.real > edge + 1e-3) & (np.abs(theirs.imag) < 30.0 / network.tau)]
    for root in theirs:
        assert np.abs(ours - root).min() < 1e-6 * max(1.0, abs(root))
    for block in classes(network).values():
        root = block.leading
        assert root == pytest.approx(block.roots(3)[0])
        if root.real > edge + 1e-2 and abs(root.imag) < 25.0 / network.tau:
            assert np.abs(theirs - root).min() < 1e-6 * max(1.0, abs(root))


@examples(40)
@given(networks, st.floats(0.3, 1.5))
def test_no_critical_delay_is_missed(network, longest):
    # Every point takes one pair of roots across; between them none may cross.
    points = hopf_points(network, TAU, 0.0, longest)
    taus = [point.value for point in points]
    assert taus == sorted(taus) and all(0.0 < tau <= longest for tau in taus)
    # Two that all but coincide, or one at the very end, cannot be told by counting.
    assume(np.abs(np.diff([*taus, longest])).min(initial=1.0) > 1e-4)
    unit = np.eye(8)
    undelayed = ((network.a + network.b) * unit + network.d * unit[[6, 7, 0, 1, 2, 3, 4, 5]]
                 + network.c * unit[[1, 0, 3, 2, 5, 4, 7, 6]])
    roots = np.linalg.eigvals(undelayed)
    assume(np.abs(roots.real).min() > 1e-3)
    now = rightmost(replace(network, tau=longest))
    assume(np.abs(now.real).min() > 1e-4)
    crossed = 2 * sum(point.direction for point in points)
    assert int(np.sum(now.real > 0.0)) == int(np.sum(roots.real > 0.0)) + crossed


@examples(30)
@given(networks, st.integers(0, 20))
def test_a_hopf_point_by_the_delay_operator(network, pick):
    points = hopf_points(network, TAU, 0.0, 1.5)
    assume(points)
    point = points[pick % len(points)]
    assert replace(network, tau=point.value) == point.network
    roots = rightmost(point.network)
    gap = np.sort(np.abs(roots - 1j * point.omega))
    assert gap[0] < 1e-6 * max(1.0, point.omega)
    # k1 is the speed of the root in the paper's time: d(tau lambda)/d tau.
    width = 1e-4 * point.value
    assume(gap[1] > 0.3)
    moved = []
    for tau in (point.value - width, point.value + width):
        near = rightmost(replace(network, tau=tau))
        moved.append(tau * near[np.abs(near - 1j * point.omega).argmin()])
    k1 = (moved[1] - moved[0]) / (2.0 * width)
    assert k1 == pytest.approx(point.in_delays.k1, rel=1e-4, abs=1e-4)
    # Others with positive real part, in the class (its projector) and outside.
    others = np.array(
        [root for root in roots if abs(abs(root.imag) - point.omega) > 1e-5
         or abs(root.real) > 1e-5])
    assume(np.abs(others.real).min() > 1e-4)
    assert point.unstable_roots == int(np.sum(others.real > 0.0))
    basis = point.block.symmetry.basis
    outside = np.eye(8) - basis.T @ basis
    columns = np.linalg.svd(outside)[0][:, :8 - len(basis)]
    size = generator(point.network).shape[0] // 8
    reduced = (np.kron(np.eye(size), columns.T) @ generator(point.network)
               @ np.kron(np.eye(size), columns))
    transverse = np.linalg.eigvals(reduced)
    transverse = transverse[(np.abs(np.abs(transverse.imag) - point.omega) > 1e-5)
                            | (np.abs(transverse.real) > 1e-5)]
    assert point.unstable_transverse_roots == int(np.sum(transverse.real > 0.0))


@pytest.mark.parametrize(('network', 'gait'), [row[:2] for row in VERIFIED[:3]])
def test_a_simulation_crosses_at_the_critical_delay(network, gait):
    # Held in its class, a small wave decays below the critical delay and grows above, as fast
    # as the leading root says.
    mode, point = network.symmetry(gait), first_hopf(network, gait)
    critical = point.value
    for tau, sign in ((0.97 * critical, -1.0), (1.03 * critical, 1.0)):
        here = replace(network, tau=tau)
        run = simulate(here, 1e-6 * mode.basis[0], 20.0, tau / 60, lock=(8.0, mode))
        size = np.log(np.linalg.norm(run.x, axis=1))
        windows = [size[(run.t > t) & (run.t <= t + 5.0)].max() for t in (8.0, 15.0)]
        block = classes(here)[point.mode]
        growth = (windows[1] - windows[0]) / 7.0
        assert np.sign(growth) == sign
        assert growth == pytest.approx(block.leading.real, abs=0.03)


@examples(60)
@given(st.builds(Delayed, st.floats(-200.0, 20.0), st.floats(-20.0, 20.0),
                 strengths, st.floats(-20.0, 20.0), st.floats(0.0025, 50.0)),
       st.sampled_from(MODES))
def test_roots_hold_however_large_the_exponents(network, mode):
    block = classes(network)[mode]
    a, b, roots = block.now[0, 0], block.past[0, 0], block.roots(5)
    assert np.isfinite(roots).all() and (np.diff(roots.real) <= 1e-9).all()
    # lambda - A = B exp(-lambda tau), in logarithms because either side may leave the range.
    with np.errstate(divide='ignore'):
        gap = np.log(roots - a) - np.log(complex(b)) + roots * network.tau
    turns = gap.imag / (2.0 * np.pi)
    scale = max(1.0, np.abs(roots * network.tau).max())
    apart = np.abs(roots - a) > 1e-5 * np.abs(a)
    assert np.abs(gap.real[apart]).max(initial=0.0) < 1e-7 * scale
    assert np.abs(turns - np.round(turns))[apart].max(initial=0.0) < 1e-7 * scale
    small = np.log(abs(b)) - roots[~apart].real * network.tau
    assert (small < np.log(2e-5 * abs(a) + 1e-300)).all()


def test_both_waves_of_a_walk_have_their_points():
    points = [point for point in hopf_points(PRESETS['walk'].network, TAU, 0.0, 0.7)
              if point.gait == 'walk']
    assert [(point.mode, point.wave) for point in points] == [
        ((3, 1), 'LH leads LF'), ((1, 1), 'LF leads LH')]
    assert points[1].omega == pytest.approx(points[0].omega - 4.0)

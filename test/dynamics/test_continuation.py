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

"""Branches of orbits against closed forms, eigenvalues, simulation and scipy's solvers."""

from dataclasses import replace
from functools import cache
import math

from cpg_ros.dynamics.arclength import NoOrbit
from cpg_ros.dynamics.continuation import continue_from_hopf, continue_orbit
from cpg_ros.dynamics.floquet import multipliers
from cpg_ros.dynamics.fourier import solve
from cpg_ros.dynamics.hopf import hopf_at, HopfPoint
from cpg_ros.dynamics.integration.simulate import simulate
from cpg_ros.dynamics.isotypic import block_of, Expansion
from cpg_ros.dynamics.mesh.solve import from_path
from cpg_ros.dynamics.solve_orbit import solve_orbit, solve_preset
from cpg_ros.dynamics.stability import stability
from cpg_ros.networks.library.biped import Biped
from cpg_ros.networks.library.delayed import Delayed
from cpg_ros.networks.library.quadruped import Quadruped
from cpg_ros.networks.network import ParameterLine
from cpg_ros.networks.registry import PRESETS
from cpg_ros.networks.symmetry import GAITS
from depth import examples
from hypothesis import given
from hypothesis import strategies as st
from modes import class_of, Mode
import numpy as np
import pytest
from scipy.integrate import solve_bvp, solve_ivp
from scipy.optimize import brentq, fsolve

EXAMPLE = Delayed(-4.5, 1.0, 6.5, -2.0, 0.4)
TAU = ParameterLine.parse('tau', Delayed)
SWAP = [1, 0, 3, 2, 5, 4, 7, 6]
# Subcritical Hopf points: parameters, mode, sign of the root and n (docs/theory.md, section Roots
# and Hopf points).
SUBCRITICAL = {'pace': (Delayed(-3.4, 3.9, -6.2, 5.4, 1.0), Mode(0, 1), 1, 0),
               'trot': (Delayed(-2.6, 0.4, 7.5, -9.4, 1.0), Mode(2, 1), 1, 1),
               'walk': (Delayed(-3.2, 4.8, 7.6, -7.0, 1.0), Mode(3, 1), 1, 0)}


def hopf(network, mode, sign, n):
    """Return a Hopf point by docs/theory.md: omega and tau, and k1 and k2 of its normal form."""
    j, k = class_of(mode)
    turn = 1j ** -j
    a = network.a + network.b + network.d * turn
    b = network.c * (-1) ** k
    omega = a.imag + sign * math.sqrt(network.c**2 - a.real**2)
    angle = -np.angle((1j * omega - a) / b) % (2.0 * math.pi)
    tau = (angle + 2.0 * math.pi * n) / omega
    late = b * np.exp(-1j * omega * tau)
    q = 1.0 + tau * late
    return (omega, tau, (1j * omega / q).real,
            -(tau * (network.b + network.d * turn + late) / q).real)


def hopf_point(network, mode, omega, tau):
    network = replace(network, tau=tau)
    block = block_of(Expansion(network, np.zeros(1)), mode)
    return HopfPoint(network, TAU, tau, block, omega, np.zeros(1))


def gap_of_the_delay_equations(orbit):
    """Largest residual of eq. 1.1, written out, between the nodes."""
    times = np.random.default_rng(2).uniform(-2.0, 2.0, 150) * orbit.period
    a, b, c, d, tau = orbit.network.as_dict().values()
    x, past = orbit(times), orbit(times - tau)
    right = a * x + b * np.tanh(x) + d * np.tanh(np.roll(x, 2, 1)) + c * np.tanh(past[:, SWAP])
    return np.abs(orbit.derivative(times) - right).max()


def gap_after_a_period(orbit):
    """How far the whole network, started on the orbit, is from there a period later."""
    start = orbit(np.array(0.0))
    return np.abs(solve_ivp(lambda t, x: orbit.network.rates(x), (0.0, orbit.period), start,
                            'DOP853', rtol=1e-11, atol=1e-12).y[:, -1] - start).max()


def check_in_order(branch):
    """Neighbours are near, folds are where the values turn, and cell 1 peaks at phase zero."""
    signs = np.sign(np.diff(branch.values))
    turning = 1 + np.flatnonzero(signs[1:] * signs[:-1] < 0.0)
    assert list(turning) == list(branch.fold_indices)
    assert np.abs(np.diff(branch.amplitudes)).max() < 0.5 * max(1.0, branch.amplitudes.max())
    for point in branch.points:
        orbit = point.orbit
        assert branch.along.value(orbit.network) == point.value
        top = orbit.waveform(np.linspace(0.0, 1.0, 2001)).max()
        assert top <= float(orbit.waveform(np.array(0.0))) + 1e-7 * point.amplitude
    rates = np.array([point.curve_point.rate for point in branch.points])
    rising = np.diff(branch.values) > 0.0
    assert (rates[1:][rising] > -1e-8).all() and (rates[:-1][~rising] < 1e-8).all()
    for fold in branch.folds:
        assert abs(fold.curve_point.rate) < 1e-8


@cache
def subcritical(name):
    (network, mode, _, _), (omega, tau, _, _) = SUBCRITICAL[name], hopf(*SUBCRITICAL[name])
    return continue_from_hopf(hopf_point(network, mode, omega, tau), TAU, 0.5 * tau, 1.2 * tau)


@cache
def pace():
    """Show that the quadruped's pace coexists with rest: its Hopf point must be subcritical."""
    return continue_orbit(solve_preset(PRESETS['quadruped']['pace']),
                          ParameterLine.parse('alpha=beta', Quadruped), 0.0, 0.25)


@pytest.mark.parametrize('gait', ['trot', 'walk'])
def test_a_supercritical_branch_of_the_delayed_network(gait):
    mode = EXAMPLE.symmetry(gait)
    omega, tau, k1, k2 = hopf(EXAMPLE, mode, 1, 0)
    branch = continue_orbit(solve_orbit(EXAMPLE, gait), TAU, 0.1, 0.7)
    check_in_order(branch)
    assert [end.why for end in branch.ends] == ['rest', 'bound']
    assert branch.ends[0].value == pytest.approx(tau, abs=1e-9)
    assert branch.ends[0].period == pytest.approx(2.0 * np.pi / omega, rel=1e-9)
    assert branch.points[-1].value == branch.ends[1].value == 0.7 and not branch.folds
    assert (np.diff(branch.values) > 0.0).all()
    for point in branch.points[::3]:
        assert gap_of_the_delay_equations(point.orbit) < 1e-9
        there = solve_orbit(point.orbit.network, gait)
        assert point.orbit.period == pytest.approx(there.period, rel=1e-9)
        assert point.amplitude == pytest.approx(there.peak, abs=1e-8)
        assert np.allclose(point.orbit.d_period, there.d_period, 1e-5, 1e-8)
    # The same branch, begun where it begins.
    grown = continue_from_hopf(hopf_point(EXAMPLE, mode, omega, tau), TAU, 0.1, 0.7)
    assert grown.points[-1].orbit.period == pytest.approx(branch.periods[-1], rel=1e-11)
    slope = (grown.values[0] - tau) / grown.amplitudes[0]**2
    assert slope == pytest.approx(-k2 / (4.0 * k1), rel=5e-3)


@pytest.mark.parametrize('value', [0.32, 0.55])
def test_what_the_locked_network_settles_to_is_on_the_branch(value):
    branch = continue_orbit(solve_orbit(EXAMPLE, 'trot'), TAU, 0.3, 0.6, longest_step=0.5)
    (orbit,) = branch.at(value)
    run = simulate(replace(EXAMPLE, tau=value), lambda t: 0.6 * branch.points[5].orbit(t),
                   80.0, 0.0025, lock=(8.0, orbit.symmetry))
    x, rise = run.x[20_000:, 0], run.slopes[20_000:, 0]
    peaks = np.flatnonzero((rise[:-1] > 0.0) & (rise[1:] <= 0.0))
    times = run.t[peaks] + 0.0025 * rise[peaks] / (rise[peaks] - rise[peaks + 1])
    assert np.diff(times).mean() == pytest.approx(orbit.period, rel=1e-6)
    assert x.max() == pytest.approx(orbit.peak, abs=1e-5)


@pytest.mark.parametrize('name', SUBCRITICAL)
def test_a_subcritical_hopf_point_of_the_delayed_network_has_a_fold(name):
    omega, tau, k1, k2 = hopf(*SUBCRITICAL[name])
    assert k1 > 0.0 and k2 > 0.0
    branch = subcritical(name)
    check_in_order(branch)
    (fold,) = branch.folds
    assert branch.ends[1].why == 'bound' and branch.values[-1] == 1.2 * tau
    assert fold.value == branch.values.min() < tau
    # amplitude^2 is linear in mu at the Hopf point, with the slope of the normal form, ...
    network, mode, _, _ = SUBCRITICAL[name]
    near = continue_from_hopf(hopf_point(network, mode, omega, tau), TAU, 0.5 * tau, 1.2 * tau,
                              amplitude=4e-3, most=1).points[0]
    assert (near.value - tau) / near.amplitude**2 == pytest.approx(-k2 / (4.0 * k1), rel=1e-3)
    # ... and (amplitude - that of the fold)^2 in the distance from the fold.
    ahead = 1e-4 * (tau - fold.value) * np.array([1.0, 4.0])
    gaps = [np.subtract(*(one.peak for one in branch.at(fold.value + mu))) for mu in ahead]
    assert abs(gaps[1] / gaps[0]) == pytest.approx(2.0, rel=1e-3)
    # Between them are two orbits; below the fold is none, and on the far side of the Hopf one.
    for fraction in (0.02, 0.5):
        low, high = branch.at(fold.value + fraction * (tau - fold.value))
        assert low.network == high.network and low.peak < fold.amplitude < high.peak
        assert max(gap_of_the_delay_equations(orbit) for orbit in (low, high)) < 1e-9
    assert not branch.at(fold.value - 1e-9) and len(branch.at(1.1 * tau)) == 1


def test_a_branch_from_one_hopf_point_to_another():
    # The reverse wave leaves one and ends in another, both in closed form.
    network, mode = Delayed(-6.0, -0.5, 7.7, -8.6, 1.0), Mode(1, 1)
    omega, tau, k1, k2 = hopf(network, mode, -1, 0)
    assert k1 < 0.0 and k2 < 0.0
    branch = continue_from_hopf(hopf_point(network, mode, omega, tau), TAU, 0.01, 2.0)
    check_in_order(branch)
    other, first, _, _ = hopf(network, mode, 1, 0)
    assert [end.why for end in branch.ends] == ['rest', 'rest']
    assert branch.ends[1].value == pytest.approx(first, abs=1e-9)
    assert branch.ends[1].period == pytest.approx(2.0 * np.pi / other, rel=1e-9)
    assert max(gap_of_the_delay_equations(point.orbit) for point in branch.points) < 1e-9


@examples(12)
@given(st.floats(-5.0, -1.0), st.floats(0.0, 1.5), st.floats(-2.5, 2.5), st.floats(0.5, 4.0),
       st.sampled_from(sorted(GAITS)), st.sampled_from(['tau', 'c', 'b', 'a=d']))
def test_there_and_back(a, b, d, more, gait, text):
    d = a if text == 'a=d' else d
    sign = 1.0 if GAITS[gait] in ((0, 1), (2, 1), (1, 1)) else -1.0
    network = Delayed(a, b, sign * (abs(a + b) + abs(d) + more), d, 1.0)
    network = replace(network, tau=1.4 * hopf(network, network.symmetry(gait), 1, 0)[1])
    orbit, line = solve_orbit(network, gait), ParameterLine.parse(text, Delayed)
    value = line.value(network)
    there = continue_orbit(orbit, line, value - 0.1, value + 0.1, both=False, first_step=0.1)
    back = continue_orbit(there.points[-1].orbit, line, value, value + 0.1)
    again = back.points[0].orbit
    assert there.ends[0].why == 'start' and there.ends[1].why in ('bound', 'rest')
    assert again.network == network
    assert again.period == pytest.approx(orbit.period, rel=1e-10)
    theta = np.linspace(0.0, 1.0, 50)
    assert np.allclose(again.waveform(theta), orbit.waveform(theta), 0.0, 1e-9)


def stand_of_pace(value):
    """Stand of the quadruped at alpha = beta = value, and its pace's eigenvalue."""
    network = replace(PRESETS['quadruped']['pace'].network, alpha=value, beta=value)
    state = fsolve(network.rates, np.repeat([0.3, 0.5], 8), xtol=1e-13)
    odd = np.kron(np.eye(2), np.tile([1.0, -1.0], 4)).T.reshape(16, 2) / 8.0**0.5
    roots, vectors = np.linalg.eig(odd.T @ network.jacobian(state) @ odd)
    first = roots.imag.argmax()
    return network, state, roots[first], odd @ vectors[:, first]


def test_pace_has_a_fold_beside_its_subcritical_hopf_point():
    value = brentq(lambda value: stand_of_pace(value)[2].real, 0.2, 0.3, xtol=1e-14)
    network, state, root, vector = stand_of_pace(value)
    branch = pace()
    check_in_order(branch)
    (fold,) = branch.folds
    assert [end.why for end in branch.ends] == ['rest', 'bound']
    assert branch.ends[0].value == pytest.approx(value, abs=1e-8)
    assert branch.ends[0].period == pytest.approx(2.0 * np.pi / root.imag, rel=1e-8)
    point = hopf_at(network, branch.along, (0, 1), root.imag)
    assert point.state == pytest.approx(state, abs=1e-10)
    turned = point.eigenvector / point.eigenvector[0]
    assert turned == pytest.approx(vector / vector[0], abs=1e-8)
    grown = continue_from_hopf(point, branch.along, 0.0, 0.25)
    check_in_order(grown)
    assert grown.folds[0].value == pytest.approx(fold.value, rel=1e-9)
    assert grown.folds[0].orbit.period == pytest.approx(fold.orbit.period, rel=1e-7)
    slopes = (grown.values[:2] - value) / grown.amplitudes[:2]**2
    assert slopes[0] < 0.0 and slopes[0] == pytest.approx(slopes[1], rel=0.02)

    low, high = branch.at(0.15)
    assert low.levels[0, 0, 1] < fold.amplitude < high.levels[0, 0, 1]
    assert max(gap_after_a_period(orbit) for orbit in (low, high)) < 1e-7
    found = solve_orbit(high.network, 'pace')
    assert found.period == pytest.approx(high.period, rel=1e-9)
    # The multipliers pass 1 at the fold.
    leading = [multipliers(orbit).within.real.max() for orbit in (low, fold.orbit, high)]
    assert leading[0] > 1.0 > leading[2] and leading[1] == pytest.approx(1.0, abs=1e-5)
    reasons = [stability(orbit).reason for orbit in (low, fold.orbit, high)]
    assert 'grows' in reasons[0] and reasons[1].startswith('cannot tell') and not reasons[2]


def test_what_is_below_and_above_the_fold_of_pace():
    fold = pace().folds[0]
    starts = []
    for fraction, stays in ((0.98, False), (1.02, True)):
        network = replace(fold.orbit.network, alpha=fraction * fold.value,
                          beta=fraction * fold.value)
        run = simulate(network, fold.orbit(np.array(0.0)), 1500.0, 0.02,
                       lock=(1.0, fold.orbit.symmetry), every=10)
        starts.append(np.ptp(run.x[-600:, 0]) / 2.0)
        assert (starts[-1] > fold.amplitude) == stays
    assert starts[0] < 1e-3


def test_both_orbits_of_pace_are_those_of_solve_bvp():
    for orbit in pace().at(0.15):
        network, half = orbit.network, np.linspace(0.0, 0.5, 101)

        def rates(s, y, p, network=network):
            x = np.empty((y.shape[1], 16))
            for cell in range(8):
                x[:, cell], x[:, 8 + cell] = y[cell % 2], y[2 + cell % 2]
            return p[0] * network.rates(x)[:, [0, 1, 8, 9]].T

        def ends(left, right, p, rates=rates):
            # Half a cycle later left and right have changed places.
            return np.append(right - left[[1, 0, 3, 2]], rates(0.0, left[:, None], p)[0])

        guess = 1.01 * orbit(half * orbit.period)[:, [0, 1, 8, 9]].T
        found = solve_bvp(rates, ends, 2.0 * half, guess, p=[0.51 * orbit.period], tol=1e-9,
                          max_nodes=20_000)
        assert found.success and 2.0 * found.p[0] == pytest.approx(orbit.period, rel=1e-8)
        assert 0.5 * np.ptp(found.y[:2]) == pytest.approx(orbit.levels[0, 0, 1], rel=1e-4)


def test_a_branch_ends_at_an_orbit_of_more_symmetry():
    # The biped's walk ends where the hop doubles its period: a multiplier of -1.
    branch = continue_orbit(solve_preset(PRESETS['biped']['walk']),
                            ParameterLine.parse('w_a', Biped), -1.0, 0.4)
    assert [end.why for end in branch.ends] == ['symmetry', 'bound']
    last = branch.points[0].orbit
    hop = from_path(last.network, last.network.symmetry('two_legged_hop'),
                    lambda theta: last(0.5 * theta * last.period), 0.5 * last.period)
    assert 2.0 * hop.period == pytest.approx(branch.ends[0].period, rel=1e-6)
    found = np.concatenate([multipliers(hop).within, multipliers(hop).transverse])
    assert np.abs(found + 1.0).min() < 1e-4
    check_in_order(branch)


def test_a_start_at_a_lower_extreme_is_moved_to_the_peak():
    # The same orbits from a trough, and from the lower one of two peaks.
    orbit = solve_orbit(EXAMPLE, 'trot')
    trough = continue_orbit(replace(orbit, values=-orbit.values), TAU, 0.39, 0.41)
    line = ParameterLine.parse('w_a', Biped)
    (two_peaks,) = continue_orbit(solve_preset(PRESETS['biped']['walk']), line, -0.3, 0.4).at(-0.2)
    theta = np.linspace(0.4, 0.6, 2001)
    late = theta[two_peaks.waveform(theta).argmax()]
    lower = from_path(two_peaks.network, two_peaks.symmetry, lambda theta: two_peaks(
        (theta + late) * two_peaks.period), two_peaks.period)
    assert lower.waveform(np.array(0.0)) < two_peaks.peak - 1e-3
    peak = continue_orbit(lower, line, -0.21, -0.19)
    for branch, known in ((trough, orbit), (peak, two_peaks)):
        check_in_order(branch)
        again = next(point.orbit for point in branch.points if point.orbit.network
                     == known.network)
        theta = np.linspace(0.0, 1.0, 40)
        assert np.allclose(again.waveform(theta), known.waveform(theta), 0.0, 1e-8)


def test_a_branch_ends_where_its_period_has_grown():
    preset = PRESETS['quadruped']['pronk']
    line = ParameterLine.parse('alpha=beta', Quadruped)
    branch = continue_orbit(solve_preset(preset), line, 0.0, 1.0, longest=3.0, both=False)
    assert branch.ends[1].why == 'period'
    assert branch.periods[-2] <= 3.0 * branch.periods[0] < branch.periods[-1]
    few = continue_orbit(solve_preset(preset), line, 0.0, 1.0, most=2)
    assert few.ends[1].why == 'steps' and len(few.points) <= 5
    assert gap_after_a_period(few.points[-1].orbit) < 1e-7


def test_a_waveform_too_steep_ends_the_branch(monkeypatch):
    monkeypatch.setattr(solve, 'MAX_NODES', 255)
    (network, mode, _, _), (omega, tau, _, _) = SUBCRITICAL['pace'], hopf(*SUBCRITICAL['pace'])
    branch = continue_from_hopf(hopf_point(network, mode, omega, tau), TAU, 0.5, 5.0)
    assert branch.ends[1].why == 'steep' and branch.points[-1].orbit.values.size == 255


def test_far_from_any_hopf_point_there_is_no_small_orbit():
    point = hopf_point(EXAMPLE, EXAMPLE.symmetry('trot'), 6.3, 0.05)
    with pytest.raises(NoOrbit, match=r'no orbit of amplitude 0.02 was found near tau 0.05'):
        continue_from_hopf(point, TAU, 0.0, 0.1)


def test_a_branch_is_a_table_on_disk(tmp_path):
    walk = PRESETS['delayed']['walk'].network
    branch = continue_orbit(solve_orbit(walk, 'walk'), 'tau', 0.38, 0.42)
    np.savez(tmp_path / 'branch.npz', **branch.table)
    with np.load(tmp_path / 'branch.npz') as stored:
        assert list(stored['period']) == [point.orbit.period for point in branch.points]
        assert np.flatnonzero(stored['fold']).tolist() == list(branch.fold_indices)
        assert stored['value'].shape == stored['amplitude'].shape == (len(branch.points),)

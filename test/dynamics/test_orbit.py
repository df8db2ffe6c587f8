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

"""Orbits and Hopf points against verified numbers and the whole delay equation."""

from dataclasses import replace

from cpg_ros.dynamics.arclength import NoOrbit
from cpg_ros.dynamics.fourier import solve as fourier_solve
from cpg_ros.dynamics.fourier.orbit import rows_of
from cpg_ros.dynamics.hopf import first_hopf, hopf_points
from cpg_ros.dynamics.mesh import orbit as mesh_orbit
from cpg_ros.dynamics.orbit import extra_symmetry
from cpg_ros.dynamics.solve_orbit import solve_from_path, solve_orbit, solve_preset
from cpg_ros.networks.library.delayed import Delayed, PRESETS
from cpg_ros.networks.network import ParameterLine
from cpg_ros.networks.registry import PRESETS as ALL_PRESETS
from cpg_ros.networks.symmetry import GAITS
from depth import examples
from hypothesis import assume, given
from hypothesis import strategies as st
from modes import class_of, eigenvalue_terms, MODES
import numpy as np
import pytest
from scipy.special import lambertw

TAU = ParameterLine(('tau',), (1.0,))
EXAMPLE = Delayed(-4.5, 1.0, 6.5, -2.0, 0.4)
SWAP = [1, 0, 3, 2, 5, 4, 7, 6]
OFF_NODES = np.random.default_rng(3).uniform(-3.0, 3.0, 200)

# docs/numbers_and_errata.md, section Hopf points of the delayed network: parameters, gait,
# omega, tau_c, k1, k2.
ONSETS = [(EXAMPLE, 'walk', 7.4772, 0.2861, 1.8135, -0.9177),
          (EXAMPLE, 'trot', 6.3246, 0.2852, 2.1557, -0.9610),
          (Delayed(-3.0, 0.1, 4.0, 1.0, 0.7), 'pace', 3.5199, 0.5869, 0.8319, -0.9142),
          (Delayed(-2.0, 1.0, 6.43, -2.0, 0.25), 'trot', 6.3518, 0.2227, 3.4488, -0.9010),
          (Delayed(-2.0, 1.0, 6.5, -2.0, 0.245), 'walk', 8.4226, 0.2048, 3.4819, -0.8683)]

# |c| well above |a + b| + |d|, so that every gait of c's sign has its orbits.
networks = st.builds(lambda a, b, d, more: Delayed(a, b, abs(a + b) + abs(d) + more, d, 1.0),
                     st.floats(-5.0, -1.0), st.floats(0.0, 1.5), st.floats(-2.5, 2.5),
                     st.floats(0.5, 4.0))


# docs/numbers_and_errata.md, section Orbits of the delayed network.
@pytest.mark.parametrize(('network', 'gait', 'period', 'peak'), [
    (EXAMPLE, 'trot', 1.27827056, 0.981144), (EXAMPLE, 'walk', 1.09048163, 0.890828),
    (Delayed(-3.0, 0.1, 4.0, 1.0, 0.7), 'pace', 2.04780069, 0.621207),
    (Delayed(-2.0, 1.0, 6.5, -2.0, 0.245), 'walk', 0.86761962, 0.813433)])
def test_periods_and_peaks(network, gait, period, peak):
    orbit = solve_orbit(network, gait)
    assert orbit.period == pytest.approx(period, abs=1e-7)
    assert orbit.peak == pytest.approx(peak, abs=1e-6)
    # The peak is the largest value between the nodes too.
    assert orbit.waveform(np.linspace(0.0, 1.0, 1001)).max() <= orbit.peak + 1e-9


@pytest.mark.parametrize('preset', PRESETS)
def test_solves_all_eight_equations_between_the_nodes(preset):
    a, b, c, d, tau = PRESETS[preset].network.as_dict().values()
    orbit = solve_orbit(PRESETS[preset].network, PRESETS[preset].gait)
    x, past = orbit(OFF_NODES), orbit(OFF_NODES - tau)
    right = (a * x + b * np.tanh(x) + d * np.tanh(np.roll(x, 2, axis=1))
             + c * np.tanh(past[:, SWAP]))
    assert np.abs(orbit.derivative(OFF_NODES) - right).max() <= 1e-9
    assert np.abs(x).max() > 0.5


@pytest.mark.parametrize(('preset', 'legs'), [
    ('pronk', (0, 0, 0, 0)), ('pace', (0, 0.5, 0, 0.5)), ('bound', (0, 0, 0.5, 0.5)),
    ('trot', (0, 0.5, 0.5, 0)), ('jump', (0, 0, 0.75, 0.75)), ('walk', (0, 0.5, 0.75, 0.25)),
    ('liu2024_walk', (0, 0.5, 0.25, 0.75)), ('goat_slope_walk', (0, 0.5, 0.25, 0.75))])
def test_phases_of_the_legs(preset, legs):
    # Cells 1 to 4 are LH, RH, LF, RF. LF at 3/4 peaks T / 4 after LH: the lateral sequence LH,
    # LF, RH, RF of most quadrupeds; the paper's sets walk diagonally (erratum 7).
    orbit = solve_orbit(PRESETS[preset].network, PRESETS[preset].gait)
    times = np.linspace(0.0, orbit.period, 57)
    for cell, phase in enumerate(legs):
        shifted = orbit(times + phase * orbit.period)[:, 0]
        assert np.allclose(orbit(times)[:, cell], shifted, 0.0, 1e-9)


@pytest.mark.parametrize('gait', GAITS)
def test_exact_derivatives(gait):
    network, width = PRESETS[gait].network, 1e-5
    orbit = solve_orbit(network, gait)
    theta = np.arange(orbit.samples) / orbit.samples
    for k, name in enumerate(Delayed.parameters()):
        value = getattr(network, name)
        low, high = (solve_orbit(replace(network, **{name: value + side * width}), gait)
                     for side in (-1, 1))
        period = (high.period - low.period) / (2.0 * width)
        waveform = (high.waveform(theta) - low.waveform(theta)) / (2.0 * width)
        assert orbit.d_period[k] == pytest.approx(period, rel=1e-6, abs=1e-7)
        assert np.allclose(orbit.d_waveform(theta)[:, k], waveform, 1e-6, 1e-7)


@pytest.mark.parametrize(('network', 'gait', 'omega', 'tau', 'k1', 'k2'), ONSETS)
def test_onset(network, gait, omega, tau, k1, k2):
    point = first_hopf(network, gait)
    assert (point.omega, point.value) == pytest.approx((omega, tau), abs=1e-4)
    # Just beyond it the normal form gives the amplitude, and the period is 2 pi / omega.
    orbit = solve_orbit(replace(network, tau=point.value + 5e-4), gait)
    theta = np.arange(256) / 256
    first = 2.0 * abs(np.mean(orbit.waveform(theta) * np.exp(-2j * np.pi * theta)))
    assert first == pytest.approx(2.0 * np.sqrt(-k1 * 5e-4 / k2), rel=1e-3)
    assert orbit.period == pytest.approx(2.0 * np.pi / omega, rel=5e-3)


@examples(60)
@given(networks, st.sampled_from(MODES), st.sampled_from([-1.0, 1.0]))
def test_hopf_points_make_the_characteristic_matrix_singular(network, mode, sign):
    network = replace(network, c=sign * network.c)
    found = [point for point in hopf_points(network, TAU, 0.0, 20.0)
             if point.mode == class_of(mode) and point.n == 0]
    assume(found)
    point = max(found, key=lambda one: one.omega)
    a, b, c, d, _ = network.as_dict().values()
    unit = np.eye(8)
    root = 1j * point.omega
    matrix = ((root - a - b) * unit - d * np.roll(unit, 2, axis=0)
              - c * np.exp(-root * point.value) * unit[SWAP])
    assert np.linalg.svd(matrix)[1][-1] < 1e-9


@pytest.mark.parametrize(('network', 'gait'), [row[:2] for row in ONSETS])
def test_the_critical_delay_is_where_the_mode_turns_unstable(network, gait):
    a, b = eigenvalue_terms(network, network.symmetry(gait))
    critical = first_hopf(network, gait).value
    for tau, sign in ((0.3 * critical, -1), (0.99 * critical, -1), (1.01 * critical, 1)):
        roots = a + lambertw(b * tau * np.exp(-a * tau), np.arange(-9, 10)) / tau
        assert np.sign(roots.real.max()) == sign


@examples(30)
@given(networks, st.floats(1.05, 2.0), st.floats(0.2, 5.0))
def test_symmetry_laws(network, factor, s):
    # A sign moved from the phases into c or d leaves waveform and period; s rescales time.
    a, b, c, d, _ = network.as_dict().values()
    for families in (
            (('trot', c, d, 1), ('pace', c, -d, 1), ('pronk', -c, -d, 1), ('bound', -c, d, 1)),
            (('walk', c, d, 1), ('walk', c, -d, 1), ('jump', -c, d, 1), ('jump', -c, -d, 1)),
            (('trot', c, d, 1), ('trot', c, d, s)), (('walk', c, d, 1), ('walk', c, d, s))):
        tau = factor * first_hopf(network, families[0][0]).value
        first, *others = (
            solve_orbit(Delayed(a * rate, b * rate, c * rate, d * rate, tau / rate), gait)
            for gait, c, d, rate in families)
        for other, (_, _, _, rate) in zip(others, families[1:], strict=True):
            assert other.period * rate == pytest.approx(first.period, rel=1e-9)
            assert np.allclose(other.waveform(OFF_NODES), first.waveform(OFF_NODES), 0.0, 1e-9)


@pytest.mark.parametrize(('change', 'gait', 'words'), [
    ({'tau': 0.2}, 'trot', "tau 0.2 is below the trot's critical delay 0.2852"),
    ({'tau': 0.28}, 'walk', "tau 0.28 is below the walk's critical delay 0.2861"),
    ({'c': -6.5}, 'trot', 'c -6.5 gives no trot: c must be positive'),
    ({}, 'pronk', 'c 6.5 gives no pronk: c must be negative'),
    ({'c': 1.4}, 'trot', 'c. 1.4 gives no trot at any delay: it must be above 1.5000'),
    ({}, 'gallop', "'gallop' is not one of pronk, pace"), ({'tau': 0.0}, 'trot', 'tau is 0.0'),
    ({'tau': -0.4}, 'trot', 'tau is -0.4'), ({'d': np.nan}, 'trot', 'd is nan'),
    ({'a': -np.inf}, 'walk', 'a is -inf'), ({'d': np.nan}, 'walk', 'd is nan')])
def test_refusals(change, gait, words):
    with pytest.raises(ValueError, match=words) as caught:
        solve_orbit(replace(EXAMPLE, **change), gait)
    # A set without an orbit is told from arguments that make no sense.
    assert isinstance(caught.value, NoOrbit) == ('gives no' in words or 'below' in words)


def test_the_residual_is_that_between_the_nodes():
    """Seven nodes solve no equation but at themselves; eq. 1.1, written out, at other times."""
    fine = solve_orbit(EXAMPLE, 'trot')
    coarse = replace(fine, values=fine.values[..., ::9])
    for orbit, most in ((fine, 1e-9), (coarse, 1.0)):
        a, b, c, d, tau = orbit.network.as_dict().values()
        times = np.linspace(0.0, orbit.period, 400)
        now, past, cells = orbit(times), orbit(times - tau), np.arange(8)
        rates = (a * now + b * np.tanh(now) + d * np.tanh(now[:, cells - 2])
                 + c * np.tanh(past[:, cells ^ 1]))
        gap = np.abs(orbit.derivative(times) - rates).max()
        assert gap < most
        assert orbit.residual == pytest.approx(gap, rel=0.5, abs=1e-9)
    assert coarse.residual > 1e-3


def test_an_orbit_that_repeats_eleven_times_is_told():
    once = solve_orbit(EXAMPLE, 'trot')
    often = replace(once, period=11.0 * once.period, values=np.tile(once.values, 11))
    assert extra_symmetry(once) == ''
    assert extra_symmetry(often) == 'it repeats 11 times'


@pytest.mark.parametrize('case', ['quadruped', 'delayed'])
def test_the_error_of_a_coarse_orbit_is_that_against_a_fine_one(case, monkeypatch):
    exact = solve_preset(ALL_PRESETS[case]['trot'])
    assert exact.error < 1e-10
    # As if waveforms were resolved with far larger last terms.
    monkeypatch.setattr(mesh_orbit, 'INTERVAL_TOLERANCE', 1e-5)
    monkeypatch.setattr(fourier_solve, 'HARMONIC_TOLERANCE', 1e-3)
    theta = np.arange(499) / 499
    coarse = solve_from_path(exact.network, exact.symmetry,
                             lambda at: exact(at * exact.period), exact.period)
    if case == 'delayed':
        rows = rows_of(exact.network, exact.symmetry, exact.cycle(15))
        coarse = fourier_solve.newton(exact.network, exact.symmetry, rows, exact.period)
    states, wanted = (one(theta * one.period) for one in (coarse, exact))
    sizes = np.ptp(wanted, axis=0).reshape(exact.network.variables, -1).max(axis=1)
    gap = (np.abs(states - wanted).max(axis=0) / sizes.repeat(exact.network.cells)).max()
    assert gap > 1e-11
    assert 0.3 < coarse.error / max(gap, abs(coarse.period / exact.period - 1.0)) < 3.0

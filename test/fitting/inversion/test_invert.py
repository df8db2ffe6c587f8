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

"""Parameters and readouts from mean cycles: found again, honestly, and nonsense refused."""

from dataclasses import replace

from cpg_ros.dynamics.solve_orbit import solve_orbit, solve_preset
from cpg_ros.fitting.inversion import invert as inversion
from cpg_ros.fitting.inversion.cycle_problem import CycleProblem
from cpg_ros.fitting.inversion.fit import correlation_length
from cpg_ros.fitting.inversion.fit_data import cells_of, Joints
from cpg_ros.fitting.inversion.free_parameters import free_numbers
from cpg_ros.fitting.inversion.invert import invert
from cpg_ros.fitting.inversion.leg_duty import GaitReadout
from cpg_ros.motion.plan import validate_orbit
from cpg_ros.motion.robot import NUM_HARMONICS
from cpg_ros.networks.library.delayed import Delayed
from cpg_ros.networks.library.quadruped import Quadruped
from cpg_ros.networks.registry import PRESETS
from depth import examples
from hypothesis import given
from hypothesis import strategies as st
from made_up import joint_angles, plain_readout, record, weights_of
from noisy_cycles import CASES, CELLS, TROT, trot, truth_of
import numpy as np
import pytest

# -- the model -------------------------------------------------------------------------------

@pytest.mark.parametrize(('name', 'gait', 'free'), CASES)
def test_the_jacobian_is_that_of_the_residual(name, gait, free):
    network = PRESETS[name][gait].network
    numbers = free_numbers(network, gait, free)
    cells = np.arange(4)
    theta = np.arange(32) / 32
    data = np.random.default_rng(0).standard_normal((32, 4))
    joints = Joints(tuple('abcd'), theta, data, cells, np.ones(4))
    problem = CycleProblem(joints, np.array([0.5, 1.0, 2.0, 1.0]), network, gait, numbers, 3,
                           GaitReadout())
    values = np.array([*(one.value(network) for one in numbers), 0.13])
    problem.begin(values)
    slopes = problem(values)[1]
    assert slopes.shape == (4 * 32, len(free) + 1)
    for k in range(values.size):
        step = 1e-5 * max(1.0, abs(values[k])) * (np.arange(values.size) == k)
        ahead, behind = problem(values + step)[0], problem(values - step)[0]
        assert slopes[:, k] == pytest.approx((ahead - behind) / (2.0 * step[k]),
                                             abs=2e-6 * np.abs(slopes[:, k]).max() + 1e-9)


@pytest.mark.parametrize(('name', 'gait', 'free'), CASES)
def test_parameters_and_readouts_are_found_again(name, gait, free):
    preset = PRESETS[name][gait]
    orbit, weights = solve_preset(preset), weights_of(4)
    recording, cells = record(orbit, (1, 2, 3, 4), weights)
    truth = {one: truth_of(preset.network, one) for one in free}
    start = {one: 1.02 * value + 0.003 for one, value in truth.items()}
    fit = invert(recording, cells, preset.network, gait, free, 3, [start])
    assert fit.mean_rms_share < 1e-5
    for one, value in truth.items():
        found = fit.parameters[one]
        # Errors of 1e-4 of the range are allowed for, whatever the recording says.
        assert abs(found.value - value) < max(2e-4, found.stderr)
    # What it found moves joints by the generator's own readout as they were recorded.
    found = joint_angles(fit.orbit, (1, 2, 3, 4), np.array([w for _, w in fit.readouts.values()]),
                         fit.theta + fit.phase)
    offsets = np.array([[offset] for offset, _ in fit.readouts.values()])
    assert found + offsets == pytest.approx(recording.mean, abs=1e-4)
    assert fit.fitted == pytest.approx(recording.mean + fit.errors)


def test_lower_orders_fit_what_they_can():
    recording, cells = trot(None, order=1)
    for order in (1, 2, 3):
        fit = invert(recording, cells, TROT, 'trot', ('c',), order, [{'c': 6.9}])
        assert fit.parameters['c'].value == pytest.approx(TROT.c, abs=1e-4)
        assert all(len(weights) == 2 * order for _, weights in fit.readouts.values())
    cubic, cells = trot(None)
    fractions = [invert(cubic, cells, TROT, 'trot', ('c',), order).mean_rms_share
              for order in (1, 2, 3)]
    assert fractions[0] > fractions[1] > fractions[2] and fractions[0] > 0.02


# -- a model that is not the truth ---------------------------------------------------------------

@pytest.mark.parametrize(('name', 'gait'), [('matsuoka', 'trot'), ('quadruped', 'trot'),
                                            ('biped', 'run'), ('hopf', 'trot')])
def test_the_error_of_another_readout_is_in_the_intervals(name, gait):
    preset = PRESETS[name][gait]
    orbit, legs = solve_preset(preset), tuple(range(1, 5))
    for seed in (31, 32):
        rng, weights = np.random.default_rng(seed), weights_of(4, 3, seed)
        recording, cells = record(orbit, legs, weights, None)
        mean = plain_readout(orbit, legs, weights, recording.theta + 0.2)
        noise = 0.002 * np.ptp(mean, axis=1)[:, None] * np.ones_like(mean)
        recording = replace(recording, mean=mean + noise * rng.standard_normal(mean.shape),
                            error=noise)
        fit = invert(recording, cells, preset.network, gait)
        assert fit.model_error > 0.0
        assert 'the model does not fit the recording' in ' '.join(fit.warnings)
        for one, found in fit.parameters.items():
            assert found.low <= truth_of(preset.network, one) <= found.high


@pytest.mark.parametrize('gait', ['bound', 'trot'])
def test_a_waveform_that_is_off_by_less_than_the_noise_widens_the_intervals(gait):
    preset = PRESETS['delayed'][gait]
    orbit, cells = solve_preset(preset), (1, 1, 7, 2, 2, 8, 3, 3, 5, 4, 4, 6)
    for seed in (31, 32):
        recording, assigned = record(orbit, cells, weights_of(12, 3, seed),
                                     np.random.default_rng(seed), noise=0.01, jitter=0.0,
                                     dropouts=0.0, angles=plain_readout)
        fit = invert(recording, assigned, preset.network, gait)
        misfit = np.sqrt(np.mean(np.square(list(fit.misfit.values()))))
        assert misfit < 1.2 and fit.model_error > 0.0
        for one, found in fit.parameters.items():
            assert found.low <= truth_of(preset.network, one) <= found.high


def test_readouts_of_another_order_do_not_make_a_sharp_number():
    for seed in range(4):
        recording, cells = trot(seed)
        fit = invert(recording, cells, TROT, 'trot', ('c',), order=2)
        found = fit.parameters['c']
        assert fit.model_error > 0.0 and found.low <= TROT.c <= found.high


def test_noise_is_no_error_of_the_model():
    for seed in range(4):
        recording, cells = trot(seed)
        fit = invert(recording, cells, TROT, 'trot', ('c',))
        assert fit.model_error == 0.0
        assert 'the model' not in ' '.join(fit.warnings)


# -- how sure it is ------------------------------------------------------------------------------

def test_intervals_hold_the_truth_and_errors_are_as_said():
    off, inside = [], []
    for seed in range(24):
        recording, cells = trot(seed)
        fit = invert(recording, cells, TROT, 'trot', ('c', 'tau'), 3, [{'c': 6.2, 'tau': 0.44}])
        for name, one in fit.parameters.items():
            inside.append(one.low <= truth_of(TROT, name) <= one.high)
            off.append((one.value - truth_of(TROT, name)) / one.stderr)
    # By chance less than 41 of 48 once in a thousand.
    assert sum(inside) >= 41
    assert 0.7 < np.sqrt(np.mean(np.square(off))) < 1.35


@pytest.mark.parametrize(('name', 'gait', 'free'), [
    ('quadruped', 'trot', ('alpha', 'beta')), ('biped', 'walk', ('current', 'phi'))])
def test_intervals_of_cells_that_jump_hold_the_truth(name, gait, free):
    preset, inside = PRESETS[name][gait], []
    for seed in range(4):
        recording, cells = record(solve_preset(preset), (1, 2, 3, 4), weights_of(4),
                                  np.random.default_rng(seed))
        fit = invert(recording, cells, preset.network, gait, free)
        inside += [one.low <= truth_of(preset.network, key) <= one.high
                   for key, one in fit.parameters.items()]
    assert sum(inside) >= 6


def test_the_interval_is_where_the_least_cost_has_risen_enough():
    recording, cells = trot(3, noise=0.04)
    fit = invert(recording, cells, TROT, 'trot', ('c', 'tau'))
    one = fit.parameters['tau']

    def cost(tau):
        there = invert(recording, cells, replace(TROT, tau=tau), 'trot', ('c',), 3,
                       [{'c': start} for start in (5.5, 7.0, 9.0)])
        sizes = np.array([[fit.sizes[name]] for name in fit.joints])
        return 0.5 * np.sum((there.errors / sizes)**2) / fit.sharing

    least = 0.5 * np.sum((fit.errors / np.array([[fit.sizes[name]] for name in fit.joints]))**2)
    for end in (one.low, one.high):
        assert 2.0 * (cost(end) - least / fit.sharing) == pytest.approx(3.84, rel=0.25)


def test_a_misfit_widens_the_errors():
    recording, cells = trot(0)
    bump = 0.02 * np.cos(2.0 * np.pi * 9.0 * recording.theta)
    wrong = replace(recording, mean=recording.mean + bump)
    right, fit = (invert(each, cells, TROT, 'trot', ('c',))
                  for each in (recording, wrong))
    assert right.sharing < 1.3 < 2.0 < fit.sharing
    assert max(right.misfit.values()) < 1.5 and min(fit.misfit.values()) > 1.5
    assert fit.parameters['c'].stderr > 2.0 * right.parameters['c'].stderr


@pytest.mark.parametrize('width', [1, 3, 5])
def test_instants_that_share_an_error_are_counted(width):
    noise = np.random.default_rng(0).standard_normal((64, 400))
    smooth = sum(np.roll(noise, k, axis=0) for k in range(width))
    assert correlation_length(smooth) == pytest.approx(width, rel=0.1)
    assert correlation_length(np.zeros((64, 2))) == 1.0


def test_what_the_trot_cannot_tell_is_said():
    recording, cells = trot(0)
    # x_{i-2} is -x_i on a trot: only b - d is seen.
    fit = invert(recording, cells, TROT, 'trot', ('b', 'd'))
    assert any('b and d are not determined one by one' in line for line in fit.warnings)
    assert all(np.isinf(one.stderr) and not one.bounded for one in fit.parameters.values())
    assert np.isnan(fit.correlation[0, 1])
    # All rates over one another are seen, not the unit of time.
    fit = invert(recording, cells, TROT, 'trot', ('a', 'b', 'c', 'd', 'tau'))
    assert sum('not determined' in line for line in fit.warnings) == 2
    assert all(np.isinf(one.stderr) for one in fit.parameters.values())


def test_a_parameter_without_effect_is_said():
    # The cells of a hop are equal: diffusive coupling does nothing.
    preset = PRESETS['biped']['two_legged_hop']
    recording, cells = record(solve_preset(preset), (1, 2), weights_of(2))
    fit = invert(recording, cells, preset.network, 'two_legged_hop', ('w_b', 'phi'))
    assert any('w_b is not determined' in line for line in fit.warnings)
    assert np.isinf(fit.parameters['w_b'].stderr) and np.isfinite(fit.parameters['phi'].stderr)


def test_a_shape_that_says_little_is_no_sharp_number():
    # One leg near its onset, noisy: almost a cosine, whatever c and tau are.
    near = replace(TROT, tau=0.295)
    recording, cells = trot(2, network=near, cells=(1, 2), noise=0.05)
    fit = invert(recording, cells, TROT, 'trot', ('c', 'tau'))
    for name, one in fit.parameters.items():
        assert any(f'{name} is poorly identifiable' in line for line in fit.warnings)
        assert one.low <= truth_of(near, name) <= one.high
        assert one.high - one.low > 0.2 * one.value


# -- laws ----------------------------------------------------------------------------------------

BASE, BASE_CELLS = trot(5)
FITTED = invert(BASE, BASE_CELLS, TROT, 'trot', ('c', 'tau'))


@examples(6)
@given(order=st.permutations(range(len(CELLS))), factor=st.floats(0.05, 30.0),
       turn=st.integers(0, 63))
def test_names_units_and_the_begin_of_the_cycle_do_not_matter(order, factor, turn):
    order = list(order)
    other = replace(BASE, joints=tuple(BASE.joints[k] for k in order),
                    mean=factor * np.roll(BASE.mean[order], turn, axis=1),
                    error=factor * np.roll(BASE.error[order], turn, axis=1))
    fit = invert(other, BASE_CELLS, TROT, 'trot', ('c', 'tau'))
    for name, one in fit.parameters.items():
        known = FITTED.parameters[name]
        assert one.value == pytest.approx(known.value, abs=0.03 * known.stderr)
        assert one.stderr == pytest.approx(known.stderr, rel=3e-2)
    assert fit.rms_share == pytest.approx(FITTED.rms_share, rel=1e-2)
    # The delayed network's waveform is odd: half a cycle on, it is the same with other signs.
    late = 2.0 * (fit.phase - FITTED.phase + turn / 64)
    assert abs(late - round(late)) < 1e-2


# -- what is preferred and what is refused -----------------------------------------------------

def test_what_the_generator_runs_is_preferred(monkeypatch):
    recording, cells = trot(None, network=replace(TROT, tau=0.5))
    monkeypatch.setattr(inversion, 'validate_orbit', lambda orbit, gait, harmonics: (
        'it is too late' if orbit.network.tau > 0.45 else ''))
    fit = invert(recording, cells, TROT, 'trot', ('tau',))
    assert 0.44 < fit.parameters['tau'].value <= 0.45
    assert 'the generator would refuse the trot that fits best: it is too late' in fit.warnings[-1]
    monkeypatch.setattr(inversion, 'validate_orbit', lambda orbit, gait, harmonics: 'never')
    fit = invert(recording, cells, TROT, 'trot', ('tau',))
    assert fit.parameters['tau'].value == pytest.approx(0.5, abs=1e-4)
    assert fit.warnings[-1].endswith('never')


def test_what_the_generator_refuses():
    assert validate_orbit(solve_orbit(TROT, 'trot'), 'trot', NUM_HARMONICS) == ''
    assert validate_orbit(solve_preset(PRESETS['biped']['walk']), 'walk', NUM_HARMONICS) == ''
    fast = Delayed(-450.0, 100.0, 650.0, -200.0, 0.004)
    assert 'its period' in validate_orbit(solve_orbit(fast, 'trot'), 'trot', NUM_HARMONICS)


def test_verdicts_come_with_a_fit():
    recording, cells = trot(None)
    fit = invert(recording, cells, TROT, 'trot', ('c',))
    assert fit.hopf.value == pytest.approx(0.2852, abs=1e-4)
    assert not fit.verdict.stable and fit.verdict.stable_with_default_gain


# -- nonsense ----------------------------------------------------------------------------------

def test_cells_come_from_legs_or_a_robot():
    legs = {'lh': ('a', 'b'), 'rf': ('c',)}
    assert cells_of(legs, Delayed) == {'a': 1, 'b': 1, 'c': 4}
    assert cells_of(legs, Quadruped, 'zigzag') == {'a': 1, 'b': 1, 'c': 4}
    with pytest.raises(ValueError, match="no leg 'tail'"):
        cells_of({'tail': ('a',)}, Delayed)
    with pytest.raises(ValueError, match="'round'"):
        cells_of(legs, Delayed, 'round')


@pytest.mark.parametrize(('change', 'message'), [
    ({'order': 4}, 'order 4'), ({'free': ('q',)}, "'q' is not one of"),
    ({'free': ('c', 'c')}, "'c, c'"),
    ({'starts': [{'tau': 0.4}]}, "'tau' is not free"),
    ({'starts': [{'c': 50.0}]}, 'c 50 to start'),
    ({'bounds': {'tau': (0.1, 1.0)}}, "'tau' has bounds"), ({'bounds': {'c': (7.0, 6.0)}}, 'c: '),
    ({'cells': {}}, 'no joint'), ({'cells': {'nose': 1}}, "'nose' is not in"),
    ({'cells': {'joint_0': 9}}, 'cell 9'), ({'gait': 'gallop'}, "'gallop'"),
    ({'cycle': replace(BASE, mean=BASE.mean * np.nan)}, 'not finite'),
    ({'cycle': replace(BASE, error=-BASE.error)}, 'not finite|negative'),
    ({'cycle': replace(BASE, mean=BASE.mean[:, 1:])}, 'shape'),
    ({'cycle': replace(BASE, theta=BASE.theta**2)}, 'even grid'),
    ({'cycle': replace(BASE, theta=np.arange(4) / 4, mean=BASE.mean[:, :4],
                       error=BASE.error[:, :4])}, 'do not determine')])
def test_nonsense_is_refused(change, message):
    arguments = {'cycle': BASE, 'cells': BASE_CELLS, 'network': TROT, 'gait': 'trot',
                 'free': ('c',), **change}
    with pytest.raises(ValueError, match=message) as caught:
        invert(**arguments)
    assert '\n' not in str(caught.value)


def test_parameters_that_a_gait_needs_equal_are_one():
    network = PRESETS['biped']['skip'].network
    one, = free_numbers(network, 'skip', ('w_43',))
    assert set(one.members) == {'w_43', 'w_34'}
    with pytest.raises(ValueError, match='w_34 is the same as w_43'):
        free_numbers(network, 'skip', ('w_43', 'w_34'))


def test_a_joint_that_stands_is_only_an_offset():
    recording, cells = trot(0)
    still = replace(recording, mean=np.vstack([recording.mean[:5], np.full((1, 64), 0.3)]),
                    error=np.vstack([recording.error[:5], np.zeros((1, 64))]))
    fit = invert(still, cells, TROT, 'trot', ('c',))
    offset, weights = fit.readouts['joint_5']
    assert offset == pytest.approx(0.3) and weights == pytest.approx([0.0] * 6, abs=1e-9)
    assert fit.rms_share['joint_5'] == 0.0 or fit.rms['joint_5'] < 1e-9

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

"""The search for weights: as a function, as an executable, and what it is made of."""

import csv
from dataclasses import replace
import os
import subprocess
import sys

from cpg_ros.analysis import nsga2, objectives, optimize
from cpg_ros.analysis.optimize import write_front
from cpg_ros.dynamics.floquet import multipliers
from cpg_ros.dynamics.orbit import extra_symmetry
from cpg_ros.dynamics.solve_orbit import solve_preset
from cpg_ros.fitting.gaits.recognition import lag, shape_difference, shifted, steadiness
from cpg_ros.motion.phase_readout import PhaseReadout
from cpg_ros.networks.library.biped import Biped, GAITS, PRIMARY, WEIGHTS
from cpg_ros.networks.library.quadruped import Quadruped
from cpg_ros.networks.presets import read_presets
from cpg_ros.networks.registry import PRESETS as ALL_PRESETS
import numpy as np
import pytest

PRESETS = ALL_PRESETS['biped']
SECONDARY = tuple(gait for gait in GAITS if gait not in PRIMARY)
FIXED = {'current': 0.229, 'phi': 0.254}
SMALL = ('--gait', 'walk', '--fix', 'current=0.229', 'phi=0.254', '--population', '24',
         '--generations', '4')


def run(*arguments, **environment):
    return subprocess.run([sys.executable, '-P', '-W', 'error::RuntimeWarning', '-m',
                           'cpg_ros.analysis.optimize', *map(str, arguments)], text=True,
                          capture_output=True, env={**os.environ, **environment})


@pytest.fixture(scope='module')
def found():
    return nsga2.optimise('biped', 'walk', population=24, generations=4, fixed=FIXED,
                            progress=False)


@pytest.fixture(scope='module')
def written(tmp_path_factory):
    out = tmp_path_factory.mktemp('optimize') / 'deep' / 'out'
    return out, run(*SMALL, '--out', out, '--name', 'my_walk')


def test_it_finds_the_walk(found):
    best = found.best
    assert len(found.tried) <= 24 * 4
    assert best.errors.max() <= 1.0
    assert best.leading < 1.0
    assert best.preset.network.as_dict().items() >= FIXED.items()
    assert best.orbit.residual < 1e-8
    # The walk of Table 5: 0 1/2 1/2 0, exactly.
    x = best.orbit.cycle(64)[:, :4]
    assert x[:, 3] == pytest.approx(x[:, 0], abs=1e-12)
    assert x[:, 1] == pytest.approx(np.roll(x[:, 0], 32), abs=1e-9)
    assert x[:, 2] == pytest.approx(x[:, 1], abs=1e-12)


def test_the_selected_set_is_the_best_of_a_front_that_nothing_dominates(found):
    assert found.scores[0].network == found.best.preset.network
    exact = np.array([one.objectives for one in found.tried if one.exact])
    for score in found.scores:
        assert score.exact and score.shortfall == 0.0
        better = (exact <= score.objectives).all(axis=1) & (exact < score.objectives).any(axis=1)
        assert not better.any()


def test_the_executable_writes_what_the_function_finds(found, written):
    out, process = written
    assert process.returncode == 0, process.stderr
    assert process.stderr == ''
    assert sorted(file.name for file in out.iterdir()) == [
        'front.csv', 'front.png', 'preset.yaml']
    presets = read_presets(out / 'preset.yaml', Biped)
    # The same seed in another process: the very same set.
    assert presets == {'my_walk': found.best.preset}
    assert '--seed' not in process.stdout
    for what in ('w_a', 'phase errors', 'leading multiplier', 'period', 'degrees', 'my_walk'):
        assert what in process.stdout
    assert (out / 'preset.yaml').read_text().startswith('# Found by: optimize --gait walk --fix ')
    assert (out / 'front.png').read_bytes().startswith(b'\x89PNG')


def test_its_preset_solves_with_the_gaits_symmetry_and_is_stable(written):
    preset = read_presets(written[0] / 'preset.yaml', Biped)['my_walk']
    orbit = solve_preset(preset)
    assert orbit.symmetry == preset.network.symmetry('walk')
    assert extra_symmetry(orbit) == ''
    assert orbit(np.array(0.0)) == pytest.approx(preset.start, abs=1e-8)
    assert orbit.period == pytest.approx(preset.period, abs=1e-8)
    assert multipliers(orbit).leading < 1.0


def test_the_front_is_a_table_with_units(found, written):
    with (written[0] / 'front.csv').open(newline='') as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == len(found.scores)
    assert all(name.endswith(']') or name == 'selected' for name in rows[0])
    assert [row['selected'] for row in rows] == ['1'] + ['0'] * (len(rows) - 1)
    assert float(rows[0]['w_a [1]']) == found.best.preset.network.w_21
    assert float(rows[0]['period [model time]']) == pytest.approx(found.best.orbit.period,
                                                                  abs=1e-5)


def test_a_two_wave_gait_and_its_picture(tmp_path, capsys):
    assert optimize.main(['--gait', 'skip', '--population', '40', '--generations', '4',
                          '--out', str(tmp_path)]) == 0
    assert 'waveforms differ by' in capsys.readouterr().out
    preset = read_presets(tmp_path / 'preset.yaml', Biped)['skip_optimised']
    orbit = solve_preset(preset)
    assert extra_symmetry(orbit) == '' and multipliers(orbit).leading < 1.0
    signals = orbit.cycle(nsga2.POINTS)
    assert shape_difference(signals[:, 0], signals[:, 2]) > objectives.MIN_DIFFERENCE


@pytest.mark.parametrize('arguments, message', [
    (('--gait', 'moonwalk'), "'moonwalk' is not one of walk, run"),
    (('--gait', 'trot'), "'trot' is not one of"),
    (('--network', 'delayed', '--gait', 'trot'),
     "'delayed' is not one of biped, hopf, matsuoka, quadruped"),
    ((), 'required: --gait'),
    (('--gait', 'walk', '--bounds', 'w_a=0.5:-0.5'), 'is not below the upper bound'),
    (('--gait', 'walk', '--bounds', 'w_a=0.5'), 'name=low:high'),
    (('--gait', 'walk', '--bounds', 'w_a=-9:9'), 'is not within -2 to 2'),
    (('--gait', 'walk', '--bounds', 'w_a=nan:1'), 'w_a'),
    (('--gait', 'walk', '--fix', 'w_d=0.5'), "'w_d' is not one of the variables of walk: w_a"),
    (('--gait', 'walk', '--fix', 'current'), 'name=value'),
    (('--gait', 'walk', '--fix', 'current=x'), "'x' is not a number"),
    (('--gait', 'walk', '--fix', 'phi=inf'), 'phi: inf is not within'),
    (('--gait', 'skip', '--fix', 'w_12=0.5', 'w_21=0.4'), 'is the same as w_12'),
    (('--gait', 'walk', '--fix', 'phi=0.2', 'phi=0.3'), 'phi is given twice'),
    (('--gait', 'walk', '--fix', 'w_a=0', 'w_b=0', 'w_c=0', *(f'{k}={v}' for k, v in
                                                              FIXED.items())), 'nothing is left'),
    (('--gait', 'walk', '--population', '2'), 'at least 4'),
    (('--gait', 'walk', '--generations', '0'), 'at least 1'),
    (('--gait', 'walk', '--seed', '-1'), 'must not be negative'),
    (('--gait', 'walk', '--seed', 'x'), 'invalid int'),
    (('--gait', 'walk', '--name', 'a b'), 'is not a name'),
])
def test_bad_input_is_said_in_a_line(arguments, message, tmp_path, capsys):
    try:
        code = optimize.main([*arguments, '--out', str(tmp_path)])
    except SystemExit as ended:
        code = ended.code
    lines = capsys.readouterr().err.splitlines()
    assert code == 2
    assert len(lines) == 1 and lines[0].startswith('optimize: ') and message in lines[0]
    assert not list(tmp_path.iterdir())


def test_a_folder_that_cannot_be_made_is_said_before_the_work(tmp_path, capsys):
    (tmp_path / 'file').write_text('')
    assert optimize.main([*SMALL, '--out', str(tmp_path / 'file' / 'out')]) == 2
    assert len(capsys.readouterr().err.splitlines()) == 1


def test_without_pymoo_it_says_how_to_get_it(tmp_path):
    (tmp_path / 'pymoo').mkdir()
    (tmp_path / 'pymoo' / '__init__.py').write_text('raise ImportError')
    path = os.pathsep.join([str(tmp_path), os.environ.get('PYTHONPATH', '')])
    process = run(*SMALL, '--out', tmp_path / 'out', PYTHONPATH=path)
    assert process.returncode == 2
    assert process.stderr == 'optimize: optimize needs pymoo: pip install pymoo\n'


def test_as_in_the_paper_weights_are_bits_and_phases_the_only_objectives(tmp_path, capsys):
    assert optimize.main(['--paper', '--gait', 'run', '--population', '24', '--generations', '4',
                          '--out', str(tmp_path)]) == 0
    assert 'front by phases alone' in capsys.readouterr().out
    front = nsga2.optimise('biped', 'run', population=24, generations=4, progress=False,
                           paper=True)
    preset = read_presets(tmp_path / 'preset.yaml', Biped)['run_optimised']
    assert preset == front.best.preset
    # All but the weights is as in the preset, and a weight is one of 2^11 in [-1, 1].
    stated = PRESETS['run'].network
    for score in front.tried:
        assert (score.network.current, score.network.phi) == (stated.current, stated.phi)
        assert not score.exact
        steps = (np.array([score.network.w_21, score.network.w_31, score.network.w_41])
                 + 1.0) * 2047 / 2
        assert np.abs(steps - np.round(steps)).max() < 0.06
    errors = np.array([score.errors for score in front.tried])
    for score in front.by_phase:
        assert not ((errors <= score.errors - 0.001).all(axis=1)).any()


def test_help_names_all_gaits():
    process = run('--help')
    assert process.returncode == 0
    text = ' '.join(process.stdout.split())
    for gait in (*GAITS, 'trot', 'pronk'):
        assert gait in text


def test_nothing_found_is_said_with_how_close_it_came(tmp_path, capsys):
    # Attracting couplings only: all cells end in step.
    code = optimize.main(['--gait', 'walk', '--bounds', 'w_a=0.5:1', 'w_b=0.5:1', 'w_c=0.5:1',
                          '--population', '4', '--generations', '1', '--out', str(tmp_path)])
    lines = capsys.readouterr().err.splitlines()
    assert code == 1
    assert len(lines) == 1 and 'phase errors of up to 180.0 degrees' in lines[0]
    assert not list(tmp_path.iterdir())


def test_nothing_is_left_half_written(found, tmp_path):
    target = tmp_path / 'front.csv'
    target.write_text('before')
    with pytest.raises(AttributeError):
        # The header is written before this is missed.
        write_front(target, replace(found, best=None))
    assert target.read_text() == 'before'
    assert [file.name for file in tmp_path.iterdir()] == ['front.csv']


def test_a_reader_that_has_seen_enough_is_no_error(tmp_path):
    process = subprocess.Popen([sys.executable, '-P', '-m', 'cpg_ros.analysis.optimize', *SMALL,
                                '--out', tmp_path], stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    process.stdout.close()
    assert process.stderr.read() == b''
    assert process.wait() == 0
    assert (tmp_path / 'preset.yaml').is_file()


@pytest.mark.parametrize('gait', GAITS)
def test_weights_of_a_search_keep_the_gaits_symmetry(gait):
    space = objectives.search_space('biped', gait, {}, {})
    weight = [variable for variable in space.variables if variable.name.startswith('w_')]
    if gait in PRIMARY:
        assert {variable.name: frozenset(variable.members) for variable in weight} == {
            f'w_{letter}': frozenset(names) for letter, names in WEIGHTS.items()}
    else:
        assert [len(variable.members) for variable in weight] == [2] * 6
    rng = np.random.default_rng(1)
    network = space.build(rng.uniform([v.low for v in space.free], [v.high for v in space.free]))
    symmetry = network.symmetry(gait)
    assert network.broken(network.symmetry(gait)) == ''
    x = rng.uniform(-0.5, 0.5, 8)
    for name in symmetry.h:
        g = np.array(symmetry.group.elements[name])
        g = np.concatenate([g, g + 4])
        assert network.rates(x[g]) == pytest.approx(network.rates(x)[g], abs=1e-14)
    # And no more than that: different weights go with different orbits.
    for other in GAITS:
        if gait not in PRIMARY and set(network.symmetry(other).h) - set(symmetry.h):
            assert network.broken(network.symmetry(other))


def test_bounds_and_fixed_values_hold():
    space = objectives.search_space('quadruped', 'trot', {'xi': (-0.1, 0.1)}, {'beta': 0.25})
    assert [variable.name for variable in space.free] == ['alpha', 'gamma', 'delta', 'xi']
    network = space.build(np.array([0.11111111, 0.2, 0.3, -0.1]))
    assert network == Quadruped(0.1111, 0.25, 0.2, 0.3, -0.1, 0.0)


def test_a_partners_name_fixes_both():
    space = objectives.search_space('biped', 'skip', {}, {'w_21': 0.5})
    network = space.build(np.zeros(len(space.free)))
    assert network.w_21 == network.w_12 == 0.5


@pytest.mark.parametrize('network, gait', [(network, gait) for network in ('biped', 'quadruped')
                                           for gait in ALL_PRESETS[network]])
def test_phase_errors_are_those_of_the_gait(network, gait):
    preset = ALL_PRESETS[network][gait]
    signals = solve_preset(preset).cycle(256)
    for other in preset.network.gaits():
        symmetry = preset.network.symmetry(other)
        errors = objectives.phase_errors(signals, symmetry)
        if other == gait:
            assert errors.max() < 1e-3
        elif symmetry.waves.max() == preset.network.symmetry(gait).waves.max() == 0:
            assert errors.max() > 60.0


def test_networks_that_do_not_oscillate_have_a_finite_penalty():
    rest, runaway = Biped.symmetric(0.0, 0.2, 0.0, 0.0, 0.0), Biped.symmetric(
        0.2, 0.2, -2.0, -2.0, -2.0)
    for score in objectives.evaluate([rest, runaway], 'skip', 0):
        assert np.isfinite(score.objectives).all() and not score.exact
        assert score.objectives[:2].tolist() == [180.0, 180.0] and score.shortfall > 1.0


def test_a_gait_with_more_symmetry_is_not_taken_for_one_with_less():
    # Table 2's walk has the phases of a skip; its two waveforms are one.
    score, = objectives.evaluate([PRESETS['walk'].network], 'hesitation_walk', 0)
    assert not score.exact and score.shortfall > 0.0


def test_a_lag_is_exact_whatever_the_waveform():
    theta = np.arange(256) / 256
    a = np.cos(2 * np.pi * theta) + 0.8 * np.sin(4 * np.pi * theta) - 0.3 * np.cos(
        14 * np.pi * theta)
    for shift in (0.0, 0.1234, 0.49, -0.3):
        assert lag(shifted(a, shift), a) == pytest.approx(shift, abs=1e-9)


def test_a_difference_in_shape_is_that_of_shapes():
    theta = np.arange(256) / 256
    a = np.cos(2 * np.pi * theta) + 0.5 * np.cos(4 * np.pi * theta)
    assert shape_difference(a, 3.0 * shifted(a, 0.3) + 2.0) == pytest.approx(0.0, abs=1e-6)
    assert shape_difference(a, 3.0 * shifted(a, 0.3), plain=True) == pytest.approx(2 / 3, abs=1e-6)
    # Harmonics that share nothing: sqrt 2.
    assert shape_difference(np.cos(2 * np.pi * theta), np.cos(6 * np.pi * theta)) == pytest.approx(
        np.sqrt(2.0))


def test_steadiness_is_1_for_a_circle_and_not_positive_for_two_turns():
    theta = 2 * np.pi * np.arange(256) / 256
    assert steadiness(np.cos(theta), 5.0 * np.sin(theta) + 3.0) == pytest.approx(1.0, abs=1e-3)
    assert steadiness(np.cos(2 * theta), np.sin(2 * theta)) <= 0.0
    assert steadiness(np.sin(theta), np.cos(theta)) <= 0.0


@pytest.mark.parametrize('gait', SECONDARY)
def test_shipped_secondary_gaits_are_stable_two_waved_readable_and_stand_noise(gait):
    preset = PRESETS[gait]
    orbit = solve_preset(preset)
    assert multipliers(orbit).leading < 0.7
    assert objectives.waveform_shortfall(orbit.cycle(nsga2.POINTS), orbit.symmetry) == 0.0
    PhaseReadout(orbit, np.zeros(1, int), np.zeros((1, 6)), np.array([0]), 3)
    assert nsga2.survives(orbit)


@pytest.mark.parametrize('network, gait', [(network, gait) for network in ('biped', 'quadruped')
                                           for gait in ALL_PRESETS[network]])
def test_shipped_presets_start_on_their_orbit(network, gait):
    preset = ALL_PRESETS[network][gait]
    orbit = solve_preset(preset)
    assert orbit(np.array(0.0)) == pytest.approx(preset.start, abs=1e-8)
    assert orbit.period == pytest.approx(preset.period, abs=1e-8)
    assert all(value == round(value, 4) for value in preset.network.as_dict().values())

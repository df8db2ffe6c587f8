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

"""Recordings as nobody here made them: read, fitted and written, or refused with the reason."""

import gzip
import json

from bags import joint_state, START, write_bag
from cpg_ros.fitting.gaits.stride import find_stride, NoSteadyGait
from cpg_ros.fitting.inversion import parameter_files, recording_fit
from cpg_ros.fitting.inversion.inversion import main
from cpg_ros.fitting.recordings.recording import Recording
from cpg_ros.motion.plan import PlanError
from cpg_ros.motion.robot_file import read_robot
from cpg_ros.networks.library.delayed import Delayed
from cpg_ros.networks.registry import PRESETS
from depth import in_depth, in_full
import numpy as np
import pytest
from walks import bag_of, LEGS, table_of, walked
import yaml

#: What is fitted fast.
FAST = ['--free', 'c', '--order', '2', '--json']


def said_of(capsys, *arguments):
    """Return what the executable says of a recording that it fits."""
    assert main([*map(str, arguments), *FAST]) == 0, capsys.readouterr().err
    said = capsys.readouterr()
    assert 'Warning' not in said.err
    return json.loads(said.out)


def trot_found(said, frequency=2.0):
    return said['gait'] == 'trot' and said['frequency'] == pytest.approx(frequency, rel=2e-3)


def test_three_cycles_are_written(tmp_path, capsys):
    path = table_of(tmp_path / 'walk.csv', *walked(seconds=1.5, noise=0.01))
    said = said_of(capsys, '--csv', path, '--out', tmp_path / 'fitted.yaml')
    assert trot_found(said)
    assert "joints are assigned to their leg's first cell" in said['read']
    tree = yaml.safe_load((tmp_path / 'fitted.yaml').read_text())['/**']['ros__parameters']
    assert len(read_robot(tree['robot']).joints) == 8


def test_what_the_generator_would_refuse_is_not_written(tmp_path, capsys, monkeypatch):
    path = table_of(tmp_path / 'walk.csv', *walked())
    asked = []

    def refused(robot, *rest):
        # From the file as it was written: of six digits or sixteen, and in the robot's own order.
        asked.append(robot.order)
        raise PlanError('the trot does not attract')

    monkeypatch.setattr(parameter_files, 'plan', refused)
    assert main(['--csv', str(path), '--out', str(tmp_path / 'fitted.yaml'), *FAST]) == 2
    assert 'the trot does not attract' in capsys.readouterr().err
    assert asked == [tuple(walked()[0])] and list(tmp_path.iterdir()) == [path]


def test_a_start_without_an_orbit_gives_way(tmp_path, capsys):
    path = table_of(tmp_path / 'walk.csv', *walked())
    said = said_of(capsys, '--csv', path, '--start', 'c=5', '--preset', 'goat_trot')
    assert trot_found(said) and said['rms_share'] < 0.05
    assert "not fitted as asked for: tau 0.25 is below the trot's critical delay" in ' '.join(
        said['warnings'])
    assert 'fitted from the start of the preset instead' in ' '.join(said['warnings'])


def test_what_is_never_run_leaves_the_presets_parameters(tmp_path, capsys, monkeypatch):
    path = table_of(tmp_path / 'walk.csv', *walked())
    network = PRESETS['delayed']['trot'].network
    monkeypatch.setattr(recording_fit, 'validate_orbit', lambda orbit, gait, harmonics: (
        '' if orbit.network.c == network.c else 'it is too far'))
    said = said_of(capsys, '--csv', path, '--start', 'c=6', '--report', tmp_path / 'report.html')
    assert trot_found(said) and said['parameters'] == {}
    assert 'it is too far' in said['warnings'][0]
    assert 'the parameters stay those of the preset' in said['warnings'][0]


def test_a_leg_stamped_in_simulated_time(tmp_path, capsys):
    names, t, angles = walked(noise=0.01)
    messages = []
    for time, row in zip(t, angles, strict=True):
        now = START + round(1e9 * time)
        messages += [('/most/joint_states', now, joint_state(now, names[:6], row[:6])),
                     ('/rf/joint_states', now, joint_state(1 + round(1e9 * time), names[6:],
                                                           row[6:]))]
    said = said_of(capsys, '--bag', write_bag(tmp_path / 'bag', messages))
    assert trot_found(said) and any('a different clock' in note for note in said['notes'])


@pytest.mark.parametrize('place', [0, 700, -1])
def test_a_stamp_far_from_all_others(tmp_path, capsys, place):
    names, t, angles = walked(noise=0.01)
    wrong = t + 1.7e9
    wrong[place] = 0.01 if place == 0 else wrong[place] + 365 * 86400.0
    found = [said_of(capsys, '--csv', table_of(tmp_path / 'walk.csv', names, wrong, angles))]
    messages = [('/joint_states', START + k, joint_state(round(1e9 * time), names, row))
                for k, (time, row) in enumerate(zip(wrong, angles, strict=True))]
    found.append(said_of(capsys, '--bag', write_bag(tmp_path / 'bag', messages)))
    for said in found:
        assert trot_found(said) and said['end'] < 13.0
        assert sum('1 sample stamped far from the others' in note for note in said['notes']) == 1


def test_a_pause_that_dwarfs_the_recording_divides_it(tmp_path, capsys):
    names, t, angles = walked(noise=0.01)
    path = table_of(tmp_path / 'walk.csv', names, np.where(t > 8.0, t + 5e4, t), angles)
    said = said_of(capsys, '--csv', path)
    assert trot_found(said) and 7.5 < said['end'] <= 8.0
    assert any(note.startswith('799 samples stamped far from') for note in said['notes'])


def test_a_position_beyond_all_joints(tmp_path, capsys):
    names, t, angles = walked(noise=0.01)
    angles[500:520, 3] = 1e300
    said = said_of(capsys, '--csv', table_of(tmp_path / 'walk.csv', names, t, angles))
    assert trot_found(said)
    assert "joint 'rh_knee': 20 positions far beyond the others, left out" in said['notes']


@pytest.mark.parametrize('angle', [1e7, -3e3])
def test_one_position_far_from_the_others_is_no_motion(tmp_path, capsys, angle):
    names, t, angles = walked(noise=0.01)
    plain = said_of(capsys, '--csv', table_of(tmp_path / 'plain.csv', names, t, angles))
    angles[500, 3] = angle
    said = said_of(capsys, '--csv', table_of(tmp_path / 'walk.csv', names, t, angles))
    assert trot_found(said)
    assert "joint 'rh_knee': 1 position far beyond the others, left out" in said['notes']
    assert said['rms_share'] == pytest.approx(plain['rms_share'], rel=0.05)
    for name, one in plain['parameters'].items():
        assert said['parameters'][name]['value'] == pytest.approx(one['value'], rel=0.02)


def test_two_robots_in_one_topic(tmp_path, capsys):
    names, t, angles = walked(noise=0.01)
    both = [f'{robot}_{name}' for robot in ('one', 'two') for name in names]
    bag = bag_of(tmp_path / 'bag', both, t, np.hstack([angles, angles[::-1]]))
    assert main(['--bag', str(bag), *FAST]) == 2
    said = capsys.readouterr().err
    assert 'two robots' in said and '--joints' in said and said.count('\n') == 1
    assert trot_found(said_of(capsys, '--bag', bag, '--joints', *both[:8]))


def rewritten(path, change):
    """Return a table whose lines are changed, but for the header."""
    head, *rows = path.read_text().splitlines()
    path.write_text('\n'.join([head, *map(change, rows)]) + '\n')


@pytest.mark.parametrize(('kind', 'words'), [
    ('commas', 'commas are taken for decimal points'), ('units', 'line 2 is taken for the units'),
    ('units and commas', 'line 2 is taken for the units'), ('gzip', ''),
    ('delimiters', 'lines that end in a delimiter'), ('sides', '')])
def test_tables_of_other_programs(tmp_path, capsys, kind, words):
    names, t, angles = walked(noise=0.01)
    if 'units' in kind:
        angles = np.degrees(angles)
    if kind == 'sides':
        names = [f'{joint}_{end}_{side}' for end in ('rear', 'front') for side in ('LT', 'RT')
                 for joint in ('hip', 'knee')]
    path = table_of(tmp_path / 'walk.csv', names, t, angles)
    if 'commas' in kind:
        path.write_text(path.read_text().replace(',', ';').replace('.', ','))
    if 'units' in kind:
        head, rest = path.read_text().split('\n', 1)
        mark = ';' if 'commas' in kind else ','
        path.write_text(f'{head}\ns{(mark + "deg") * len(names)}\n{rest}')
    elif kind == 'delimiters':
        rewritten(path, lambda row: row + ',')
    elif kind == 'gzip':
        path = tmp_path / 'walk.csv.gz'
        path.write_bytes(gzip.compress((tmp_path / 'walk.csv').read_bytes()))
    said = said_of(capsys, '--csv', path)
    assert trot_found(said)
    assert words in ' '.join(said['notes'])
    assert said['joints'][names[0]]['rms'] < 0.05


@pytest.mark.parametrize('degrees', ['yes', 'no'])
def test_opensims_files(tmp_path, capsys, degrees):
    names, t, angles = walked(noise=0.01)
    scaled = np.degrees(angles) if degrees == 'yes' else angles
    head = ['Coordinates', 'version=1', f'nRows={t.size}', f'nColumns={len(names) + 1}',
            f'inDegrees={degrees}', '', 'Units are S.I. units (second, meters, Newtons, ...)',
            'endheader', '\t'.join(['time', *names])]
    path = tmp_path / 'walk.mot'
    path.write_text('\n'.join([*head, *(
        '\t'.join(f'{value:16.8f}' for value in (time, *row))
        for time, row in zip(t, scaled, strict=True))]) + '\n')
    said = said_of(capsys, '--csv', path)
    assert trot_found(said) and max(one['rms'] for one in said['joints'].values()) < 0.02
    if degrees == 'yes':
        assert main(['--csv', str(path), '--unit', 'rad', *FAST]) == 2
        assert 'its preamble says deg, not rad' in capsys.readouterr().err


def test_a_cut_packed_table_ends_in_one_line(tmp_path, capsys):
    path = table_of(tmp_path / 'walk.csv', *walked())
    packed = tmp_path / 'walk.csv.gz'
    packed.write_bytes(gzip.compress(path.read_bytes())[:20000])
    assert main(['--csv', str(packed), *FAST]) == 2
    said = capsys.readouterr().err
    assert 'packed by gzip, and damaged' in said and said.count('\n') == 1


@pytest.mark.parametrize(('frequency', 'rate'), [
    (1.5, 3.3), (30.0, 100.0), *in_depth((1.5, 2.0), (1.5, 4.0))])
def test_too_few_samples_a_stride_are_doubted(tmp_path, capsys, frequency, rate):
    path = table_of(tmp_path / 'walk.csv', *walked(frequency=frequency, rate=rate,
                                                   seconds=90.0 / frequency))
    said = said_of(capsys, '--csv', path)
    assert 'samples a stride: a gait several times as fast would look the same' in ' '.join(
        said['warnings'])
    assert said['confidence'] <= 0.5


@pytest.mark.parametrize(('unit', 'scale'), [('ms', 1e3), ('us', 1e6)])
def test_times_in_a_unit_that_is_not_declared(tmp_path, capsys, unit, scale):
    names, t, angles = walked(frequency=1.5)
    path = table_of(tmp_path / 'walk.csv', names, scale * t, angles)
    said = said_of(capsys, '--csv', path)
    assert f'if the times are in {unit}, it is 1.5 Hz; declare it (--time {unit})' in ' '.join(
        said['warnings'])
    assert said['confidence'] < 0.05
    said = said_of(capsys, '--csv', path, '--time', unit)
    assert trot_found(said, 1.5) and said['confidence'] > 0.95 and not said['warnings']


def test_angles_in_a_unit_that_is_not_declared(tmp_path, capsys):
    names, t, angles = walked(frequency=1.5)
    path = table_of(tmp_path / 'walk.csv', names, t, np.degrees(angles))
    said = said_of(capsys, '--csv', path)
    assert 'if the angles are in degrees, declare it (--unit deg)' in ' '.join(said['warnings'])
    assert said['confidence'] <= 0.5
    assert said_of(capsys, '--csv', path, '--unit', 'deg')['confidence'] > 0.95


def test_a_trot_that_turns_into_a_pace_is_no_walk(tmp_path, capsys):
    names, t, angles = walked(seconds=20.0)
    # The fore legs slip back by half a cycle, at one frequency.
    slipped = np.clip(t - 0.25 * (t - 1.0) / 18.0, 0.0, None)
    fore = [np.interp(slipped, t, column) for column in angles.T[4:]]
    angles = np.array([*angles.T[:4], *fore]).T
    path = table_of(tmp_path / 'walk.csv', names, t[200:], angles[200:])
    if main(['--csv', str(path), *FAST]) == 0:
        said = json.loads(capsys.readouterr().out)
        assert 'the gait changes within the stretch' in ' '.join(said['warnings'])
        assert said['confidence'] < 0.3
    else:
        assert 'none of the gaits' in capsys.readouterr().err


def test_what_no_readout_follows_is_a_poor_fit(tmp_path, capsys):
    names, t, angles = walked(noise=0.01)
    # Each joint a rhythm of its own on top, of a waveform far from the cells'.
    for k, column in enumerate(angles.T):
        column += np.ptp(column) * np.sign(np.sin(2.0 * np.pi * (6.0 * t + 0.1 * k)))
    said = said_of(capsys, '--csv', table_of(tmp_path / 'walk.csv', names, t, angles))
    assert 'a poor fit: ' in said['warnings'][0] and said['confidence'] <= 0.5


def test_a_limp_is_said(tmp_path, capsys):
    names, t, angles = walked(noise=0.01)
    angles[:, 4:6] += 0.7 * (angles[:, 4:6].mean(axis=0) - angles[:, 4:6])
    said = said_of(capsys, '--csv', table_of(tmp_path / 'walk.csv', names, t, angles))
    assert trot_found(said)
    assert any(note.startswith('lf moves 0.3') for note in said['notes'])


@pytest.mark.parametrize('joint', range(4, 6))
def test_a_flipped_sign_is_said(tmp_path, capsys, joint):
    names, t, angles = walked(noise=0.01)
    angles[:, joint] *= -1.0
    said = said_of(capsys, '--csv', table_of(tmp_path / 'walk.csv', names, t, angles))
    assert trot_found(said) and said['confidence'] > 0.95
    assert f'taken to count angles in the opposite sense of lh: {names[joint]}' in said['notes']


def test_legs_whose_sense_nothing_tells_are_doubted(tmp_path, capsys):
    t = np.arange(1200) / 100.0
    # A trot of sines about zero whose right legs count the other way: it looks like a bound.
    phases, signs = np.array([0.0, 0.5, 0.5, 0.0]), np.array([1.0, -1.0, 1.0, -1.0])
    angles = signs * np.cos(2.0 * np.pi * (2.0 * t[:, None] + phases))
    names = ['lh_hip', 'rh_hip', 'lf_hip', 'rf_hip']
    said = said_of(capsys, '--csv', table_of(tmp_path / 'walk.csv', names, t, 0.3 * angles),
                   '--order', '1')
    assert 'the sign convention of rh, lf, rf is unknown' in ' '.join(said['warnings'])
    assert said['confidence'] <= 0.5


def test_confidence_is_calibrated():
    """Of gaits said with 95 % at least 90 % are right; made with known truth, well and badly."""
    rng = np.random.default_rng(19)
    truth = {'trot': (0.0, 0.5, 0.5, 0.0), 'pace': (0.0, 0.5, 0.0, 0.5),
             'bound': (0.0, 0.0, 0.5, 0.5), 'pronk': (0.0, 0.0, 0.0, 0.0),
             'walk': (0.0, 0.5, 0.75, 0.25), 'jump': (0.0, 0.0, 0.25, 0.25)}
    legs = {leg: (f'{leg}_hip', f'{leg}_knee') for leg in LEGS}
    sure = []
    draws = 150 if in_full() else 90
    for _ in range(draws):
        gait = str(rng.choice(list(truth)))
        frequency, samples = rng.uniform(0.5, 3.0), 10.0**rng.uniform(np.log10(2.2), 2.0)
        t = np.arange(max(int(rng.uniform(1.6, 20.0) * samples), 9)) / (frequency * samples)
        terms = rng.normal(size=(2, 3, 2)) * np.array([0.4, 0.15, 0.08])[:, None]
        phases = truth[gait] + rng.choice([0.01, 0.03, 0.06]) * rng.normal(size=4)
        turns = 2.0 * np.pi * np.arange(1, 4) * (frequency * t[:, None, None] + phases[:, None])
        angles = np.array([0.1, -1.2]) + np.einsum(
            'jn,tln->tlj', terms[..., 0], np.cos(turns)) + np.einsum(
            'jn,tln->tlj', terms[..., 1], np.sin(turns))
        angles = angles.reshape(t.size, 8)
        angles += rng.choice([0.0, 0.02, 0.1]) * np.ptp(angles, axis=0) * rng.normal(
            size=angles.shape)
        names = tuple(name for listed in legs.values() for name in listed)
        try:
            found = find_stride(Recording(names, t, angles, 'made up'), legs, Delayed)
        except NoSteadyGait:
            continue
        if found.confidence >= 0.95:
            sure.append(found.nearest == gait and abs(found.frequency / frequency - 1.0) < 0.05)
    assert len(sure) > draws / 6 and np.mean(sure) >= 0.9


def test_two_legs_that_walk_may_run(tmp_path, capsys):
    t = np.arange(2400) / 200.0
    turns = 2.0 * np.pi * (t[:, None] + np.array([0.0, 0.0, 0.5, 0.5]))
    angles = np.array([0.1, 0.6, 0.1, 0.6]) + 0.4 * np.cos(turns + np.array([0, 1, 0, 1]))
    # Nobody knows the knee.
    names = ['left_hip', 'left_lower', 'right_hip', 'right_lower']
    path = table_of(tmp_path / 'walk.csv', names, t, angles)
    assert main(['--csv', str(path), '--free', 'phi', '--order', '1', '--json']) == 0
    said = json.loads(capsys.readouterr().out)
    assert said['gait'] == 'walk' and said['confidence'] <= 0.5
    assert said['recognised'] is None and said['alike'] == ['walk', 'run']
    assert any('walk or run: cannot tell' in one and '(--gait)' in one for one in said['warnings'])

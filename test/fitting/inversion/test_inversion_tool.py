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

"""The executable inversion on recordings: what it says and writes, and what it refuses."""

from dataclasses import replace
import json
from pathlib import Path
import subprocess
import sys

from bags import storage_file
from cpg_ros.dynamics.solve_orbit import solve_orbit
from cpg_ros.fitting.inversion.inversion import main
from cpg_ros.fitting.inversion.parameter_files import write_fitted
from cpg_ros.fitting.inversion.recording_fit import fit_recording
from cpg_ros.fitting.recordings.recording import Recording
from cpg_ros.motion.pattern import Pattern
from cpg_ros.motion.plan import plan
from cpg_ros.motion.robot_file import load_robot, read_robot
from cpg_ros.networks.registry import PRESETS
from depth import in_depth
import numpy as np
import pytest
from walks import bag_of, LEGS, table_of, walked
import yaml


@pytest.fixture(scope='module')
def bag(tmp_path_factory):
    return bag_of(tmp_path_factory.mktemp('bags') / 'walk_bag', *walked(noise=0.02, stands=2.0),
                  storage='mcap')


def test_a_bag_in_a_gait_out(bag, tmp_path, capsys):
    out, report = tmp_path / 'fitted.yaml', tmp_path / 'report.html'
    assert main(['--bag', str(bag), '--out', str(out), '--report', str(report), '--json']) == 0
    said = json.loads(capsys.readouterr().out)
    assert said['gait'] == 'trot' and said['network'] == 'delayed'
    assert said['frequency'] == pytest.approx(2.0, rel=2e-3)
    for leg, phase in (('lh', 0.0), ('rh', 0.5), ('lf', 0.5), ('rf', 0.0)):
        assert abs((said['phases'][leg] - phase + 0.5) % 1.0 - 0.5) < 0.01
    assert set(said['joints']) == {f'{leg}_{joint}' for leg in LEGS for joint in ('hip', 'knee')}
    assert all(set(one) >= {'rms', 'rms_share'} for one in said['joints'].values())
    assert said['rms_share'] < 0.01
    # The recording was of a readout of order 2 and of c = 6.5, tau = 0.4.
    fractions = said['rms_share_by_order']
    assert fractions['3'] <= fractions['2'] * 1.01 < 0.2 * fractions['1']
    for name, truth in (('c', 6.5), ('tau', 0.4)):
        one = said['parameters'][name]
        assert one['low'] - 2.0 * one['stderr'] < truth < one['high'] + 2.0 * one['stderr']
    assert said['params']['a'] == -4.5 and said['stable_with_default_gain']
    assert 1.5 < said['begin'] < 3.0 and 13.0 < said['end'] < 14.5

    # The files load, and describe the recorded movement: evaluated here, cell by cell.
    tree = yaml.safe_load(out.read_text())['/**']['ros__parameters']
    assert tree['gait'] == 'trot' and tree['frequency'] == said['frequency']
    assert tree['delayed'] == said['params']
    robot = read_robot(tree['robot'])
    assert robot.order == tuple(name for name in walked()[0])
    # By itself, too, the robot file knows how fast.
    assert robot.motion('trot', 'trot').frequency == said['frequency']
    network = type(PRESETS['delayed']['trot'].network)(**tree['delayed'])
    orbit = solve_orbit(network, 'trot')
    theta = np.arange(100) / 100
    names, _, angles = walked(seconds=0.5)
    for joint in robot.joints:
        place = theta + orbit.phases[joint.cell - 1]
        x = orbit.waveform(place) / orbit.peak
        y = orbit.waveform(place, 1) / (2.0 * np.pi * orbit.peak)
        psi = np.array([x, y, x * x, x * y, x**3, x * x * y])[:len(joint.weights)]
        angle = joint.offset + np.array(joint.weights) @ psi
        wanted = angles[:, names.index(joint.name)]
        # In step with the orbit up to a shift.
        gaps = [np.abs(np.roll(angle, -shift) - wanted).max() for shift in range(100)]
        assert min(gaps) < 0.05 * np.ptp(wanted)
        assert joint.lower < angle.min() and angle.max() < joint.upper
    page = report.read_text()
    # Pictures are texts in which http may stand by chance.
    assert page.count('<img') == 4 and '://' not in page
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        'fitted.yaml', 'fitted_robot.yaml', 'report.html']


def test_a_table_in_degrees_as_text(tmp_path, capsys):
    names, t, angles = walked('liu2024_pace', frequency=1.5)
    path = table_of(tmp_path / 'walk.csv', names, t, np.degrees(angles), ' [deg]')
    assert main(['--csv', str(path), '--free', 'tau', '--order', '2']) == 0
    said = capsys.readouterr().out
    for words in ('1.5000', 'pace', 'legs read from the names', 'readout of order 2',
                  'Mean RMS error over range by order of the readout'):
        assert words in said
    # The same numbers in radians, by the option.
    path = table_of(tmp_path / 'plain.csv', names, t, angles)
    assert main(['--csv', str(path), '--free', 'tau', '--order', '2', '--unit', 'rad']) == 0
    assert said.splitlines()[5:12] == capsys.readouterr().out.splitlines()[5:12]


def test_several_starts_reach_one_minimum(tmp_path, capsys):
    path = table_of(tmp_path / 'walk.csv', *walked(noise=0.01))
    starts = [argument for value in (6.1, 6.3, 6.9, 7.2)
              for argument in ('--start', f'c={value}')]
    assert main(['--csv', str(path), '--free', 'c', *starts, '--json']) == 0
    said = json.loads(capsys.readouterr().out)
    ends = [start['end']['c'] for start in said['starts']]
    assert len(ends) == 4 and np.ptp(ends) < 1e-2 * said['parameters']['c']['stderr']


def test_a_robot_file_keeps_its_cells_and_limits(tmp_path, capsys):
    names, t, angles = walked()
    renamed = [name.replace('hip', 'upper').replace('knee', 'lower') for name in names]
    tree = {'network': 'delayed', 'legs': {
        leg: {'joints': [{'name': f'{leg}_{joint}', 'cell': cell, 'offset': 0.0, 'amplitude': 0.1,
                          'lower': -3.0, 'upper': 3.0, 'velocity': 40.0}
                         for joint in ('upper', 'lower', 'gripper')]}
        for leg, cell in LEGS.items()}}
    file = tmp_path / 'robot.yaml'
    file.write_text(yaml.safe_dump(tree))
    path = bag_of(tmp_path / 'bag', renamed, t, angles)
    out = tmp_path / 'fitted.yaml'
    assert main(['--bag', str(path), '--robot', str(file), '--out', str(out), '--json']) == 0
    said = json.loads(capsys.readouterr().out)
    assert 'not recorded: lf_gripper' in said['read'] and 'first cell' not in said['read']
    fitted = read_robot(tmp_path / 'fitted_robot.yaml')
    for joint in fitted.joints:
        assert (joint.lower, joint.upper, joint.velocity) == (-3.0, 3.0, 40.0)
        assert (joint.offset, joint.weights) == (0.0, (0.1,))
        moved = fitted.motion('trot', 'trot').joints.get(joint.name)
        assert moved is None if 'gripper' in joint.name else len(moved.weights) == 6


def test_a_table_may_leave_out_the_ending_of_a_robots_joints(tmp_path, capsys):
    path = table_of(tmp_path / 'walk.csv', *walked())
    file, words = tmp_path / 'robot.yaml', ['--csv', str(path), '--free', 'tau', '--json']
    for ending, code in (('_joint', 0), ('_motor', 2)):
        file.write_text(yaml.safe_dump({'network': 'delayed', 'legs': {leg: {'joints': [
            {'name': f'{leg}_{joint}{ending}', 'cell': cell, 'offset': 0.0, 'amplitude': 0.1,
             'lower': -3.0, 'upper': 3.0, 'velocity': 40.0} for joint in ('hip', 'knee')]}
            for leg, cell in LEGS.items()}}))
        assert main([*words, '--robot', str(file)]) == code
        said = capsys.readouterr()
        if code:
            assert 'the robot has' in said.err and 'lf_hip_motor' in said.err
        else:
            assert set(json.loads(said.out)['joints']) == {
                f'{leg}_{joint}_joint' for leg in LEGS for joint in ('hip', 'knee')}


# A file with gaits of its own, geometry, feedback and steering; one with a body of a biped.
@pytest.mark.parametrize(('name', 'gait', 'frequency'), [
    ('unitree_go2', 'trot', 1.8), *in_depth(('humanoid', 'walk', 1.2))])
def test_the_rest_of_a_robot_file_is_kept(tmp_path, name, gait, frequency):
    robot = load_robot(name)
    leg, *_ = robot.legs
    robot = replace(robot, legs=robot.legs | {leg: tuple(
        replace(joint, invented=('velocity',)) for joint in robot.legs[leg])})
    network, path = robot.networks[0], tmp_path / 'fitted.yaml'
    preset = PRESETS[network][gait]
    ready = plan(robot, gait, preset, preset.network, frequency)
    pattern = Pattern(ready, 1.0)
    rows = []
    for _ in range(1200):
        pattern.advance(0.01)
        rows.append(pattern.position.copy())
    recording = Recording(tuple(joint.name for joint in robot.joints), np.arange(900) / 100.0,
                          np.array(rows[300:]), 'made up')
    write_fitted(path, fit_recording(recording, robot, network, gait), robot)
    found = read_robot(tmp_path / 'fitted_robot.yaml')
    motions = dict(found.motions)
    fitted, known = motions.pop(gait), robot.motion(gait, gait)
    others = {other: motion for other, motion in robot.motions.items() if other != gait}
    assert replace(found, name=robot.name, motions=motions) == replace(robot, motions=others)
    assert (fitted.steering, fitted.efference, fitted.stance) == (
        known.steering, known.efference, known.stance)
    assert fitted.frequency == pytest.approx(frequency, rel=2e-3)
    again = plan(found, gait, preset, preset.network, frequency)
    span = np.ptp(ready.span, axis=0)
    assert np.abs(again.shift - ready.shift).max() < 0.05 * span.max()


@pytest.mark.parametrize(('limits', 'words'), [
    ((-1.7, 0.2, 40.0), 'robot robot cannot do this: amplitude 1 takes'),
    ((-3.0, 3.0, 0.5), 'robot robot cannot do this: frequency'),
    ((2.0, 3.0, 40.0), "rad, outside the robot file's limits 2 to 3")])
def test_what_a_robots_limits_forbid_is_not_written(tmp_path, capsys, limits, words):
    names, t, angles = walked()
    tree = {'network': 'delayed', 'legs': {
        leg: {'joints': [{'name': name, 'cell': cell, 'offset': limits[1], 'amplitude': 0.0,
                          **dict(zip(('lower', 'upper', 'velocity'), limits, strict=True))}
                         for name in names if name.startswith(leg)]}
        for leg, cell in LEGS.items()}}
    file = tmp_path / 'robot.yaml'
    file.write_text(yaml.safe_dump(tree))
    path = bag_of(tmp_path / 'bag', names, t, angles)
    assert main(['--bag', str(path), '--robot', str(file), '--out',
                 str(tmp_path / 'fitted.yaml'), '--report', str(tmp_path / 'a.html')]) == 2
    said = capsys.readouterr()
    assert words in said.err and said.err.count('\n') == 1, said.err
    assert sorted(one.name for one in tmp_path.iterdir()) == ['bag', 'robot.yaml']


def test_the_papers_own_procedure(tmp_path, capsys):
    # Eight joints that are the cells of a trot with c = 6.43, about their offsets; section 4.1.
    network = replace(PRESETS['delayed']['goat_trot'].network)
    orbit = solve_orbit(network, 'trot')
    goat = yaml.safe_load(Path('config/goat.yaml').read_text())
    cells = {joint['name']: joint['cell'] for leg in goat['legs'].values()
             for joint in leg['joints']}
    t = np.arange(2400) / 200.0
    rng = np.random.default_rng(0)
    angles = np.array([0.3 + orbit.waveform(1.3 * t + 0.37 + orbit.phases[cell - 1])
                       for cell in cells.values()]).T
    path = table_of(tmp_path / 'goat.csv', list(cells), t,
                    angles + 0.01 * rng.standard_normal(angles.shape))
    starts = [part for value in (6.1, 6.3, 6.9, 7.2) for part in ('--start', f'c={value}')]
    base = ['--csv', str(path), '--robot', 'goat', '--preset', 'goat_trot', '--free',
            'c', '--paper']
    assert main([*base, *starts, '--json']) == 0
    fits = json.loads(capsys.readouterr().out)['paper']
    ends = [fit['end']['c'] for fit in fits]
    assert np.ptp(ends) < 1e-4 and len(ends) == 4
    assert ends[0] == pytest.approx(6.43, rel=0.01)
    assert all(fit['error'] < 0.1 and fit['iterations'] > 0 for fit in fits)
    assert main(base) == 0
    said = capsys.readouterr().out
    assert 'numerical solution' in said and 'synchronisation errors [rad]' in said
    assert main(['--csv', str(path), '--free', 'c', '--paper', '--gait', 'trot']) == 2
    assert 'one joint for each of the eight cells' in capsys.readouterr().err


@pytest.mark.parametrize('signals', ['stand', 'pose', 'noise'])
def test_what_is_no_gait_is_refused_and_not_fitted(tmp_path, capsys, signals):
    names, t, angles = walked()
    rng = np.random.default_rng(1)
    if signals == 'stand':
        angles = np.tile(angles[0], (t.size, 1)) + 1e-4 * rng.standard_normal(angles.shape)
    elif signals == 'pose':
        # All legs together, up and down, each time for another while.
        turns = np.interp(t, np.sort(rng.uniform(0.0, t[-1], 9)), np.arange(9) % 2)
        angles = angles[0] + 0.3 * turns[:, None] * np.ones(angles.shape[1])
    else:
        angles = rng.standard_normal(angles.shape)
    path, out = table_of(tmp_path / 'walk.csv', names, t, angles), tmp_path / 'fitted.yaml'
    assert main(['--csv', str(path), '--out', str(out)]) == 1
    said = capsys.readouterr()
    assert 'no steady gait' in said.err and said.err.count('\n') == 1 and said.out == ''
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize(('arguments', 'words'), [
    ((), 'one of the arguments --bag --bags --csv --mot --trc'),
    (('--bag', 'x', '--csv', 'y'), 'not allowed with'),
    (('--bag', 'nowhere'), 'nowhere'),
    (('--csv', '{csv}', '--topics', '/a'), '--topics: a CSV file has none'),
    (('--bag', '{bag}', '--unit', 'deg'), '--unit: joint states are in rad'),
    (('--bag', '{bag}', '--topics', '/other'), '/other'),
    (('--bag', '{bag}', '--robot', 'nothing'), "robot 'nothing' is neither"),
    (('--bag', '{bag}', '--robot', 'goat'), "no joints 'lh_tarsal_joint'"),
    (('--bag', '{bag}', '--network', 'hexapod'), "'hexapod' is not one of"),
    (('--bag', '{bag}', '--network', 'biped'), 'biped'),
    (('--bag', '{bag}', '--gait', 'canter'), "'canter'"),
    (('--bag', '{bag}', '--free', 'speed'), "'speed'"),
    (('--bag', '{bag}', '--free', 'c', 'c'), 'c is given twice'),
    (('--bag', '{bag}', '--order', '4'), '--order'),
    (('--bag', '{bag}', '--start', 'c=x'), "'x' is not a number"),
    (('--bag', '{bag}', '--free', 'c', '--start', 'tau=1'), 'tau'),
    (('--bag', '{bag}', '--out', 'nowhere/a.yaml'), 'there is no folder nowhere'),
    (('--bag', '{bag}', '--out', 'a.txt'), 'does not end in .yaml'),
    (('--csv', '{csv}', '--kp', '60'), '--kp: a CSV file has no efforts'),
    (('--bag', '{bag}', '--kp', '60'), 'no effort of joints'),
    (('--bag', '{bag}', '--kp', '-3'), 'kp -3 is not from 0.001'),
    (('--bag', '{bag}', '--kp', 'nan'), 'kp nan is not from 0.001'),
    (('--bag', '{bag}', '--kd', '2'), '--kd: without --kp'),
    (('--csv', '{csv}', '--unit', 'grad'), '--unit')])
def test_nonsense_ends_in_one_line(bag, tmp_path, capsys, arguments, words):
    table = table_of(tmp_path / 'walk.csv', *walked(seconds=3.0))
    given = [part.format(bag=bag, csv=table) for part in arguments]
    try:
        code = main(given)
    except SystemExit as ended:
        code = ended.code
    said = capsys.readouterr()
    assert code == 2 and words in said.err, said.err
    assert said.err.startswith('inversion: ') and said.err.count('\n') == 1 and said.out == ''
    assert list(tmp_path.iterdir()) == [table]


@pytest.mark.parametrize('damage', ['cut', 'nan', *in_depth('text', 'one sample', 'no time')])
def test_damaged_input_ends_in_one_line(tmp_path, damage):
    names, t, angles = walked(seconds=3.0)
    path, kind = tmp_path / 'walk.csv', '--csv'
    if damage == 'cut':
        path, kind = bag_of(tmp_path / 'bag', names, t, angles), '--bag'
        file = storage_file(path)
        file.write_bytes(file.read_bytes()[:3000])
    elif damage == 'text':
        table_of(path, names, t, angles)
        path.write_text(path.read_text().replace('\n0.500000,', '\nsoon,'))
    elif damage == 'nan':
        angles[:, 3] = np.nan
        table_of(path, names, t, angles)
    elif damage == 'one sample':
        table_of(path, names, t[:1], angles[:1])
    else:
        table_of(path, names, 0.0 * t, angles)
    out = tmp_path / 'fitted.yaml'
    ended = subprocess.run([sys.executable, '-P', '-m', 'cpg_ros.fitting.inversion.inversion',
                            kind, str(path),
                            '--out', str(out)], capture_output=True, text=True, timeout=120)
    assert ended.returncode == 2 and ended.stdout == ''
    assert ended.stderr.count('\n') == 1 and str(path) in ended.stderr
    assert not out.exists() and not (tmp_path / 'fitted_robot.yaml').exists()

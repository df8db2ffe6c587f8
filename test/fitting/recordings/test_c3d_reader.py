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

"""C3D files that ezc3d wrote: markers come back, and damaged files end in one line."""

import sys

from cpg_ros.common.errors import MissingLibraryError
from cpg_ros.fitting.recordings import reader_process
from cpg_ros.fitting.recordings.c3d_reader import c3d_markers, read_c3d
from cpg_ros.fitting.recordings.recording import RecordingError
from depth import in_full
import ezc3d
import numpy as np
import pytest
from skeletons import angles, LABELS, places

TIME = np.arange(40) / 200.0


@pytest.fixture
def path(tmp_path):
    file = ezc3d.c3d()
    file['parameters']['POINT']['RATE']['value'] = [200]
    file['parameters']['POINT']['LABELS']['value'] = [f'Anna:{name}' for name in LABELS]
    points = 1000.0 * places(angles(TIME)).transpose(2, 1, 0)
    points[:, 4, 7] = np.nan
    file['data']['points'] = np.concatenate([points, np.ones_like(points[:1])])
    file.write(str(tmp_path / 'walk.c3d'))
    return tmp_path / 'walk.c3d'


def test_markers_and_rate_come_back(path):
    found = c3d_markers(path)
    assert found.names == LABELS
    assert found.stamps == pytest.approx(1e9 * TIME)
    expected = 1000.0 * places(angles(TIME))
    expected[7, 4] = np.nan
    # Single precision, of lengths in mm.
    np.testing.assert_allclose(found.points, expected, atol=1e-3)
    recording = read_c3d(path, 'human_plug_in_gait', ['right_*'])
    assert recording.joints == ('right_hip', 'right_knee', 'right_ankle')
    assert recording.positions == pytest.approx(angles(TIME)[:, 3:], abs=1e-4)


@pytest.mark.parametrize('style', ['contexts', 'letters'])
def test_events_say_which_foot_is_on_the_ground(path, style):
    file = ezc3d.c3d(str(path))
    events = [('Left', 'Foot Off', 0.02), ('Right', 'Foot Off', 0.07),
              ('Right', 'Foot Strike', 0.1), ('Left', 'Foot Strike', 0.05),
              ('Left', 'Foot Off', 0.12), ('Right', 'Foot Off', 0.16),
              ('Left', 'Foot Strike', 0.15)]
    labels = [label if style == 'contexts' else side[0] + ('TO' if 'Off' in label else 'HS')
              for side, label, _ in events]
    file.add_parameter('EVENT', 'LABELS', labels)
    if style == 'contexts':
        file.add_parameter('EVENT', 'CONTEXTS', [side for side, *_ in events])
    # Minutes and seconds, from the first frame of the trial, of which the file begins at the 21st.
    file.add_parameter('EVENT', 'TIMES', np.array([[0.0] * 7, [t + 0.101 for *_, t in events]]))
    file['header']['points']['first_frame'] = 20
    file.write(str(path))
    found = read_c3d(path, 'human_plug_in_gait')
    assert found.loads.legs == ('left', 'right')
    # Both are known from .071 to .151 s: before, nobody has seen the right foot.
    assert found.loads.times == pytest.approx(np.arange(0.075, 0.1501, 0.005))
    t = found.loads.times + 1e-9
    assert found.loads.loads[:, 0].tolist() == (t < 0.121).astype(float).tolist()
    assert found.loads.loads[:, 1].tolist() == (t > 0.101).astype(float).tolist()


def walk_over_plates(path, kind, missed=()):
    """Write 7 s of a walk on two belts, 1 stride a second; return the feet's loads, N.

    The left foot lands beside its belt in the seconds missed.
    """
    time = np.arange(700) / 100.0
    file = ezc3d.c3d()
    file['parameters']['POINT']['RATE']['value'] = [100]
    file['parameters']['POINT']['LABELS']['value'] = list(LABELS)
    file['parameters']['ANALOG']['RATE']['value'] = [200]
    points = 1000.0 * places(angles(time)).transpose(2, 1, 0)
    loads = []
    for side, lead in (('L', 0.0), ('R', 0.5)):
        down = (time + lead) % 1.0 < 0.6
        for second in missed:
            down &= ~((side == 'L') & (time.astype(int) == second))
        loads.append(700.0 * down)
        for name in ('HEE', 'TOE'):
            row = points[:, LABELS.index(side + name)]
            row[0], row[1] = 150.0 * (name == 'TOE'), 200.0 if side == 'L' else -200.0
            row[2] = np.where(down, 0.0, 80.0)
    wide = {1: 6, 2: 6, 3: 8, 4: 6}[kind]
    analogs = np.zeros((1, 2 * wide, 1400))
    for k, load in enumerate(loads):
        vertical = slice(4, 8) if kind == 3 else slice(2, 3)
        analogs[0, k * wide:(k + 1) * wide][vertical] = -np.repeat(load, 2) / (
            4.0 if kind == 3 else 100.0 if kind == 4 else 1.0)
    corners = np.array([[[x, y + across, 0.0] for x, across in (
        (500.0, 300.0), (500.0, -100.0), (-500.0, -100.0), (-500.0, 300.0))]
        for y in (100.0, -300.0)])
    file.add_parameter('FORCE_PLATFORM', 'USED', [2])
    file.add_parameter('FORCE_PLATFORM', 'TYPE', [kind, kind])
    file.add_parameter('FORCE_PLATFORM', 'CORNERS', corners.transpose(2, 1, 0))
    file.add_parameter('FORCE_PLATFORM', 'CHANNEL',
                       1.0 + np.arange(2 * wide).reshape(2, wide).T)
    file.add_parameter('FORCE_PLATFORM', 'CAL_MATRIX', np.repeat(
        100.0 * np.eye(6)[..., None], 2, axis=2))
    file['parameters']['ANALOG']['LABELS']['value'] = [f'A{k}' for k in range(2 * wide)]
    file['data']['points'] = np.concatenate([points, np.ones_like(points[:1])])
    file['data']['analogs'] = analogs
    file.write(str(path))
    return loads


@pytest.mark.parametrize('kind', [1, 2, 3, 4])
def test_force_plates_say_which_foot_is_on_the_ground(tmp_path, kind):
    loads = walk_over_plates(tmp_path / 'belts.c3d', kind)
    found = read_c3d(tmp_path / 'belts.c3d', 'human_plug_in_gait')
    assert 'which foot is on the ground is taken from the force plates' in found.notes
    assert found.loads.legs == ('left', 'right') and not found.loads.by_motion
    assert found.loads.times[-1] - found.loads.times[0] >= 4.0
    for column, load in zip(found.loads.loads.T, loads, strict=True):
        expected = np.interp(found.loads.times, np.arange(700) / 100.0, load) > 20.0
        assert np.array_equal(column > 0.0, expected)


def test_feet_that_land_beside_plates_are_not_taken_for_lifted(tmp_path):
    walk_over_plates(tmp_path / 'belts.c3d', 2, missed=(1, 3, 5))
    found = read_c3d(tmp_path / 'belts.c3d', 'human_plug_in_gait')
    assert not any('force plates' in note for note in found.notes)


def test_a_cut_file_is_read_as_far_as_it_goes(path):
    data = path.read_bytes()
    path.write_bytes(data[:-20 * len(LABELS) * 16])
    found = c3d_markers(path)
    assert len(found.stamps) < 40
    assert found.notes == (f'{len(found.stamps)} frames, where the header states 40: it may be '
                           'cut',)


@pytest.mark.parametrize(('library', 'words'), [
    ('import os, signal; os.kill(os.getpid(), signal.SIGSEGV)', 'ended with SIGSEGV'),
    ('while True: pass', 'not read within 1 s of processor time'),
    ('bytearray(10**11)', 'more memory than')], ids=['crash', 'hang', 'memory'])
def test_what_the_library_does_ends_nothing_but_its_process(path, tmp_path, monkeypatch, library,
                                                            words):
    (tmp_path / 'ezc3d.py').write_text(library)
    monkeypatch.setenv('PYTHONPATH', str(tmp_path))
    monkeypatch.setattr(reader_process, 'MAX_CPU_TIME', 1.0)
    with pytest.raises(RecordingError, match=words) as error:
        read_c3d(path)
    assert str(error.value).startswith(f'{path}: ') and '\n' not in str(error.value)


def test_mutations_of_a_file_are_read_or_refused(path):
    data, rng = path.read_bytes(), np.random.default_rng(1)
    for k in range(100):
        mutant = bytearray(data)
        for at in rng.integers(2, 512 * 3 if k % 2 else 40, 4):
            mutant[at] = rng.integers(256)
        # The last of these makes ezc3d 1.7.2 end the process.
        if not in_full() and k not in (4, 7, 25):
            continue
        path.write_bytes(mutant)
        try:
            c3d_markers(path)
        except RecordingError as error:
            assert str(error).startswith(f'{path}: ') and '\n' not in str(error)


def modelled(path, unit='deg'):
    """Write angles as Plug-in Gait does, beside two markers; return the flexion of a knee, deg."""
    file = ezc3d.c3d()
    names = ['LASI', 'RASI', 'LKneeAngles', 'RKneeAngles', 'LHeadAngles', 'RHeadAngles']
    flexion = 30.0 - 30.0 * np.cos(2.0 * np.pi * 1.1 * TIME)
    head = (170.0 + 400.0 * TIME + 180.0) % 360.0 - 180.0
    points = np.ones((4, len(names), len(TIME)))
    points[0, 2:5] = flexion, flexion[::-1], head
    if unit == 'rad':
        points[0, 2:5] = np.radians(points[0, 2:5])
    points[:3, 2, :3] = 0.0       # no value yet
    points[:3, 5] = 0.0           # never one
    file['parameters']['POINT']['RATE']['value'] = [200]
    file['parameters']['POINT']['LABELS']['value'] = [f'Anna:{name}' for name in names]
    file.add_parameter('POINT', 'ANGLES', [f'Anna:{name}' for name in names[2:]])
    if unit:
        file.add_parameter('POINT', 'ANGLE_UNITS', [unit])
    file['data']['points'] = points
    file.write(str(path))
    return flexion, 170.0 + 400.0 * TIME


def test_angles_of_a_model_are_joints(tmp_path):
    path = tmp_path / 'model.c3d'
    flexion, head = modelled(path)
    found = read_c3d(path)
    assert found.joints == ('LKneeAngles', 'RKneeAngles', 'LHeadAngles')
    assert np.isnan(found.positions[:3, 0]).all()
    assert found.positions[3:, 0] == pytest.approx(np.radians(flexion[3:]), abs=1e-5)
    assert found.positions[:, 2] == pytest.approx(np.radians(head), abs=1e-5)
    assert "without a value, left out: 'RHeadAngles'" in found.notes
    assert 'first component' in ' '.join(found.notes)
    assert read_c3d(path, joints=['*Knee*']).joints == ('LKneeAngles', 'RKneeAngles')
    with pytest.raises(RecordingError, match=r"model\.c3d: no value of 'RHeadAngles'"):
        read_c3d(path, joints=['RHeadAngles'])
    with pytest.raises(RecordingError, match='no marker'):  # segments are of the markers
        read_c3d(path, 'human_plug_in_gait')


@pytest.mark.parametrize('unit', ['rad', ''])
def test_the_unit_of_angles_is_that_of_the_file(tmp_path, unit):
    path = tmp_path / 'model.c3d'
    flexion, _ = modelled(path, unit)
    found = read_c3d(path, joints=['LKneeAngles'])
    # Instants at which no joint has a value are none of the recording.
    assert found.positions[:, 0] == pytest.approx(np.radians(flexion[3:]), abs=1e-5)
    assert ('angles are taken to be in degrees' in ' '.join(found.notes)) == (unit == '')


def test_an_unknown_unit_is_named(tmp_path):
    path = tmp_path / 'model.c3d'
    modelled(path, 'gon')
    with pytest.raises(RecordingError, match="ANGLE_UNITS is 'gon', not deg or rad"):
        read_c3d(path)


@pytest.mark.parametrize('data', [b'', b'C3D', b'\x02\x50' * 100, b'\x02P' + bytes(2000),
                                  b'\x00P' + bytes(2000), b'\xff' * 4000])
def test_what_is_none_ends_in_one_line(tmp_path, data):
    path = tmp_path / 'walk.c3d'
    path.write_bytes(data)
    with pytest.raises(RecordingError, match=r'walk\.c3d: not a (readable )?C3D file') as raised:
        c3d_markers(path)
    assert '\n' not in str(raised.value)


def test_without_the_library_the_line_says_how_to_get_it(path, monkeypatch):
    hook = sys.excepthook
    monkeypatch.setattr('cpg_ros.common.errors.find_spec', lambda name: None)
    monkeypatch.setattr(sys, 'excepthook', hook)
    with pytest.raises(MissingLibraryError, match=r'cpg_ros needs ezc3d, .*/pip install ezc3d'):
        c3d_markers(path)

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

"""Walk or run: told by how the body falls, or by the user; never by the joints alone."""

from cpg_ros.fitting.gaits.stride import NoSteadyGait
from cpg_ros.fitting.inversion.gait_schedule import cut
from cpg_ros.fitting.inversion.recording_fit import fit_recording, leg_joints, stride_of
from cpg_ros.fitting.inversion.stride_report import gait_summary, strides_of
from cpg_ros.fitting.recordings.formats import read_recording
from cpg_ros.networks.library.biped import Biped
import numpy as np
import pytest
from skeletons import LABELS, trc

RATE, GRAVITY = 100.0, 9.81


def legs_at(t, frequency):
    """Return hip and knee of the left and the right leg, rad, shape (n, 4)."""
    turn = 2.0 * np.pi * frequency * t
    return np.column_stack([joint for shift in (0.0, np.pi) for joint in (
        0.2 + 0.4 * np.cos(turn + shift), 0.5 + 0.4 * np.cos(turn + shift - 1.9))])


def height(t, frequency, flight):
    """Return the height of a body, m, over feet that push by a half sine between flights.

    With a flight of 0 it goes up and down by 2 cm, as a body over stiff legs does.
    """
    if not flight:
        return 1.0 + 0.02 * np.cos(4.0 * np.pi * frequency * t)
    cycle = np.arange(4096) / 4096
    push = np.where(cycle < 1.0 - flight, np.sin(np.pi * cycle / (1.0 - flight)), 0.0)
    terms = np.fft.rfft(GRAVITY * (push / push.mean() - 1.0)) / 4096
    turn = 2.0 * np.pi * 2.0 * frequency * np.arange(1, terms.size)
    return 1.0 - 2.0 * (np.exp(1j * np.outer(t, turn[:60])) @ (terms[1:] / turn**2)[:60]).real


def motion(path, frequency, flight, seconds=4.0, speed=0.0, unit='deg'):
    """Write a motion of OpenSim: two legs, and the pelvis, which is in m whatever the angles."""
    t = np.arange(round(RATE * seconds)) / RATE
    angles = legs_at(t, frequency)
    rows = np.column_stack([t, np.degrees(angles) if unit == 'deg' else angles, speed * t,
                            height(t, frequency, flight)])
    names = ['time', 'hip_flexion_l', 'knee_angle_l', 'hip_flexion_r', 'knee_angle_r',
             'pelvis_tx', 'pelvis_ty']
    path.write_text(f'walk\nversion=1\ninDegrees={"yes" if unit == "deg" else "no"}\nendheader\n'
                    + '\t'.join(names) + '\n' + '\n'.join(
                        '\t'.join(f'{x:.8f}' for x in row) for row in rows) + '\n')
    return path


def stride(path, gait='', **options):
    recording = read_recording(path, progress=False, **options)
    return stride_of(recording, leg_joints(recording, None)[0], Biped, None, gait)[1]


@pytest.mark.parametrize('unit', ['deg', 'rad'])
@pytest.mark.parametrize(('frequency', 'flight', 'name'), [
    (0.9, 0.0, 'walk'), (1.1, 0.0, 'walk'), (1.4, 0.3, 'run'), (1.45, 0.5, 'run')])
def test_a_body_that_falls_freely_runs(tmp_path, frequency, flight, name, unit):
    found = stride(motion(tmp_path / 'ik.mot', frequency, flight, unit=unit))
    assert found.verdict == name and found.confidence > 0.95 and not found.issues
    assert any(f'{name}, by the height of the body, which falls freely in' in note
               for note in found.notes)


def test_markers_give_the_height_whatever_axis_is_up(tmp_path):
    t = np.arange(400) / RATE
    rng = np.random.default_rng(4)
    for flight, frequency, name in ((0.0, 0.95, 'walk'), (0.35, 1.4, 'run')):
        angles = legs_at(t, frequency)
        points = {}
        for k, side in enumerate('LR'):
            hip, knee = angles[:, 2 * k], angles[:, 2 * k + 1]
            top = np.column_stack([0.0 * t, np.full_like(t, 0.1 - 0.2 * k),
                                   height(t, frequency, flight)])
            middle = top + 0.45 * np.column_stack([np.sin(hip), 0.0 * t, -np.cos(hip)])
            low = middle + 0.42 * np.column_stack([np.sin(hip - knee), 0.0 * t,
                                                   -np.cos(hip - knee)])
            ahead = np.array([0.05, 0.0, 0.0])
            points |= {f'{side}ASI': top + ahead, f'{side}PSI': top - ahead,
                       f'{side}KNE': middle, f'{side}ANK': low,
                       f'{side}HEE': low - ahead, f'{side}TOE': low + 3.0 * ahead}
        places = np.stack([points[label] for label in LABELS], axis=1)
        places = places + rng.normal(0.0, 5e-4, places.shape)
        for axes in ((0, 1, 2), (0, 2, 1)):
            path = tmp_path / 'walk.trc'
            path.write_text(trc(t, places[:, :, axes]))
            assert stride(path, segments='human_plug_in_gait').verdict == name


def test_a_users_gait_ends_the_question(tmp_path):
    path = tmp_path / 'walk.csv'
    t = np.arange(400) / RATE
    np.savetxt(path, np.column_stack([t, legs_at(t, 1.0)]), '%.6f', ',', comments='',
               header='time,left_hip,left_knee,right_hip,right_knee')
    told = stride(path)
    assert told.verdict == 'walk or run: cannot tell' and told.confidence <= 0.5
    for gait in ('walk', 'run'):
        found = stride(path, gait)
        assert found.verdict == gait and found.confidence > 0.95 and not found.issues
    fitted = fit_recording(read_recording(path, progress=False), gait='run', order=1,
                           free=['current'])
    assert fitted.fit.gait == 'run'
    assert not any('cannot tell, the legs' in line or 'phases are those' in line
                   for line in fitted.warnings)


def joints_of(columns, seconds=8.0):
    """Return the lines of a table of joints, by leg of a biped, as functions of phase (rad)."""
    t = np.arange(round(RATE * seconds)) / RATE
    names, rows = ['time'], [t]
    for side, shift in (('left', 0.0), ('right', np.pi)):
        turn = 2.0 * np.pi * 1.1 * t + shift
        for name, angle in columns.items():
            names.append(name.format(side=side, S=side[0].upper()))
            rows.append(angle(turn))
    return names, np.column_stack(rows)


def hip(turn):
    return 0.2 + 0.3 * np.cos(turn)


def knee(turn):
    return 0.6 + 0.5 * np.cos(turn - 1.9)


@pytest.mark.parametrize('columns', [
    # Cassie's tarsus is driven by its knee through a rod; Vicon writes a knee twice.
    {'{side}_hip': hip, '{side}_knee': knee, '{side}_tarsus': lambda turn: 0.23 - knee(turn)},
    {'{S}HipAngles': hip, '{S}KneeAngles': knee, '{S}ViconKneeAngles': knee,
     '{S}PelvisAngles': lambda turn: 1.5 * np.cos(turn),
     '{S}ThoraxAngles': lambda turn: 1.5 * np.cos(turn),
     '{S}FootProgressAngles': lambda turn: 1.5 * np.cos(turn)}], ids=['rod', 'twice'])
def test_joints_that_copy_another_do_not_step_on_the_spot(tmp_path, columns):
    names, rows = joints_of(columns)
    path = tmp_path / 'walk.csv'
    np.savetxt(path, rows, '%.6f', ',', comments='', header=','.join(names))
    found = stride(path)
    assert not any('on the spot' in issue for issue in found.issues)
    assert not any('Pelvis' in name or 'Thorax' in name or 'Progress' in name
                   for name in found.joints)


def test_legs_that_step_on_the_spot_are_doubted_unless_the_body_goes_on(tmp_path):
    names, rows = joints_of({'{side}_hip': lambda turn: 0.2 + 0.2 * np.cos(turn),
                             '{side}_knee': lambda turn: 0.6 + 0.4 * np.cos(turn)})
    path = tmp_path / 'walk.csv'
    np.savetxt(path, rows, '%.6f', ',', comments='', header=','.join(names))
    assert any('on the spot' in issue for issue in stride(path).issues)
    head = 'walk\nversion=1\ninDegrees=no\nendheader\n' + '\t'.join(
        [*names, 'pelvis_tx', 'pelvis_ty', 'pelvis_tz']) + '\n'
    for speed, doubted in ((0.0, True), (1.2, False)):
        place = np.column_stack([speed * rows[:, 0], height(rows[:, 0], 1.1, 0.0), 0 * rows[:, 0]])
        path = tmp_path / 'ik.mot'
        path.write_text(head + '\n'.join('\t'.join(f'{x:.6f}' for x in row)
                                         for row in np.hstack([rows, place])) + '\n')
        assert any('on the spot' in issue for issue in stride(path).issues) == doubted


def test_a_refusal_says_what_is_needed(tmp_path):
    with pytest.raises(NoSteadyGait, match=r'it lasts 0\.59 s, which may be a single stride: '
                                           r'record 3 or more, \d(\.\d)? s or longer'):
        stride(motion(tmp_path / 'ik.mot', 1.0, 0.0, 0.6))
    short = read_recording(motion(tmp_path / 'ik.mot', 1.0, 0.0, 2.2), progress=False)
    with pytest.raises(NoSteadyGait, match=r'no steady gait of 3 strides, only of 2, of 1 s each: '
                                           r'record 3 s or more'):
        cut(short)
    rng = np.random.default_rng(1)
    path = tmp_path / 'walk.csv'
    rows = np.column_stack([np.arange(300) / RATE, np.cumsum(rng.normal(0.0, 9.0, (300, 4)), 0)])
    np.savetxt(path, rows, '%.6f', ',', comments='',
               header='time,left_hip,left_knee,right_hip,right_knee')
    with pytest.raises(NoSteadyGait, match=r'in degrees, declare it \(--unit deg\)'):
        stride(path)
    lines = path.read_text().splitlines()
    path.write_text('\n'.join([*lines[:50], *lines[90:]]) + '\n')
    with pytest.raises(NoSteadyGait, match='1 dropout, about 40 samples'):
        stride(path)


def walker(path, frequency, speed, duty, unit='mm'):
    """Write markers of a body on two legs whose feet stand still on the ground, and go forward.

    Heels are foremost where they land, and toes hindmost where they leave the ground. The pelvis
    stays at its height, which then tells nothing.
    """
    t = np.arange(600) / RATE
    turn = 2.0 * np.pi * frequency * t
    points = {}
    for k, side in enumerate('LR'):
        phase = (frequency * t + 0.5 * k) % 1.0
        back = speed * duty / frequency
        swing = np.clip((phase - duty) / (1.0 - duty), 0.0, 1.0)
        way = np.where(phase < duty, back * (0.5 - phase / duty),
                       back * (swing - 0.5 - 0.1 * np.sin(2.0 * np.pi * swing)))
        top = np.column_stack([speed * t, np.full_like(t, 0.1 - 0.2 * k), np.full_like(t, 1.0)])
        low = np.column_stack([speed * t + way, top[:, 1],
                               0.1 + 0.05 * np.sin(np.pi * swing)])
        middle = 0.5 * (top + low) + 0.2 * np.column_stack([
            1.0 + 0.3 * np.cos(turn + np.pi * k), 0.0 * t, 0.0 * t])
        ahead = np.array([0.05, 0.0, 0.0])
        points |= {f'{side}ASI': top + ahead, f'{side}PSI': top - ahead, f'{side}KNE': middle,
                   f'{side}ANK': low, f'{side}HEE': low - ahead, f'{side}TOE': low + 3.0 * ahead}
    text = trc(t, np.stack([points[label] for label in LABELS], axis=1))
    path.write_text(text.replace('\tmm\t', f'\t{unit}\t'))
    return path


@pytest.mark.parametrize(('duty', 'speed', 'name'), [
    (0.62, 1.3, 'walk'), (0.35, 2.6, 'run'), (0.5, 2.0, 'walk or run: cannot tell')])
def test_feet_that_are_foremost_land(tmp_path, duty, speed, name):
    # Without a unit nothing is known of how fast the body falls.
    recording = read_recording(walker(tmp_path / 'walk.trc', 1.1, speed, duty, 'feet'),
                               progress=False, segments='human_plug_in_gait')
    assert recording.body is None and recording.loads.by_motion
    found = stride_of(recording, leg_joints(recording, None)[0], Biped, None)[1]
    assert found.verdict == name
    for leg in ('left', 'right'):
        assert found.contacts.duty[leg] == pytest.approx(duty, abs=0.03)
    assert found.phases['right'] == pytest.approx(0.5, abs=0.02)
    assert any('by the motion of the feet' in note for note in found.notes)


def test_a_report_has_stance_and_the_length_of_strides(tmp_path):
    recording = read_recording(walker(tmp_path / 'walk.trc', 1.1, 1.3, 0.62), progress=False,
                               segments='human_plug_in_gait')
    fitted = fit_recording(recording, order=1, free=['current'])
    rows = dict(gait_summary(fitted, strides_of(fitted)))
    assert float(rows['stride length [m]']) == pytest.approx(1.3 / 1.1, abs=0.02)
    assert float(rows['speed [m/s]']) == pytest.approx(1.3, abs=0.02)
    assert float(rows['stance of left [% of stride]']) == pytest.approx(62.0, abs=3.0)
    assert float(rows['double support [% of stride]']) == pytest.approx(24.0, abs=4.0)
    # Feet on the ground bear loads, which the model does not know.
    assert not any(one.bounded for one in fitted.fit.parameters.values())
    assert any(line.startswith('feet bore loads') and line.endswith('current: cannot tell')
               for line in fitted.warnings)

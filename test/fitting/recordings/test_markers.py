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

"""Joint angles between markers, against skeletons whose angles are known in closed form."""

import json
from pathlib import Path

import cpg_ros
from cpg_ros.fitting.inversion.inversion import main
from cpg_ros.fitting.recordings.markers import joint_recording, Markers, turned
from cpg_ros.fitting.recordings.recording import RecordingError
import numpy as np
import pytest
from skeletons import angles, LABELS, places, rotation, trc

TIME = np.arange(200) / 100.0
HUMAN = 'human_plug_in_gait'


def markers(points, names=LABELS, **others):
    stamps = np.round(1e9 * TIME[:len(points)]).astype(np.int64)
    return Markers(tuple(names), stamps, points, Path('walk'), **others)


@pytest.mark.parametrize('seed', range(4))
def test_angles_in_space_are_those_of_the_skeleton_from_wherever_it_is_seen(seed):
    rng = np.random.default_rng(seed)
    expected = angles(TIME)
    # The walker turns and leans as it walks, before axes that lie anyhow, in any unit.
    turns = [rotation([0, 0, 1], 0.8 * t) @ rotation([1, 0, 0], 0.2 * np.sin(3.0 * t))
             for t in TIME]
    seen = np.einsum('nij,nmj->nmi', turns, places(expected)) + TIME[:, None, None] * [1.2, 0, 0]
    seen = 1000.0 * seen @ rotation(rng.normal(size=3), rng.uniform(0.0, 6.0)).T
    found = joint_recording(markers(seen + rng.normal(size=3)), HUMAN)
    assert found.joints == ('left_hip', 'left_knee', 'left_ankle',
                            'right_hip', 'right_knee', 'right_ankle')
    # The file's right angle has five digits.
    assert found.positions == pytest.approx(expected, abs=1e-5)


def test_a_dogs_legs_are_at_zero_under_it_and_positive_forward():
    parts = {'Shoulder': 0.6, 'UpLeg': 0.0}
    below = {'Shoulder': ('Arm', 'ForeArm', 'Hand', 'HandSite'),
             'UpLeg': ('Leg', 'Foot', 'FootSite')}
    rng = np.random.default_rng(5)
    places_of = {'Hips': np.zeros((50, 3)), 'Neck': np.tile([0.7, 0.0, 0.0], (50, 1))}
    expected = {}
    joints = {'Shoulder': ('fore_scapula', 'fore_shoulder', 'fore_elbow', 'fore_wrist'),
              'UpLeg': ('hind_hip', 'hind_knee', 'hind_ankle')}
    for side, aside in (('Left', 0.1), ('Right', -0.1)):
        for top, ahead in parts.items():
            place, turn = np.tile([ahead, aside, 0.0], (50, 1)), np.zeros(50)
            places_of[side + top] = place
            for name, joint in zip(below[top], joints[top], strict=True):
                angle = rng.uniform(-0.6, 0.6, 50)
                turn = turn + angle
                place = place + 0.2 * np.stack([np.sin(turn), 0.0 * turn, -np.cos(turn)], axis=-1)
                places_of[side + name] = place
                expected[f'{side.lower()}_{joint}'] = angle
    seen = np.stack(list(places_of.values()), axis=1) @ rotation(rng.normal(size=3), 1.0).T
    found = joint_recording(markers(seen, places_of), 'dog_skeleton')
    assert set(found.joints) == set(expected)
    for joint, angles_found in zip(found.joints, found.positions.T, strict=True):
        assert angles_found == pytest.approx(expected[joint], abs=1e-5), joint


SIDE = """\
segments:
  pelvis: [LPSI, LASI]
  thigh: [[LASI, LPSI], LKNE]
  shank: [LKNE, LANK]
  foot: [LHEE, LTOE]
joints:
  hip: {between: [pelvis, thigh]}
  knee: {between: [thigh, shank]}
  ankle: {between: [shank, foot], neutral: 1.0}
"""


@pytest.mark.parametrize('turn', [0.0, 0.4, 1.9, 3.1, -1.2])
def test_angles_in_a_picture_do_not_depend_on_how_the_camera_is_held(tmp_path, turn):
    path = tmp_path / 'side.yaml'
    path.write_text(SIDE)
    expected = angles(TIME)
    cos, sin = np.cos(turn), np.sin(turn)
    flat = 300.0 * places(expected)[:, :, [0, 2]] @ np.array([[cos, sin], [-sin, cos]]) + 50.0
    hip, knee, ankle = expected.T[:3]
    # Counter-clockwise is positive, and the walker looks to the right: forward, but for the
    # knee. The toe stands off the shank by a right angle, of which 1 rad counts as 0.
    assert joint_recording(markers(flat), path).positions == pytest.approx(np.column_stack(
        [hip - 0.5 * np.pi, -knee, ankle + 0.5 * np.pi - 1.0]), abs=1e-9)


def test_without_an_axis_the_angle_between_segments_has_no_sign(tmp_path):
    path = tmp_path / 'knee.yaml'
    path.write_text('segments: {a: [LKNE, LANK], b: [LHEE, LTOE]}\n'
                    'joints: {ankle: {between: [a, b]}, back: {between: [b, a]}}\n')
    points = places(angles(TIME)) + 0.0
    points[:, LABELS.index('LKNE'), 1] = points[:, LABELS.index('LANK'), 1]
    found = joint_recording(markers(points), path).positions
    assert found[:, 0] == pytest.approx(0.5 * np.pi + angles(TIME)[:, 2])
    assert found[:, 1] == pytest.approx(found[:, 0])


def test_a_direction_along_the_axis_has_no_angle():
    axis = np.array([[0.0, 1.0, 0.0]])
    x, z = np.eye(3)[[0]], np.eye(3)[[2]]
    # The right hand about y turns z to x.
    assert turned(z, 2.0 * x, 3.0 * axis) == pytest.approx([0.5 * np.pi])
    assert np.isnan(turned(z, axis, axis))
    assert np.isnan(turned(0.0 * z, x))


def test_what_is_hardly_or_not_seen_is_missing_and_never_filled_in():
    points, likely = places(angles(TIME)), np.ones((len(TIME), len(LABELS)))
    points[50:60, LABELS.index('LKNE')] = np.nan
    points[70, LABELS.index('RTOE')] = 1e12
    likely[100:140, LABELS.index('RANK')] = 0.59
    likely[150, LABELS.index('RANK')] = np.nan
    found = joint_recording(markers(points, likelihoods=likely), HUMAN)
    gone = np.zeros(found.positions.shape, bool)
    gone[50:60, [0, 1]] = True        # the left hip and knee need the knee's marker,
    gone[50:60, 2] = True             # and so does the shank of the ankle;
    gone[100:140, [4, 5]] = gone[150, [4, 5]] = True
    gone[70, 5] = True
    assert np.array_equal(np.isnan(found.positions), gone)
    assert found.positions[~gone] == pytest.approx(angles(TIME)[~gone], abs=1e-5)
    assert '2% of the places of 12 markers have a likelihood below 0.6: not used' in found.notes


def test_joints_without_markers_are_left_out_with_a_note_or_refused_if_asked_for():
    keep = [k for k, name in enumerate(LABELS) if name not in ('RHEE', 'LTOE')]
    points, names = places(angles(TIME))[:, keep], [LABELS[k] for k in keep]
    found = joint_recording(markers(points, names), HUMAN)
    assert found.joints == ('left_hip', 'left_knee', 'right_hip', 'right_knee')
    assert found.notes == ("without the markers 'LTOE', 'RHEE', left out: 'left_ankle', "
                           "'right_ankle'",)
    points[:, names.index('LKNE')] = np.nan
    found = joint_recording(markers(points, names), HUMAN)
    assert found.joints == ('right_hip', 'right_knee')
    assert ("never seen, left out: 'left_hip', 'left_knee'; without any place: 'LKNE'"
            in found.notes)
    assert joint_recording(markers(points, names), HUMAN, ['right_k*']).joints == ('right_knee',)
    for joints, words in ((['left_ankle'], "no marker 'LTOE', which 'left_ankle' needs; there "),
                          (['left_knee'], "no angle of 'left_knee': its markers are never seen"),
                          (['tail'], "no joint 'tail'; there are 'left_hip'")):
        with pytest.raises(RecordingError, match=words):
            joint_recording(markers(points, names), HUMAN, joints)
    with pytest.raises(RecordingError, match="no angle of 'left_hip', 'left_knee'"):
        joint_recording(markers(np.full_like(points, np.nan), names), HUMAN)
    with pytest.raises(RecordingError, match='no joint angles: give a file of segments'):
        joint_recording(markers(points, names), None)


def test_a_file_of_markers_is_inverted_like_the_angles_it_has(tmp_path, capsys):
    """The walker's stride rate and the step between its legs come out, by the command line."""
    time = np.arange(800) / 100.0
    points = places(angles(time)) + np.random.default_rng(1).normal(0.0, 1e-3, (800, 12, 3))
    path = tmp_path / 'walk.trc'
    path.write_text(trc(time, points))
    assert cpg_ros.read_recording(path, segments=HUMAN, progress=False).times[-1] == 7.99
    assert main(['--trc', str(path), '--segments', HUMAN, '--network', 'phase', '--gait', 'walk',
                 '--json']) == 0
    found = json.loads(capsys.readouterr().out)
    assert found['frequency'] == pytest.approx(1.1, rel=3e-3)
    assert found['phases']['right'] == pytest.approx(0.5, abs=0.01)
    assert main(['--trc', str(path)]) == 2
    assert 'give a file of segments' in capsys.readouterr().err

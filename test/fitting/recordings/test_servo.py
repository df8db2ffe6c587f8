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

"""What joints were told, out of what they did and how hard they pulled."""

from bags import joint_state, JOINTS, START, STEP, write_bag
from cpg_ros.fitting.recordings.bag_reader import read_bag
from cpg_ros.fitting.recordings.joint_streams import Servo
from cpg_ros.fitting.recordings.recording import RecordingError
from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest

NUMBERS = st.floats(-50.0, 50.0)


@given(NUMBERS, NUMBERS, NUMBERS, st.floats(0.1, 500.0), st.floats(0.0, 20.0))
def test_the_law_of_the_controller_is_undone(command, position, velocity, kp, kd):
    effort = kp * (command - position) - kd * velocity
    assert Servo(kp, kd).command(position, velocity, effort) == pytest.approx(command, abs=1e-6)


@pytest.mark.parametrize('gains', [(0.0, 1.0), (-1.0, 1.0), (np.nan, 1.0), (1e-300, 1.0),
                                   (np.inf, 1.0), (1.0, -1.0), (1.0, np.inf), (1.0, np.nan)])
def test_gains_that_are_none_are_refused(gains):
    with pytest.raises(ValueError, match='is not from'):
        Servo(*gains)


def messages(told, effort=None, count=300):
    """Joints that lag behind what they are told, and the efforts of their controllers."""
    t = STEP * np.arange(count) / 1e9
    angles, speeds = 0.9 * told(t - 0.02), 0.9 * np.gradient(told(t - 0.02), t, axis=0)
    pulls = 40.0 * (told(t) - angles) - 1.5 * speeds if effort is None else effort(t)
    stamps = START + STEP * np.arange(count)
    return [('/joint_states', int(stamp), joint_state(int(stamp), JOINTS, *numbers))
            for stamp, *numbers in zip(stamps, angles, speeds, pulls, strict=True)], t


def told(t):
    return np.sin(2.0 * np.pi * (2.0 * t[:, None] + np.arange(len(JOINTS)) / 7))


def test_a_bag_tells_what_the_joints_were_told(tmp_path):
    recorded, t = messages(told)
    bag = write_bag(tmp_path / 'walk', recorded)
    recording = read_bag(bag, servo=Servo(40.0, 1.5))
    assert recording.positions == pytest.approx(told(t), abs=1e-9)
    assert recording.notes == (
        '/joint_states: commands of the joints, computed with kp 40 and kd 1.5',)
    assert np.abs(read_bag(bag).positions - told(t)).max() > 0.2


def test_messages_without_efforts_are_left_out_and_counted(tmp_path):
    recorded, t = messages(told)
    for k in (3, 77):
        stamp = START + STEP * k
        recorded[k] = '/joint_states', stamp, joint_state(stamp, JOINTS, told(t)[k], told(t)[k])
    recording = read_bag(write_bag(tmp_path / 'walk', recorded), servo=Servo(40.0, 1.5))
    assert len(recording.times) == len(t) - 2
    assert recording.positions == pytest.approx(np.delete(told(t), (3, 77), axis=0), abs=1e-9)
    assert any('2 of 300 messages without velocity and effort' in note
               for note in recording.notes)


def test_without_damping_velocities_are_not_needed(tmp_path):
    recorded = [('/joint_states', int(stamp), joint_state(int(stamp), JOINTS, row, effort=row))
                for stamp, row in zip(START + STEP * np.arange(50), np.ones((50, 12)),
                                      strict=True)]
    bag = write_bag(tmp_path / 'walk', recorded)
    assert read_bag(bag, servo=Servo(40.0)).positions == pytest.approx(np.full((50, 12), 1.025))
    with pytest.raises(RecordingError, match='no velocity and effort of joints'):
        read_bag(bag, servo=Servo(40.0, 1.5))


@pytest.mark.parametrize(('effort', 'words'), [
    (0.0, "no effort but 0 of joints 'rf_hip', 'rf_thigh'"),
    (np.nan, "no effort but 0 of joints 'rf_hip', 'rf_thigh'"),
    (None, "no effort of joints 'rf_hip', 'rf_thigh'")])
@pytest.mark.parametrize('apart', [False, True])
def test_joints_whose_efforts_are_not_there_are_named(tmp_path, effort, words, apart):
    # A leg without sensors of effort, on a topic of its own or in messages of its own; and a
    # gripper that pulls is no excuse.
    messages, leg = [], JOINTS[9:11]
    for k in range(50):
        stamp = START + STEP * k
        messages.append(('/joint_states', stamp, joint_state(
            stamp, (*JOINTS[:9], 'gripper'), np.full(10, 0.1 * k), effort=np.full(10, 2.0))))
        messages.append(('/leg' if apart else '/joint_states', stamp, joint_state(
            stamp, leg, (0.1, 0.1 * k), effort=() if effort is None else (effort, effort))))
    bag = write_bag(tmp_path / 'walk', messages)
    with pytest.raises(RecordingError, match=words):
        read_bag(bag, servo=Servo(40.0))
    with pytest.raises(RecordingError, match='name the joints to take to do without'):
        read_bag(bag, joints=('lh_hip', leg[0]), servo=Servo(40.0))
    assert read_bag(bag, joints=JOINTS[:9], servo=Servo(40.0)).joints == JOINTS[:9]
    assert read_bag(bag).joints

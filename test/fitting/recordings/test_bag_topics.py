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

"""Joints on several topics of a bag: one recording of those that are asked for."""

from bags import JOINTS, LEGS, START, walk, write_bag
from cpg_ros.fitting.recordings.bag_reader import read_bag
import numpy as np


def legs(count=40, late=0):
    """Return the messages of per-leg topics, stamped apart, and what was written."""
    messages, written = [], {}
    for k, leg in enumerate(LEGS):
        own = tuple(joint for joint in JOINTS if joint.startswith(leg))
        some, written[leg] = walk(count, own, f'/{leg}/joint_states', start=START + k * late,
                                  seed=k)
        messages += some
    return sorted(messages, key=lambda message: message[1]), written


def test_topics_of_the_legs_are_one_recording(tmp_path):
    messages, written = legs()
    recording = read_bag(write_bag(tmp_path / 'walk', messages, 'mcap'))
    assert recording.joints == JOINTS
    assert np.array_equal(recording.positions, np.hstack(list(written.values())))
    assert recording.source.endswith('/lf/joint_states, /rf/joint_states')


def test_topics_stamped_apart_leave_gaps_between_them(tmp_path):
    messages, written = legs(late=1000)
    recording = read_bag(write_bag(tmp_path / 'walk', messages))
    assert recording.positions.shape == (160, 12)
    for k, leg in enumerate(LEGS):
        own = recording.select([joint for joint in JOINTS if joint.startswith(leg)])
        there = ~np.isnan(own.positions).any(axis=1)
        assert np.array_equal(own.positions[there], written[leg])
        assert np.allclose(own.times[there], 1e-6 * k + 0.002 * np.arange(40), atol=1e-12)
    assert recording.notes == ()


def test_a_joint_on_two_topics_is_taken_once(tmp_path):
    messages, _ = legs()
    combined, angles = walk(40, seed=9)
    path = write_bag(tmp_path / 'walk', [*messages, *combined])
    recording = read_bag(path)
    assert np.array_equal(recording.positions, angles)
    assert recording.source == f'{path}, /joint_states'
    assert recording.notes[0] == (
        "/lh/joint_states: joints 'lh_hip', 'lh_thigh', 'lh_calf' taken from /joint_states")
    assert len(recording.notes) == 4
    alone = read_bag(path, topics=['lf/joint_states', '/rf/joint_states'])
    assert alone.joints == JOINTS[6:]
    assert alone.notes == ()


def test_joints_are_chosen_in_the_order_asked_for(tmp_path):
    messages, angles = walk(30)
    recording = read_bag(write_bag(tmp_path / 'walk', messages), joints=('rf_calf', 'lh_hip'))
    assert recording.joints == ('rf_calf', 'lh_hip')
    assert np.array_equal(recording.positions, angles[:, [11, 0]])

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

"""Recordings merged from chunks, against a dictionary filled sample by sample."""

from cpg_ros.fitting.recordings.recording import merge_chunks, Recording, RecordingError
from depth import examples
from hypothesis import given
from hypothesis import strategies as st
import numpy as np
import pytest

JOINTS = ('lf_hip', 'lf_knee', 'rf_hip', 'rf_knee')
START = 1_700_000_000_000_000_000


@st.composite
def chunks(draw):
    """Chunks of some of the joints, at stamps that repeat, go back and are shared."""
    made = []
    for _ in range(draw(st.integers(1, 6))):
        names = tuple(draw(st.lists(st.sampled_from(JOINTS), min_size=1, unique=True)))
        stamps = draw(st.lists(st.integers(0, 12), min_size=1, max_size=8))
        values = st.floats(-3.0, 3.0) | st.just(float('nan')) | st.just(float('inf'))
        positions = draw(st.lists(st.lists(values, min_size=len(names), max_size=len(names)),
                                  min_size=len(stamps), max_size=len(stamps)))
        made.append((START + 1_000_000 * np.array(stamps), names, np.array(positions)))
    return made


@given(chunks())
@examples(150)
def test_each_joint_has_its_first_position_at_each_stamp(made):
    # Chunks of the same joints follow each other; sets of joints, by their first chunk.
    order = list(dict.fromkeys(names for _, names, _ in made))
    first: dict[int, dict[str, float]] = {}
    for names in order:
        taken = set()
        for stamps, own, positions in made:
            if own != names:
                continue
            for stamp, row in zip(stamps.tolist(), positions, strict=True):
                if stamp not in taken:
                    taken.add(stamp)
                    for name, value in zip(own, row, strict=True):
                        if np.isfinite(value):
                            first.setdefault(stamp, {}).setdefault(name, value)
    joints = tuple(dict.fromkeys(name for names in order for name in names))
    heard = {name for row in first.values() for name in row}
    if len(first) < 2 or heard != set(joints):
        with pytest.raises(RecordingError):
            merge_chunks(made, 'live')
        return
    recording = merge_chunks(made, 'live')
    stamps = sorted(first)
    assert recording.joints == joints
    assert np.allclose(recording.times, (np.array(stamps) - stamps[0]) / 1e9, rtol=0, atol=1e-12)
    assert recording.start == pytest.approx(stamps[0] / 1e9, abs=1e-6)
    expected = [[first[stamp].get(name, np.nan) for name in joints] for stamp in stamps]
    assert np.array_equal(recording.positions, expected, equal_nan=True)


def ramp(count=100, step=2_000_000):
    return START + step * np.arange(count), 0.01 * np.arange(count)[:, None] + np.arange(4)


def test_the_input_is_left_alone():
    stamps, positions = ramp()
    positions[3, 1] = np.inf
    copies = stamps.copy(), positions.copy()
    merge_chunks([(stamps, JOINTS, positions)], 'live')
    assert np.array_equal(stamps, copies[0])
    assert np.array_equal(positions, copies[1])


def test_a_clean_recording_has_no_notes():
    stamps, positions = ramp()
    recording = merge_chunks([(stamps[:40], JOINTS, positions[:40]),
                        (stamps[40:], JOINTS, positions[40:])], 'live')
    assert recording.notes == ()
    assert np.array_equal(recording.positions, positions)


def test_what_is_mended_is_counted():
    stamps, positions = ramp()
    kept = np.delete(np.arange(100), [50, 51, 52, 80])
    kept = np.append(kept, [7, 8])  # Again, and out of order.
    positions[20, 2] = np.nan
    recording = merge_chunks([(stamps[kept], JOINTS, positions[kept])], 'live')
    assert recording.notes == (
        '2 samples out of order, sorted by stamp',
        '2 duplicates of a stamp, the first is kept',
        "joint 'rf_hip': 1 position not a finite number",
        "joint 'rf_hip': 95 samples where others have 96",
        "joints 'lf_hip', 'lf_knee', 'rf_knee': 2 dropouts, about 4 samples of 100, "
        'the longest 0.008 s at 0.098 s',
        "joint 'rf_hip': 3 dropouts, about 5 samples of 100, the longest 0.008 s at 0.098 s")
    there = np.delete(np.arange(100), [50, 51, 52, 80])
    assert np.array_equal(recording.positions, positions[there], equal_nan=True)


def test_jitter_is_counted():
    stamps, positions = ramp()
    stamps[10] += 400_000
    stamps[30] += 100_000  # 5 %, which is none.
    recording = merge_chunks([(stamps, JOINTS, positions)], 'live')
    assert recording.notes == (
        '2 of 99 intervals jitter by more than 10% of the usual 0.002 s',)


def test_joints_missing_in_part_of_the_messages_are_named():
    stamps, positions = ramp()
    recording = merge_chunks([(stamps[:60], JOINTS, positions[:60]),
                        (stamps[60:], JOINTS[:3], positions[60:, :3])], 'live')
    assert recording.notes == ("joint 'rf_knee': 60 samples where others have 100",)
    assert np.isnan(recording.positions[60:, 3]).all()
    assert np.array_equal(recording.positions[:, :3], positions[:, :3])


def test_a_week_of_nanoseconds_rises_strictly():
    stamps = START + np.array([0, 1, 2, 10**9, 10**9 + 1, 7 * 86400 * 10**9, 10**16,
                               10**16 + 1])
    recording = merge_chunks([(stamps, ('knee',), np.arange(8.0)[:, None])], 'live')
    assert (np.diff(recording.times) > 0.0).all()
    assert recording.positions[:5, 0].tolist() == [0.0, 1.0, 2.0, 3.0, 4.0]


@pytest.mark.parametrize(('made', 'joints', 'message'), [
    ([], (), 'live: no samples'),
    ([(np.array([], int), JOINTS, np.empty((0, 4)))], (), 'live: no samples'),
    ([(np.array([5]), ('a',), np.ones((1, 1)))], (),
     'live: 1 sample, all at stamp 0.000000005 s: no time passes'),
    ([(np.array([5, 5]), ('a',), np.ones((2, 1)))], (),
     'live: 2 samples, all at stamp 0.000000005 s: no time passes'),
    ([(np.array([5, 6]), ('a', 'b'), np.array([[1.0, np.nan]] * 2))], (),
     "live: no finite position of joint 'b' in 2 samples; name the joints to take to do without"),
    ([(np.array([5, 6]), ('a', 'b'), np.ones((2, 2)))], ('c', 'b'),
     "live: no joint 'c'; there are 'a', 'b'"),
    ([(np.array([5, 6]), ('a', 'b'), np.ones((2, 2)))], ('b', 'b'),
     "live: joint 'b' is named twice"),
    ([(np.array([5, 6]), ('a', 'a'), np.ones((2, 2)))], (), "live: joint 'a' is named twice"),
    ([(np.array([5, 6]), ('a',), np.ones((2, 2)))], (),
     'live: 1 names and positions of shape (2, 2) for stamps of shape (2,)'),
    ([(np.array([0.5, 0.6]), ('a',), np.ones((2, 1)))], (),
     'live: stamps must be whole nanoseconds, not float64'),
    ([(np.array([0, 2**62 + 2**61]), ('a',), np.ones((2, 1)))], (),
     'live: stamp of 6.91753e+09 s'),
])
def test_what_is_no_recording_is_refused_in_one_line(made, joints, message):
    with pytest.raises(RecordingError) as error:
        merge_chunks(made, 'live', joints)
    assert str(error.value) == message


def test_select():
    stamps, positions = ramp()
    recording = merge_chunks([(stamps, JOINTS, positions)], 'live')
    args = recording.select(('rf_knee', 'lf_hip'))
    assert args.joints == ('rf_knee', 'lf_hip')
    assert np.array_equal(args.positions, positions[:, [3, 0]])
    with pytest.raises(RecordingError, match=r"^live: no joint 'tail'; there are 'lf_hip'"):
        recording.select(('tail',))


@pytest.mark.parametrize(('times', 'positions'), [
    ([0.0], [[1.0]]), ([0.0, 0.0], [[1.0]] * 2), ([1.0, 2.0], [[1.0]] * 2),
    ([0.0, 1.0, 0.5], [[1.0]] * 3), ([0.0, 1.0], [[1.0]] * 3), ([0.0, np.nan], [[1.0]] * 2)])
def test_a_recording_holds_what_it_promises(times, positions):
    with pytest.raises(RecordingError):
        Recording(('knee',), np.array(times), np.array(positions), 'by hand')

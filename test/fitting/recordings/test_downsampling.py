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

"""Long recordings are smoothed to a coarser grid while they are read; short ones are not."""

import tracemalloc

from bags import joint_state, START, write_bag
from cpg_ros.fitting.recordings import downsampling, joint_streams
from cpg_ros.fitting.recordings.bag_reader import read_bag
from cpg_ros.fitting.recordings.csv_reader import read_csv
from cpg_ros.fitting.recordings.downsampling import average_on_grid, Downsampler
from cpg_ros.fitting.recordings.recording import merge_chunks
import numpy as np
import pytest
from walks import table_of

STEP = 10_000_000


@pytest.fixture
def soon(monkeypatch):
    """Make what counts as long short."""
    monkeypatch.setattr(downsampling, 'MAX_RAW_SAMPLES', 2000)
    monkeypatch.setattr(joint_streams, 'MAX_RAW_SAMPLES', 2000)


def motion(t, frequency=1.7):
    """Six harmonics of a stride, rad, shape (n, 2), and how far they reach."""
    turns = 2.0 * np.pi * frequency * np.multiply.outer(t, np.arange(1, 7))
    return np.stack([np.cos(turns) @ (0.5 / np.arange(1, 7)**2),
                     np.sin(turns + 1.0) @ (0.3 / np.arange(1, 7)**2)], axis=1)


def test_a_stride_passes_and_noise_is_averaged():
    rng = np.random.default_rng(0)
    stamps = START + np.cumsum(rng.integers(1_600_000, 2_400_000, 30000))
    clean = motion(1e-9 * (stamps - START))
    at, found = average_on_grid(stamps, clean + 0.05 * rng.normal(size=clean.shape), STEP)
    inner = slice(2, -2)
    assert (at[inner] % STEP == 0).all() and (np.diff(at) == STEP)[inner].all()
    left = (found - motion(1e-9 * (at - START)))[inner]
    # Of fifteen samples a parabola leaves two fifths of the noise, and no more of the motion.
    assert 0.3 < left.std() / 0.05 < 0.5 and np.abs(left.mean(axis=0)).max() < 2e-3
    assert np.abs(average_on_grid(stamps, clean, STEP)[1] - motion(1e-9 * (at - START)))[
        inner].max() < 2e-3


def test_gaps_spikes_and_missing_values():
    stamps = START + 2_000_000 * np.arange(5000)
    stamps[2500:] += 777_000_000
    values = motion(1e-9 * (stamps - START))
    values[1000, 0], values[1200:1300, 1], values[3000, 1] = 50.0, np.nan, 1e300
    at, found = average_on_grid(stamps, values, STEP)
    assert (np.diff(at) > 0).all()
    truth = motion(1e-9 * (at - START))
    missing = (at > stamps[1204]) & (at < stamps[1294])
    assert np.isnan(found[missing, 1]).all() and np.isfinite(found[missing, 0]).all()
    assert not ((at > stamps[2499]) & (at < stamps[2500])).any()
    assert np.nanmax(np.abs(found - truth)) < 0.02


def test_a_fast_stride_survives_downsampling(monkeypatch):
    monkeypatch.setattr(downsampling, 'MAX_RAW_SAMPLES', 2000)
    t = np.arange(6000) / 500.0
    for frequency, step in ((2.0, 10_000_000), (4.5, 5_000_000), (12.0, 0)):
        samples = Downsampler()
        for k in range(0, 6000, 500):
            samples.add((1e9 * t[k:k + 500]).astype(np.int64), motion(t[k:k + 500], frequency))
        assert samples.step == step and bool(samples.note) == bool(step)
        stamps, values = samples.flush()
        assert len(stamps) == pytest.approx(12e9 / (step or 2_000_000), abs=2)
        assert np.abs(values - motion(1e-9 * stamps, frequency))[3:-3].max() < 5e-3


def test_a_long_table(tmp_path, soon):
    t = np.arange(10000) / 500.0
    recording = read_csv(table_of(tmp_path / 'long.csv', ['hip', 'knee'], t, motion(t)))
    assert '10000 samples, of 500 Hz, smoothed to 100 Hz: the recording is long' in recording.notes
    assert len(recording.times) == 2001
    assert np.abs(recording.positions - motion(recording.times + recording.start))[
        2:-2].max() < 2e-3


def test_a_long_recording_is_in_memory_once(soon):
    t = np.arange(400_000) / 500.0

    def chunks():
        for part in np.array_split(t, 400):
            yield (np.rint(1e9 * part).astype(np.int64), [f'joint_{k}' for k in range(12)],
                   np.tile(motion(part), 6))

    tracemalloc.start()
    recording = merge_chunks(chunks(), 'long')
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert len(recording.times) == pytest.approx(80_000, abs=2)
    assert most < 2.0 * recording.positions.nbytes


@pytest.mark.parametrize('stamped', [True, False])
def test_long_topics_side_by_side_share_a_grid(tmp_path, soon, stamped):
    t = np.arange(6000) / 500.0
    messages = []
    for time in t:
        for n, name in enumerate(('hip', 'knee')):
            # The second topic comes later, and tells its own time or none.
            now = START + round(1e9 * time) + 700_000 * n
            value = motion(np.array([time + 7e-4 * n]))[0, n]
            messages.append((f'/{name}/joint_states', now + 90_000,
                             joint_state(now if stamped else 0, [name], [value])))
    recording = read_bag(write_bag(tmp_path / 'bag', messages))
    assert sum('smoothed to 100 Hz' in note for note in recording.notes) == 2
    # One table without holes but at its ends.
    assert len(recording.times) == pytest.approx(1200, abs=3)
    assert np.isfinite(recording.positions[2:-2]).all()
    seconds = recording.times + recording.start - 1e-9 * START - (0.0 if stamped else 9e-5)
    assert np.abs(recording.positions - motion(seconds))[2:-2].max() < 2e-3

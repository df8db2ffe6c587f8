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

"""Files of exactly one stride: declared by --cycle, recognised, and what is none."""

from cpg_ros.fitting.inversion.recording_fit import fit_recording
from cpg_ros.fitting.recordings.formats import read_recording
from cpg_ros.fitting.recordings.recording import RecordingError
import numpy as np
import pytest

NAMES = ('left_hip', 'left_knee', 'right_hip', 'right_knee')


def table(path, cycles, time='time', scale=1.0, count=101, noise=0.0):
    """Write a walk: hips are sines, knees bend once in swing."""
    s = np.linspace(0.0, cycles, count)

    def leg(phase):
        place = 2.0 * np.pi * (s + phase)
        return np.sin(place), -0.5 + 0.4 * np.cos(place + 0.3) + 0.2 * np.cos(2.0 * place)

    angles = np.column_stack([*leg(0.0), *leg(0.5)])
    angles += noise * np.random.default_rng(7).standard_normal(angles.shape)
    rows = np.column_stack([scale * s, angles])
    path.write_text('\n'.join([','.join([time, *NAMES]),
                               *(','.join(f'{x:.6f}' for x in row) for row in rows)]) + '\n')
    return path


def test_a_declared_stride_has_the_duration_that_the_file_has(tmp_path):
    path = table(tmp_path / 'one.csv', 1.0, scale=0.92)
    found = fit_recording(read_recording(path, cycle=0.0), order=1, free=['current'])
    assert found.stride.frequency == pytest.approx(1.0 / 0.92, rel=1e-9)
    assert found.stride.cycles == 1 and found.fit.gait == 'walk'
    assert found.stride.phases['right'] == pytest.approx(0.5, abs=1e-3)
    # A stride cut to whole samples of 9.2 ms: its frequency is not known better.
    assert 1e-3 < found.stride.frequency_error < 1e-2
    assert any('one stride' in note for note in found.recording.notes)
    assert np.isnan(found.stride.scatter['right'].spread)


@pytest.mark.parametrize('time', ['Gait cycle [%]', '%', 'percent', 'gait_cycle', '% gait cycle'])
def test_a_normalised_table_needs_the_duration(tmp_path, time):
    path = table(tmp_path / 'normalised.csv', 1.0, time, 100.0)
    recording = read_recording(path, cycle=1.2)
    assert recording.cycle == 1.2 and recording.times[100] == pytest.approx(1.2)
    assert recording.positions.shape == (600, 4)
    with pytest.raises(RecordingError, match=r'fractions of a stride: give .* \(--cycle\)'):
        fit_recording(read_recording(path))


def test_one_stride_is_recognised_with_a_warning(tmp_path):
    path = table(tmp_path / 'one.csv', 1.0, noise=0.01)
    found = fit_recording(read_recording(path), order=1, free=['current'])
    assert found.stride.frequency == pytest.approx(1.0, rel=0.02)
    assert found.confidence <= 0.5 and '--cycle' in found.warnings[0]


@pytest.mark.parametrize('cycles', [0.5, 0.8, 1.2])
def test_what_is_no_stride_is_not_declared_one(tmp_path, cycles):
    path = table(tmp_path / 'part.csv', cycles)
    with pytest.raises(RecordingError, match=r'not one stride: joint .* of its range from where'):
        read_recording(path, cycle=0.0)


def test_a_squat_from_rest_to_rest_is_no_stride(tmp_path):
    s = np.linspace(0.0, 1.0, 101)
    bend = 0.5 - 0.5 * np.cos(2.0 * np.pi * s)
    rows = np.column_stack([2.0 * s, bend, 2.0 * bend, bend, 2.0 * bend])
    np.savetxt(tmp_path / 'squat.csv', rows, '%.6f', ',', comments='',
               header=','.join(['time', *NAMES]))
    with pytest.raises(Exception, match='no steady gait'):
        fit_recording(read_recording(tmp_path / 'squat.csv'))

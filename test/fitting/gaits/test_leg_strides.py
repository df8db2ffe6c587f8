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

"""Strides of legs whose foremost and hindmost instants are set, and what cannot be told."""

from types import SimpleNamespace

from cpg_ros.fitting.gaits.stride import find_stride
from cpg_ros.fitting.inversion.stride_report import leg_strides
from cpg_ros.networks.registry import NETWORKS
import numpy as np
import pytest

RATE = 200.0


def walked(touchdowns, duties, times, bend=0.5):
    """Return hip and knee of a leg that is foremost at instants, hindmost a duty after."""
    k = np.clip(np.searchsorted(touchdowns, times, side='right') - 1, 0, len(duties) - 1)
    phase = (times - touchdowns[k]) / np.diff(touchdowns)[k]
    back, swing = phase < duties[k], np.clip((phase - duties[k]) / (1.0 - duties[k]), 0.0, 1.0)
    hip = np.where(back, np.cos(np.pi * phase / duties[k]), -np.cos(np.pi * swing))
    knee = 0.15 + bend * np.where(back, 0.0, np.sin(np.pi * swing)**2)
    return 0.4 * hip, knee


def recorded(seed, duty=(0.62, 0.55), scatter=0.01, noise=0.002, bend=0.5):
    """Return a recording of two legs and the truth: leg -> instants and shares of retractions."""
    rng = np.random.default_rng(seed)
    periods = 0.9 * (1.0 + scatter * rng.normal(size=16))
    truth, columns = {}, []
    times = np.arange(0.0, 12.0, 1.0 / RATE)
    for k, leg in enumerate(('left', 'right')):
        downs = np.cumsum([-0.3 - 0.45 * k, *periods])
        duties = duty[k] * (1.0 + 0.3 * scatter * rng.normal(size=16))
        truth[leg] = downs, duties
        columns += list(walked(downs, duties, times, bend))
    names = ('left_hip', 'left_knee', 'right_hip', 'right_knee')
    x = np.column_stack(columns) + rng.normal(0.0, noise, (times.size, 4))
    return SimpleNamespace(joints=names, times=times, positions=x, source='walk'), truth


LEGS = {'left': ('left_hip', 'left_knee'), 'right': ('right_hip', 'right_knee')}


def found_in(recording, legs=LEGS):
    return leg_strides(recording, legs, find_stride(recording, legs, NETWORKS['biped']))


@pytest.mark.parametrize('seed', range(3))
@pytest.mark.parametrize('sign', [1.0, -1.0])
def test_strides_and_strokes_are_those_that_were_walked(seed, sign):
    recording, truth = recorded(seed)
    # Angles may be counted in either sense.
    recording.positions[:, 0] *= sign
    recording.positions[:, 3] *= sign
    for one in found_in(recording):
        downs, duties = truth[one.leg]
        assert not one.reason and one.joint == f'{one.leg}_hip' and len(one.begins) >= 10
        at = np.argmin(np.abs(downs[:, None] - one.begins), axis=0)
        # Two samples are 0.01 s.
        assert one.begins == pytest.approx(downs[at], abs=0.01)
        assert one.periods == pytest.approx(np.diff(downs)[at], abs=0.012)
        back = (duties * np.diff(downs))[at]
        assert one.retractions == pytest.approx(back, abs=0.015)
        assert one.retractions.mean() == pytest.approx(back.mean(), abs=0.005)
        assert one.protractions + one.retractions == pytest.approx(one.periods)
        # How far strides differ is found, too: to what two hundredths of a stride leave of it.
        assert one.periods.std() == pytest.approx(np.diff(downs)[at].std(), abs=0.003)
        assert one.range == pytest.approx(0.8, abs=0.01)


def test_gaps_leave_out_strides_and_no_others():
    recording, truth = recorded(5)
    gone = (recording.times > 4.0) & (recording.times < 5.0)
    recording.positions[gone, 0] = np.nan
    left, right = found_in(recording)
    assert len(right.begins) - len(left.begins) in (1, 2)
    assert not ((left.begins > 4.02) & (left.begins < 4.98)).any()
    downs = truth['left'][0]
    assert left.begins == pytest.approx(
        downs[np.argmin(np.abs(downs[:, None] - left.begins), axis=0)], abs=0.012)


def test_what_nothing_tells_is_not_told():
    recording, _ = recorded(1, noise=1e-4)
    for legs, why in (
            ({'left': ('left_hip',), 'right': ('right_hip',)}, 'is called like a knee'),
            ({'left': ('left_knee',), 'right': ('right_knee',)}, 'is called like a hip')):
        some = [name for names in legs.values() for name in names]
        recording_of = SimpleNamespace(
            joints=tuple(some), times=recording.times, source='walk',
            positions=recording.positions[:, [recording.joints.index(name) for name in some]])
        for one in found_in(recording_of, legs):
            assert one.reason.endswith(why)
            assert np.isnan(one.retractions).all() and len(one.periods) >= 10
    # Whatever angle counts as 0, a knee bends far for a short time; one that moves evenly may not.
    recording.positions[:, [1, 3]] -= 0.8
    assert not any(one.reason for one in found_in(recording))
    recording.positions[:, [1, 3]] = 0.2 * np.sin(2.0 * np.pi * recording.times / 0.9)[:, None]
    assert all('bends is unknown' in one.reason for one in found_in(recording))

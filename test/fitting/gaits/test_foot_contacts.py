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

"""Stance and swing from loads on the feet, and walk told from run by them."""

from types import SimpleNamespace

from cpg_ros.fitting.gaits.foot_contacts import foot_contacts
from cpg_ros.fitting.gaits.stride import find_stride
from cpg_ros.fitting.inversion.stride_report import leg_strides
from cpg_ros.fitting.recordings.csv_reader import read_csv
from cpg_ros.fitting.recordings.recording import FootLoads
from cpg_ros.networks.registry import NETWORKS
import numpy as np
import pytest

LEGS = {'left': ('left_hip', 'left_knee'), 'right': ('right_hip', 'right_knee')}
PERIOD = 0.9


def recorded(duty, seed=0, rate=100.0, bounce=False):
    """Two legs half a stride apart, their loads in N on a clock of their own, with an offset."""
    rng = np.random.default_rng(seed)
    times = np.arange(0.0, 12.0, 1.0 / rate)
    at = np.arange(0.004, 12.0, 1.0 / 70.0)
    angles, loads = [], []
    for k in range(2):
        turn = 2.0 * np.pi * (times / PERIOD + 0.5 * k)
        angles += [0.4 * np.cos(turn), 0.6 + 0.4 * np.cos(turn + 1.2) + 0.15 * np.cos(2.0 * turn)]
        phase = (at / PERIOD + 0.5 * k) % 1.0
        load = np.where(phase < duty, 300.0 * np.sin(np.pi * phase / duty)**0.3, 0.0)
        if bounce:
            load = np.where((phase > 0.03) & (phase < 0.05), 0.0, load)
        loads.append(20.0 + load * (1.0 + 0.05 * rng.normal(size=at.size)))
    x = np.array(angles).T + 0.003 * rng.normal(size=(times.size, 4))
    return (SimpleNamespace(joints=sum(LEGS.values(), ()), times=times, positions=x, source='it'),
            FootLoads(('left', 'right'), at, np.array(loads).T))


@pytest.mark.parametrize('bounce', [False, True])
@pytest.mark.parametrize(('duty', 'gait'), [(0.62, 'walk'), (0.52, 'walk'), (0.38, 'run')])
def test_walk_and_run_are_told_apart_by_the_loads(duty, gait, bounce):
    recording, loads = recorded(duty, bounce=bounce)
    without = find_stride(recording, LEGS, NETWORKS['biped'])
    assert set(without.candidates) == {'walk', 'run'} and without.confidence < 0.6
    found = find_stride(recording, LEGS, NETWORKS['biped'], loads=loads)
    assert found.gait == gait and found.candidates == (gait,) and found.confidence > 0.95
    assert found.contacts.flight == pytest.approx(max(0.0, 1.0 - 2.0 * duty), abs=0.04)
    for strides in leg_strides(recording, LEGS, found):
        assert strides.by_contacts and len(strides.begins) >= 10
        assert strides.periods == pytest.approx(PERIOD, abs=0.03)
        # A load that rises from 0 is seen a little later.
        assert strides.fractions.mean() == pytest.approx(duty, abs=0.03)


def test_legs_that_are_built_unlike_are_in_step_by_their_feet():
    recording, loads = recorded(0.62)
    shifted = recording.positions.copy()
    # The right leg's joints do the same 0.2 of a stride before its foot does.
    for column in (2, 3):
        shifted[:, column] = np.interp(recording.times + 0.2 * PERIOD, recording.times,
                                       recording.positions[:, column])
    unlike = SimpleNamespace(**{**vars(recording), 'positions': shifted})
    by_joints = find_stride(unlike, LEGS, NETWORKS['biped'])
    assert by_joints.phases['right'] == pytest.approx(0.7, abs=0.03)
    assert by_joints.gait != 'walk'
    found = find_stride(unlike, LEGS, NETWORKS['biped'], loads=loads)
    assert found.gait == 'walk' and found.phases['right'] == pytest.approx(0.5, abs=0.03)
    assert any('those of touchdown' in note for note in found.notes)


@pytest.mark.parametrize(('fraction', 'by_feet'), [(0.1, True), (0.5, False)])
def test_stumbles_do_not_move_touchdowns(fraction, by_feet):
    recording, loads = recorded(0.62)
    rng, stride = np.random.default_rng(8), loads.times // PERIOD
    # In some strides the right foot, whose stance begins half a stride later, stands 0.4 earlier.
    for k in np.flatnonzero(rng.permutation(12) < round(12 * fraction)):
        loads.loads[stride == k, 1] = 20.0
        early = np.abs(loads.times % PERIOD - 0.3 * PERIOD) < 0.2 * PERIOD
        loads.loads[(stride == k) & early, 1] = 280.0
    shifted = recording.positions.copy()
    for column in (2, 3):
        shifted[:, column] = np.interp(recording.times + 0.2 * PERIOD, recording.times,
                                       recording.positions[:, column])
    unlike = SimpleNamespace(**{**vars(recording), 'positions': shifted})
    found = find_stride(unlike, LEGS, NETWORKS['biped'], loads=loads)
    assert any('those of touchdown' in note for note in found.notes) == by_feet
    assert found.phases['right'] == pytest.approx(0.5 if by_feet else 0.7, abs=0.03)


def test_between_walk_and_run_it_cannot_tell():
    recording, loads = recorded(0.44)
    found = find_stride(recording, LEGS, NETWORKS['biped'], loads=loads)
    assert 0.1 < found.contacts.flight < 0.15
    assert set(found.candidates) == {'walk', 'run'} and found.verdict == 'walk or run: cannot tell'


def test_feet_that_are_never_lifted_stand_and_few_samples_tell_nothing():
    _, loads = recorded(0.6)
    loads.loads[:] = 250.0 + 30.0 * np.sin(loads.times)[:, None]
    stood = foot_contacts(loads, LEGS, 1.0, 9.0, PERIOD)
    assert stood.duty == {'left': 1.0, 'right': 1.0} and stood.flight == 0.0
    seldom = FootLoads(loads.legs, loads.times[::10], loads.loads[::10])
    assert foot_contacts(seldom, LEGS, 1.0, 9.0, PERIOD) is None


@pytest.mark.parametrize(('duty', 'gait'), [(0.62, 'walk'), (0.38, 'run')])
def test_columns_of_a_table_tell_walk_from_run(tmp_path, duty, gait):
    recording, loads = recorded(duty)
    table = np.column_stack([recording.times, recording.positions, *(
        np.interp(recording.times, loads.times, row) for row in loads.loads.T)])
    path = tmp_path / 'walk.csv'
    np.savetxt(path, table, delimiter=',', comments='',
               header=','.join(['time', *recording.joints, 'grf_R [N]', 'grf_L [N]']))
    # The first column is the right foot's, which touches down with the stride.
    read = read_csv(path, progress=False)
    found = find_stride(read, LEGS, NETWORKS['biped'], loads=read.loads)
    assert found.gait == gait and set(found.contacts.legs) == {'left', 'right'}
    rows = {one.leg: one for one in leg_strides(read, LEGS, found)}
    for leg, phase in (('left', 0.5), ('right', 1.0)):
        assert rows[leg].fractions.mean() == pytest.approx(duty, abs=0.04)
        touched = (rows[leg].begins / PERIOD - phase + 0.5) % 1.0 - 0.5
        assert np.abs(touched).max() < 0.05


def test_feet_of_other_legs_tell_nothing():
    _, loads = recorded(0.6)
    for names in (('left_force', 'torso_force'), ('left_force', 'left_contact'), ('one', 'two')):
        other = FootLoads(names, loads.times, loads.loads)
        assert foot_contacts(other, LEGS, 1.0, 9.0, PERIOD) is None

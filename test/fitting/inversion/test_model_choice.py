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

"""Recordings whose phases are none of a network's gaits; which network explains a recording."""

from dataclasses import replace
import json
from pathlib import Path

from cpg_ros.common.errors import InputError
from cpg_ros.dynamics.solve_orbit import solve_orbit
from cpg_ros.fitting.inversion import inversion
from cpg_ros.fitting.inversion.model_choice import as_rows, compare_networks, indistinguishable
from cpg_ros.fitting.inversion.recording_fit import fit_recording
from cpg_ros.fitting.recordings.csv_reader import read_csv
from cpg_ros.networks.registry import NETWORKS, PRESETS
from made_up import joint_angles
from motion import Driven, noisy, stamps
import numpy as np
import pytest


def recorded(path, gait, seed=0):
    """Write a CSV file of a gait of the phase network, 14 s at 1.7 Hz; return its truth."""
    driven, rng = Driven('phase', gait), np.random.default_rng(seed)
    t = stamps(rng, 14.0, 200.0)
    x = noisy(rng, driven(1.7 * t), 0.01)
    np.savetxt(path, np.column_stack([t, x]), delimiter=',', comments='',
               header=','.join(['time', *driven.joints]))
    return dict(zip(driven.by_leg, driven.orbit.phases, strict=True))


@pytest.mark.parametrize('gait', ['canter_left', 'unnamed'])
def test_phases_of_no_gait_are_fitted_as_they_are(tmp_path, gait):
    truth = recorded(tmp_path / 'own.csv', gait)
    found = fit_recording(read_csv(tmp_path / 'own.csv'))
    assert found.fit.network.name == 'phase' and found.fit.gait == gait
    said = next(line for line in found.warnings if 'match no gait of the network delayed' in
                line)
    assert 'fitted as they are, by the network phase' in said
    assert f'rf {found.stride.phases["rf"]:.3f} +- ' in said
    for leg in ('rh', 'lf', 'rf'):
        one = found.fit.parameters[f'offset_{leg}']
        error = (one.value - truth[leg] + 0.5) % 1.0 - 0.5
        # Three intervals of 95 %, with room for chance.
        assert abs(error) <= 2.0 * (one.high - one.value) < 0.01
        assert 0.0 < one.stderr < found.stride.scatter[leg].spread
    # What was asked for by name is not exchanged.
    with pytest.raises(InputError, match='match no gait of the network delayed') as caught:
        fit_recording(read_csv(tmp_path / 'own.csv'), network='delayed')
    assert 'their deviations in single strides: lh 0.000, rh ' in str(caught.value)


def test_the_network_that_explains_a_canter(tmp_path, capsys):
    recorded(tmp_path / 'canter.csv', 'canter_right')
    found = compare_networks(read_csv(tmp_path / 'canter.csv'))
    assert found[0].network == 'phase' and found[0].gait == 'canter_right'
    assert 0.0 < found[0].fitted <= 1.2 * found[0].error < 0.02
    # Three phases; an offset and six weights for each of eight joints.
    assert (found[0].parameters, found[0].numbers) == (3, 3 + 8 * 7)
    assert {one.network for one in found[1:]} == {'delayed', 'quadruped', 'hopf', 'matsuoka'}
    assert all('of a cycle off' in one.why and one.error == np.inf for one in found[1:])
    code = inversion.main(['--csv', str(tmp_path / 'canter.csv'), '--network', 'auto', '--json'])
    told = json.loads(capsys.readouterr().out)
    assert code == 0 and told['network'] == 'phase'
    assert told['networks'][0]['error'] == pytest.approx(found[0].error)


def test_networks_are_not_compared_on_two_strides(capsys):
    walk = Path(__file__).parents[2] / 'data' / 'human_walking.csv'
    assert inversion.main(['--csv', str(walk), '--network', 'auto']) == 2
    assert capsys.readouterr().err.splitlines()[-1] == (
        f'inversion: {walk}: comparing networks takes 4 strides or more, to fit one half and '
        'judge on the other; here are 2')


def made(path, network, gait, rows, **changes):
    """Write 14 s at 1.7 Hz of joints read off a gait, as a generator does, with 2 % of noise."""
    orbit = solve_orbit(replace(PRESETS[network][gait].network, **changes), gait)
    legs, rng = next(iter(NETWORKS[network].legs.values())), np.random.default_rng(0)
    t = stamps(rng, 14.0, 200.0)
    x = joint_angles(orbit, [own[0] for own in legs.values() for _ in rows],
                     np.tile(rows, (len(legs), 1)), 1.7 * t).T
    names = ['time', *(f'{leg}_{joint}' for leg in legs for joint in ('hip', 'knee'))]
    np.savetxt(path, np.column_stack([t, noisy(rng, x)]), delimiter=',', comments='',
               header=','.join(names))


def test_the_network_that_made_a_trot_explains_it(tmp_path, monkeypatch):
    made(tmp_path / 'own.csv', 'hopf', 'trot', [[0.4, 0.1, 0, 0, 0, 0], [0.25, -0.2, 0, 0, 0, 0]],
         duty=0.7)
    # The others take longer to fit.
    monkeypatch.setattr('cpg_ros.fitting.inversion.model_choice.networks_of', lambda *_: [
        NETWORKS[name] for name in ('delayed', 'phase', 'hopf')])
    plain, shaped = (compare_networks(read_csv(tmp_path / 'own.csv'), order=order)
                     for order in (1, 3))
    assert plain[0].network == 'hopf' and plain[0].error < 0.005
    assert [one.alike for one in plain] == [True, False, False]
    assert plain[1].error > 5.0 * plain[0].error and indistinguishable(plain, 1) == ''
    # Readouts of order 3 make such a waveform of several: the fewest numbers come first.
    assert shaped[0].network == 'hopf' and shaped[1].alike and shaped[0].numbers == 1 + 8 * 7
    text = indistinguishable(shaped, 3)
    assert 'does not distinguish hopf' in text and '--order 1' in text
    assert sorted(row[-1] for row in as_rows(plain)) == ['', 'told from the least', 'yes', 'yes']


def test_phases_of_a_network_are_those_of_its_legs():
    network = NETWORKS['phase6'].presets()['unnamed'].network
    other = network.with_phases({'lh': 0.25, 'rm': 0.9, 'tail': 0.5})
    assert (other.offset_lh, other.offset_rm) == pytest.approx((0.25, -0.1))
    assert other.leads[3] == pytest.approx(0.65) and other.offset_lf == network.offset_lf
    delayed = NETWORKS['delayed'].presets()['trot'].network
    assert delayed.with_phases({'lh': 0.25}) is delayed and delayed.leads == ()

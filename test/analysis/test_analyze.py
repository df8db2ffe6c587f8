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

"""The executable analyze: what it says, as text, JSON and pictures, and what it refuses."""

from dataclasses import replace
import json
import re
import subprocess
import sys

from cpg_ros.analysis import optimize
from cpg_ros.analysis.analyze import main
from cpg_ros.dynamics.floquet import multipliers
from cpg_ros.dynamics.fourier.floquet import EXACT
from cpg_ros.dynamics.integration.simulate import simulate
from cpg_ros.dynamics.solve_orbit import solve_orbit
from cpg_ros.networks.library.biped import Biped
from cpg_ros.networks.library.delayed import Delayed
from cpg_ros.networks.library.quadruped import Quadruped
from cpg_ros.networks.presets import read_presets, write_presets
from cpg_ros.networks.registry import PRESETS
from depth import in_depth, in_full
import numpy as np
import pytest
import yaml

EXAMPLE_1 = ('--network', 'delayed', '--set', 'a=-4.5', 'b=1', 'c=6.5', 'd=-2', 'tau=0.4')
#: Keys that the interface promises.
HOPF = {'gait', 'omega', 'tau', 'k1', 'k2', 'k1_published', 'k2_published', 'supercritical',
        'stable_on_centre_manifold', 'unstable_transverse_roots'}
GAIT = {'exists', 'period', 'amplitude', 'phases', 'floquet_leading',
        'floquet_leading_transverse', 'stable', 'min_symmetry_gain', 'stable_with_default_gain'}


def as_json(capsys, *arguments):
    assert main([*arguments, '--json']) == 0
    return json.loads(capsys.readouterr().out)


def test_example_1_as_json(capsys):
    # docs/numbers_and_errata.md, section Hopf points of the delayed network.
    said = as_json(capsys, *EXAMPLE_1)
    assert said['network'] == 'delayed'
    assert said['params'] == {'a': -4.5, 'b': 1.0, 'c': 6.5, 'd': -2.0, 'tau': 0.4}
    trot, walk = said['hopf'][:2]
    assert all(set(point) >= HOPF for point in said['hopf'])
    assert (trot['gait'], walk['gait']) == ('trot', 'walk')
    for point, figures in ((trot, (6.3246, 0.2852, 2.1557, -0.9610, 0.6486, -0.2544)),
                           (walk, (7.4772, 0.2861, 1.8135, -0.9177, 0.4179, -0.2349))):
        found = [point[key] for key in ('omega', 'tau', 'k1', 'k2', 'k1_published',
                                        'k2_published')]
        assert found == pytest.approx(figures, abs=6e-5)
        assert point['supercritical'] and point['stable_on_centre_manifold']
        assert point['unstable_transverse_roots'] > 0
    gaits = said['gaits']
    assert set(gaits) == {'pronk', 'pace', 'bound', 'trot', 'jump', 'walk'}
    assert {gait for gait in gaits if gaits[gait]['exists']} == {'trot', 'walk', 'jump'}
    assert gaits['trot']['period'] == pytest.approx(1.27827056, abs=1e-8)
    assert gaits['trot']['amplitude'] == pytest.approx(0.981144, abs=1e-6)
    assert gaits['walk']['period'] == pytest.approx(1.09048163, abs=1e-8)
    assert gaits['trot']['phases'] == {'lh': 0.0, 'rh': 0.5, 'lf': 0.5, 'rf': 0.0}
    assert gaits['walk']['phases'] == {'lh': 0.0, 'rh': 0.5, 'lf': 0.25, 'rf': 0.75}
    for gait in ('trot', 'walk'):
        one = gaits[gait]
        assert set(one) >= GAIT
        assert not one['stable'] and one['stable_with_default_gain']
        assert one['floquet_leading'] < 1.0 < one['floquet_leading_transverse']
        assert 0.0 < one['min_symmetry_gain'] < one['default_symmetry_gain']
        assert one['floquet_error'] < 1e-6


def test_example_1_as_text(capsys):
    assert main(EXAMPLE_1) == 0
    said = capsys.readouterr().out
    for words in ('delayed: a -4.5, b 1, c 6.5, d -2, tau 0.4', 'Hopf points up to a delay of 0.8',
                  '0.2852', '7.4772', '1.278271', 'supercritical',
                  'trot, jump, walk: stable with the symmetry lock only'):
        assert words in said
    # The paper's wrong coefficients are for JSON and reproduce.
    assert "k1'" not in said and max(map(len, said.splitlines())) <= 160


@pytest.mark.parametrize(('changes', 'name', 'gait'), [
    (('b=0.5', 'c=4.4', 'd=-0.3'), 'tau', 'trot'),
    *in_depth((('c=1',), 'c', None), (('b=0.5', 'c=4.4', 'd=0.3'), 'tau', 'pace'),
              (('c=4.5', 'd=0'), 'tau', None))])
def test_a_set_without_gait_is_told_its_nearest_threshold(capsys, changes, name, gait):
    assert main(['--set', *changes]) == 0
    (nearest,) = re.findall(r'No gait was found at these parameters; (.*)\.\n',
                            capsys.readouterr().out)
    # What it names is a threshold: just below still nothing, just above a gait (with a delay).
    threshold = float(re.search(r'(?:delay|c\|) (\d+\.\d{4})', nearest)[1])
    rest = [change for change in changes if not change.startswith(f'{name}=')]
    if name == 'tau':
        below, above = (as_json(capsys, '--set', *rest, f'tau={factor * threshold}')
                        for factor in (0.99, 1.01))
        assert not any(one['exists'] for one in below['gaits'].values())
        assert below['nearest_threshold'].partition(' (')[0] == nearest.partition(' (')[0]
        there = {found for found, one in above['gaits'].items() if one['exists']}
        assert there and (gait is None or gait in there)
    else:
        below, above = (as_json(capsys, '--set', *rest, f'c={factor * threshold}',
                                '--longest-delay', '100') for factor in (0.99, 1.01))
        assert not below['hopf'] and above['hopf']


def test_a_gait_far_from_every_hopf_point_is_found(capsys):
    # Below the first critical delay, .2852: a jump that rests between its steps, and that was
    # missed where simulations ended before they had settled.
    said = as_json(capsys, '--set', 'tau=0.28')
    assert {gait for gait, one in said['gaits'].items() if one['exists']} == {'jump'}
    network = Delayed(-4.5, 1.0, 6.5, -2.0, 0.28)
    symmetry = network.symmetry('jump')
    start = np.random.default_rng(5).uniform(-1.0, 1.0, 8) @ symmetry.basis.T @ symmetry.basis
    run = simulate(network, start, 400.0, 0.0025, lock=(1.0, symmetry), progress=False)
    v = run.x[:, 0]
    rises = run.t[np.flatnonzero((v[:-1] < 0.0) & (v[1:] >= 0.0))][-5:]
    assert said['gaits']['jump']['period'] == pytest.approx(np.diff(rises).mean(), rel=1e-3)
    assert said['gaits']['jump']['stable_with_default_gain']


def test_gaits_that_are_born_unstable_are_found_and_judged(capsys):
    # A bound with c > 0 exists beyond its critical delay, but no lock can make it attract.
    said = as_json(capsys, '--set', 'a=-4.5', 'b=1', 'c=6.5', 'd=-2', 'tau=0.9')
    bound = said['gaits']['bound']
    assert bound['exists'] and bound['floquet_leading'] > 1.0
    assert not bound['stable'] and not bound['stable_with_default_gain']
    (point,) = (point for point in said['hopf']
                if point['gait'] == 'bound' and point['tau'] < 0.9)
    # Its class has an unstable root at onset, before any nonlinearity.
    assert point['unstable_roots'] > point['unstable_transverse_roots']
    assert not said['gaits']['pronk']['exists']
    assert 'critical delay 1.6515' in said['gaits']['pronk']['why']


def test_multipliers_that_are_unsure_are_said_to_be(capsys, monkeypatch):
    # One polynomial for a delay of two periods is far too coarse.
    monkeypatch.setattr('cpg_ros.dynamics.fourier.floquet.MAX_ELEMENT_LENGTH', 100.0)
    monkeypatch.setattr(multipliers, '__defaults__', (0.0, EXACT._replace(halvings=1)))
    assert main(['--network', 'delayed', '--set', 'tau=3']) == 0
    assert 'instead of 1; the others are no better' in capsys.readouterr().out


def test_what_is_neutral_does_not_attract(capsys):
    # With d = 0 the rings do not hear one another: nothing holds a walk's fore and hind legs.
    walk = as_json(capsys, '--set', 'd=0')['gaits']['walk']
    assert walk['exists'] and walk['floquet_leading'] == pytest.approx(1.0, abs=1e-9)
    assert not walk['stable'] and not walk['stable_with_default_gain']


def test_branches_along_another_parameter_than_the_delay(tmp_path):
    path = tmp_path / 'c.png'
    assert main(['--along', 'c', '--range', '6:7', '--plot', str(path)]) == 0
    assert path.stat().st_size > 10_000 and path.read_bytes().startswith(b'\x89PNG')


def test_a_quadruped_set(capsys):
    said = as_json(capsys, '--network', 'quadruped', '--preset', 'pace', '--along', 'gamma=delta',
                   '--range=-0.4:0.4')
    pace = said['gaits']['pace']
    assert pace['period'] == pytest.approx(10.388, abs=1e-3) and pace['stable']
    assert pace['phases'] == {'lh': 0.0, 'rh': 0.5, 'lf': 0.0, 'rf': 0.5}
    stand = said['rest']['stand']
    assert (stand['v'], stand['w']) == pytest.approx((0.3096, 0.5240), abs=1e-4)
    assert {point['gait'] for point in said['hopf']} >= {'pace', 'pronk'}
    for point in said['hopf']:
        # The whole Jacobian has the pair there, wherever the stand has moved to.
        network = Quadruped(0.2, 0.2, point['value'], point['value'])
        state = np.repeat([0.31, 0.52], 8)
        for _ in range(30):
            state = state - np.linalg.solve(network.jacobian(state), network.rates(state))
        assert np.ptp(state[:8]) < 1e-9
        roots = np.linalg.eigvals(network.jacobian(state))
        assert np.abs(roots - 1j * point['omega']).min() < 1e-6


def test_a_biped_set_with_weights_of_its_own(capsys):
    said = as_json(capsys, '--network', 'biped', '--preset', 'skip')
    assert said['gaits']['skip']['exists'] and said['gaits']['skip']['waveforms'] == 2
    assert 'to be equal' in said['gaits']['walk']['why']
    # What symmetry the weights leave has classes of its own, with two legs each.
    assert [len(root['mode']) for root in said['rest']['leading_roots']] == [1, 1]
    assert 'skip' in {point['gait'] for point in said['hopf']}


def test_hopf_points_of_linear_rates_have_no_normal_form(capsys, monkeypatch):
    """Matsuoka's neurons: orbits are born with the size at which a potential reaches 0."""
    monkeypatch.setattr('cpg_ros.analysis.analyze.verdicts', lambda *arguments: {})
    monkeypatch.setattr('cpg_ros.dynamics.hopf.GRID_SIZE', 25)
    args = ('--network', 'matsuoka', '--range', '0.5:1.2')
    (point,) = as_json(capsys, *args)['hopf']
    # 1 + tau/tau_v, less the three weights of 0.05 in phase and out of phase alike, twice.
    assert (point['gait'], point['value']) == ('trot', pytest.approx(0.95, abs=1e-9))
    assert point['degenerate'] and {point[key] for key in (
        'k2', 'lyapunov', 'supercritical', 'stable_on_centre_manifold')} == {None}
    assert main(list(args)) == 0
    text = capsys.readouterr().out
    assert 'critical' not in text and 'So there is no normal form' in text
    assert re.search(r' trot .* - +- +degenerate +- +0 +0\n', text)
    for beyond in (1e-4, 1e-6):
        network = replace(PRESETS['matsuoka']['trot'].network, a=point['value'] + beyond)
        orbit = solve_orbit(network, 'trot')
        assert orbit.period == pytest.approx(2.0 * np.pi / point['omega'], rel=beyond)
        half = 0.5 * np.ptp(orbit.waveform(np.linspace(0.0, 1.0, 401)))
        assert half == pytest.approx(1.0 / (1.0 + 2.5 + point['value']), rel=0.5 * beyond**0.5)
    # Without input the stand is on the kink itself.
    assert 'on a kink' in as_json(capsys, *args, '--set', 'c=0')['rest']['why']
    assert as_json(capsys, '--network', 'hopf', '--range=-1:1')['hopf'][0]['degenerate'] is False


@pytest.mark.deep
def test_coexisting_orbits_are_listed(capsys):
    """At a long delay the trot, which attracts in its class, and shorter ones, which do not."""
    trot = as_json(capsys, *EXAMPLE_1[:-1], 'tau=4', '--all-orbits')['gaits']['trot']
    assert trot['period'] == pytest.approx(8.5674, abs=1e-4) and trot['floquet_leading'] < 0.1
    assert 'searched from 40 starts' in trot['searched']
    assert min(abs(one['period'] - 2.854527) for one in trot['others']) < 1e-5
    assert all(one['floquet_leading'] > 1.0 for one in trot['others'])


def test_a_certified_set_is_not_called_unrunnable(capsys):
    certified = ('--network', 'biped', '--set', 'current=0.2787', 'phi=0.2601', 'w_21=0.2612',
                 'w_12=-0.8434', 'w_43=0.2612', 'w_34=-0.8434', 'w_31=0.7012', 'w_42=0.4165',
                 'w_13=0.7012', 'w_24=0.4165', 'w_41=-0.5327', 'w_32=0.442', 'w_23=-0.5327',
                 'w_14=0.442')
    assert main(certified) == 0
    text = capsys.readouterr().out
    assert text.endswith('one_legged_hop: stable.\n')
    assert '13.914316' in text and '13.381192' in text
    assert text.index('13.914316') < text.index('13.381192')


def test_presets_of_a_file(capsys, tmp_path):
    """What optimize writes is stable; what inversion writes is read, too."""
    path = tmp_path / 'preset.yaml'
    if in_full():
        assert optimize.main(['--gait', 'walk', '--population', '12', '--generations', '3',
                              '--out', str(tmp_path)]) == 0
        capsys.readouterr()
    else:
        write_presets(path, Biped, {'walk_optimised': PRESETS['biped']['walk']})
    said = as_json(capsys, '--presets', str(path))
    stored = read_presets(path, Biped)['walk_optimised']
    assert said['network'] == 'biped' and said['params'] == stored.network.as_dict()
    assert said['gaits']['walk']['stable']
    assert said['gaits']['walk']['period'] == pytest.approx(stored.period, rel=1e-8)
    if in_full():
        assert as_json(capsys, '--presets', str(path), '--preset', 'walk_optimised') == said
    write_presets(path, Biped, {'one': stored, 'two': PRESETS['biped']['run']})
    assert main(['--presets', str(path)]) == 2
    assert 'has several, choose from one, two' in capsys.readouterr().err
    fitted = tmp_path / 'fitted.yaml'
    fitted.write_text(yaml.safe_dump({'/**': {'ros__parameters': {
        'network': 'delayed', 'robot': 'robot.yaml', 'gait': 'trot', 'frequency': 1.5,
        'amplitude': 1.0, 'delayed': PRESETS['delayed']['trot'].network.as_dict()}}}))
    said = as_json(capsys, '--presets', str(fitted), '--set', 'tau=0.5')
    assert said['params']['tau'] == 0.5 and said['gaits']['trot']['exists']
    fitted.write_text('presets: 1\n')
    assert main(['--presets', str(fitted)]) == 2
    assert 'fitted.yaml: network: is not given' in capsys.readouterr().err


@pytest.mark.parametrize(('arguments', 'words'), [
    (('--set', 'tau=nan'), 'tau is nan, it must be finite'),
    (('--set', 'c=inf'), 'c is inf, it must be finite'),
    (('--set', 'b=-1e300', 'c=1e300'), 'b is -1e+300, it must be at most 1e+06'),
    (('--set', 'tau=-0.1'), 'tau is -0.1, a delay must be positive'),
    (('--set', 'tau=0'), 'tau is 0, a delay must be positive'),
    (('--set', 'c=0'), 'c is 0'),
    (('--set', 'e=1'), "'e' is not a parameter of the delayed network: a, b, c, d, tau"),
    (('--set', 'tau=1', 'tau=2'), 'tau is given twice'),
    (('--set', 'tau=fast'), "'fast' is not a number"),
    (('--set', 'tau'), 'name=value'),
    (('--network', 'hexapod'), "'hexapod' is not one of delayed, quadruped, biped"),
    (('--preset', 'canter'), "'canter' is not one of walk, trot"),
    (('--network', 'biped', '--set', 'w_a=1', 'w_21=2'), 'w_21 is given twice'),
    (('--along', 'speed'), "'speed' is not one of a, b, c, d, tau"),
    (('--network', 'quadruped', '--along', 'alpha=alpha'), 'alpha twice'),
    (('--network', 'quadruped', '--range', '1:0'), '1:0 is not from low to high'),
    (('--longest-delay', 'nan'), '--longest-delay'),
    (('--set', 'tau=6'), 'tau is 6, delays go up to 5'),
    (('--along', 'c', '--plot', 'a.png'), 'c needs a --range'),
    (('--network', 'quadruped', '--range', '0:0'), '0:0 is not from low to high'),
    (('--plot', 'nowhere/a.png'), 'there is no folder nowhere'),
    (('--plot', 'a.xyz'), "'.xyz' is not a kind of picture"),
    (('--quietly',), '--quietly')])
def test_nonsense_ends_in_one_line(capsys, arguments, words):
    try:
        code = main(list(arguments))
    except SystemExit as ended:
        code = ended.code
    said = capsys.readouterr()
    assert code == 2 and said.out == ''
    assert words in said.err and said.err.startswith('analyze: ') and said.err.count('\n') == 1


def test_as_a_process():
    command = [sys.executable, '-P', '-m', 'cpg_ros.analysis.analyze']
    bad = subprocess.run([*command, '--set', 'c=0'], capture_output=True, text=True, timeout=120)
    assert bad.returncode == 2 and 'Traceback' not in bad.stderr and bad.stderr.count('\n') == 1
    with subprocess.Popen([*command, '--network', 'biped'], stdout=subprocess.PIPE,
                          stderr=subprocess.PIPE) as left:
        left.stdout.close()
        # A slow machine also says how far it is.
        said = left.stderr.read()
        assert left.wait(120) == 0 and b'Error' not in said and b'Traceback' not in said


@pytest.mark.deep
@pytest.mark.parametrize(('name', 'head'), [
    ('a.png', b'\x89PNG'), ('a.pdf', b'%PDF'), ('a.svg', b'<?xml')])
def test_pictures(capsys, tmp_path, name, head):
    # A short range of delays, so that few branches are followed.
    path = tmp_path / name
    assert main(['--plot', str(path), '--longest-delay', '0.42']) == 0
    assert path.read_bytes().startswith(head) and list(tmp_path.iterdir()) == [path]


def test_how_gaits_lose_their_stability_is_printed_and_drawn(capsys, tmp_path):
    """The biped's run: a torus, of which test_orbit_normal_form shows that it is hard."""
    arguments = ['--network', 'biped', '--preset', 'run', '--along', 'w_a', '--range=-0.54:-0.5',
                 '--set', 'w_21=-0.52', 'w_12=-0.52', 'w_43=-0.52', 'w_34=-0.52',
                 '--plot', str(tmp_path / 'run.png')]
    if in_full():
        (loss,) = (one for one in as_json(capsys, *arguments)['stability_losses']
                   if one['kind'] == 'torus')
        assert loss['value'] == pytest.approx(-0.5328, abs=1e-4)
        assert loss['gait'] == 'run' and loss['soft'] is False and loss['cubic'] > 0.0
    assert main(arguments) == 0
    assert ('run loses stability at w_21=w_12=w_43=w_34 -0.532807 (torus), subcritical: no '
            'stable motion nearby, the gait jumps') in capsys.readouterr().out


def test_phase_responses_are_printed_and_drawn(capsys, tmp_path):
    picture = tmp_path / 'prc.png'
    said = as_json(capsys, '--network', 'biped', '--prc', str(picture))
    assert picture.read_bytes().startswith(b'\x89PNG')
    assert set(said['phase_response']) == {gait for gait, one in said['gaits'].items()
                                           if one['exists']}
    walk = said['phase_response']['walk']
    assert [one['variable'] for one in walk['curves']] == ['v', 'w']
    assert [one['cells'] for one in walk['curves']] == [[1, 2, 3, 4]] * 2
    # A constant input to v of all cells is a change of the current.
    network = PRESETS['biped']['walk'].network
    faster, slower = (1.0 / solve_orbit(network.replace(current=network.current + change),
                                        'walk').period for change in (1e-4, -1e-4))
    assert 4.0 * np.mean(walk['curves'][0]['response']) == pytest.approx(
        (faster - slower) / 2e-4, rel=1e-4)


def test_phase_responses_in_text_and_what_is_refused(capsys, tmp_path):
    assert main([*EXAMPLE_1, '--prc']) == 0
    said = capsys.readouterr().out
    assert 'Phase response: largest advance and delay' in said
    assert max(map(len, said.splitlines())) <= 160
    for file, why in ((tmp_path / 'no' / 'prc.png', 'there is no folder'),
                      (tmp_path / 'prc.xyz', "'.xyz' is not a kind of picture")):
        assert main([*EXAMPLE_1, '--prc', str(file)]) == 2
        assert why in capsys.readouterr().err


def test_basins_are_counted_and_printed(capsys):
    arguments = ('--network', 'biped', '--preset', 'run', '--basin', '5', '--seed', '2')
    found = as_json(capsys, *arguments)
    basins = found['basins']
    assert set(basins) == {gait for gait, one in found['gaits'].items() if one['exists']
                           and (one['stable'] or one['stable_with_default_gain'])}
    for one in basins.values():
        assert (one['states'], one['seed']) == (5, 2)
        assert one['returned'] + sum(one['others'].values()) == 5
        assert one['interval'][0] <= one['fraction'] == one['returned'] / 5 <= one['interval'][1]
    for words, why in ((('--basin', '0'), '--basin: 0 is not from 1'),
                       (('--seed', '1'), '--seed: it must be 0 or more, and goes with --basin')):
        assert main([*EXAMPLE_1, *words]) == 2
        assert why in capsys.readouterr().err

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

"""The Morris-Lecar networks in the generator: as the delayed one, by the same services."""

from pathlib import Path
import re

from ament_index_python.packages import get_package_share_directory
from cpg_ros.motion.plan import plan
from cpg_ros.motion.robot_file import read_robot
from cpg_ros.networks.presets import write_presets
from cpg_ros.networks.registry import NETWORKS, PRESETS
from depth import in_depth
from graph import until
import pytest
from stepped import refused
from switches import check_switches, off

CONFIG = Path(get_package_share_directory('cpg_ros')) / 'config'
# Phases of the legs, where the gait's symmetry prescribes them: docs/theory.md, section The
# delayed network and section The biped network.
PHASES = {'quadruped': {'pronk': (0, 0, 0, 0), 'pace': (0, .5, 0, .5), 'bound': (0, 0, .5, .5),
                        'trot': (0, .5, .5, 0), 'jump': (0, 0, .75, .75),
                        'walk': (0, .5, .75, .25)},
          'biped': {'walk': (0, .5), 'run': (0, .5), 'two_legged_jump': (0, 0),
                    'two_legged_hop': (0, 0), 'skip': (0, .5)}}
TWIN = """
from dataclasses import dataclass

from cpg_ros.networks.library.delayed import PRESETS, Delayed
from cpg_ros.networks.network import Preset


@dataclass(frozen=True)
class Twin(Delayed):
    name = 'twin'

    @classmethod
    def presets(cls):
        return {name: Preset(one.gait, cls(**one.network.as_dict()))
                for name, one in PRESETS.items()}
"""
DEFAULT = {'quadruped': 'trot', 'biped': 'walk'}


def for_network(text, network):
    """Return the text of a robot file with another network."""
    return re.sub('^network: .*$', f'network: {network}', text, flags=re.M)


@pytest.fixture(params=['biped', *in_depth('quadruped')])
def live(request, generators):
    generator = generators(request.param)
    with generator.lent():
        assert generator.watcher.set_together(frequency=3.0, transition=0.25).successful
        yield request.param, generator.watcher


def test_gaits_switch_without_a_jerk(live):
    network, watcher = live
    robot = read_robot(CONFIG / f'{network}.yaml')
    plans = {name: plan(robot, name, preset, preset.network, 3.0)
                for name, preset in PRESETS[network].items() if name == preset.gait}
    check_switches(watcher, robot, plans, PHASES[network], 0.35)


def test_every_gait_comes_to_its_phases_and_stays_healthy(live):
    network, watcher = live
    for gait, expected in PHASES[network].items():
        if gait not in PRESETS[network]:
            continue
        assert watcher.set(gait=gait)[0].successful
        watcher.record(1.0)
        seen = watcher.next_phases(20)
        assert off(seen, expected) < 1e-3, gait
        begin = len(watcher.diagnostics)
        health = until(lambda begin=begin: watcher.diagnostics[begin + 1:], 'diagnostics')[-1]
        values = {pair.key: pair.value for pair in health.values}
        assert values['gait'] == gait and values['network'] == network
        assert values['watchdog re-seeds'] == '0', gait


@pytest.mark.parametrize('live, changes, reason', [
    ('quadruped', {'quadruped_gamma': 3.0}, 'no trot at these parameters'),
    ('quadruped', {'quadruped_alpha': 9.0}, 'out of range'),
    ('quadruped', {'quadruped_beta': float('nan')}, 'out of range'),
    ('quadruped', {'gait': 'skip'}, "gait 'skip' is not one of"),
    ('quadruped', {'delayed_tau': 0.4}, 'delayed.tau'),
    ('biped', {'biped_current': 0.0}, 'no walk at these parameters'),
    ('biped', {'biped_w_21': 5.0}, 'out of range'),
    ('biped', {'gait': 'trot'}, "gait 'trot' is not one of"),
    ('biped', {'gait': 'run', 'frequency': 9.9, 'amplitude': 1.2}, 'above its limit')],
    indirect=['live'])
def test_refused_with_the_reason_and_as_a_whole(live, changes, reason):
    network, watcher = live
    assert watcher.set(gait=DEFAULT[network])[0].successful
    names = ['gait', 'frequency', 'amplitude',
             *(f'{network}.{key}' for key in NETWORKS[network].parameters())]
    before = watcher.get(*names)
    result = watcher.set_together(**changes)
    assert not result.successful
    assert reason in result.reason and '\n' not in result.reason
    assert watcher.get(*names) == before


def test_a_gait_loads_its_preset_and_small_changes_run(live):
    network, watcher = live
    gait = {'quadruped': 'pace', 'biped': 'run'}[network]
    preset = PRESETS[network][gait].network
    names = [f'{network}.{key}' for key in preset.parameters()]
    assert watcher.set(gait=gait)[0].successful
    assert watcher.get(*names) == list(preset.as_dict().values())
    key = {'quadruped': 'quadruped_gamma', 'biped': 'biped_w_c'}[network]
    value = 1.05 * {'quadruped': preset.as_dict().get('gamma'),
                    'biped': preset.as_dict().get('w_14')}[network]
    assert watcher.set(**{key: value})[0].successful
    watcher.record(0.5)
    assert watcher.get('gait') == [gait]
    assert watcher.set(gait=gait)[0].successful


def test_a_group_of_weights_is_set_together(stepped):
    _, watcher = stepped('-p', 'network:=biped', '-p', 'biped.w_b:=-0.65')
    b = [f'biped.w_{pair}' for pair in ('31', '42', '13', '24')]
    assert watcher.get(*b, 'biped.w_b') == [-0.65] * 5
    assert watcher.set(biped_w_b=-0.681)[0].successful
    assert watcher.get(*b, 'biped.w_b') == [-0.681] * 5
    # One weight alone would break the walk's symmetry: no such gait, and nothing is changed.
    result = watcher.set(biped_w_24=-0.68)[0]
    assert not result.successful
    assert result.reason == ('no walk with these weights: its symmetry needs '
                             'w_31, w_13, w_42, w_24 to be equal')
    assert watcher.get(*b, 'biped.w_b') == [-0.681] * 5
    # A gait's preset and a group over it, in one batch.
    assert watcher.set_together(gait='run', biped_w_a=-0.9).successful
    assert watcher.get('biped.w_21', 'biped.w_12', 'biped.w_31') == [-0.9, -0.9, 1.0]
    # All four, one by one in a batch, set the group's mean.
    assert watcher.set_together(**{f'biped_w_{pair}': -0.91 for pair in
                                   ('21', '12', '43', '34')}).successful
    assert watcher.get('biped.w_a') == [pytest.approx(-0.91)]


def test_a_network_in_a_file_has_parameters_of_its_own(tmp_path, stepped):
    (path := tmp_path / 'twin.py').write_text(TWIN)
    text = (CONFIG / 'quadruped.yaml').read_text()
    (robot := tmp_path / 'robot.yaml').write_text(for_network(text, 'twin'))
    _, watcher = stepped('-p', f'network:={path}', '-p', f'robot:={robot}', '-p', 'twin.c:=6.0')
    assert watcher.get('network', 'gait', 'twin.c', 'twin.tau') == [str(path), 'trot', 6.0, 0.4]
    assert watcher.set(gait='walk', **{'twin.c': 6.2})[0].successful
    result = watcher.set_together(gait='trot', **{'twin.tau': 0.2})
    # docs/numbers_and_errata.md, section Hopf points of the delayed network.
    assert not result.successful and '0.2852' in result.reason
    (path := tmp_path / 'taken.py').write_text(TWIN.replace("'twin'", "'biped'"))
    assert (f"network {path}: the name 'biped' is that of another network"
            in refused('-p', f'network:={path}'))


def test_presets_of_a_file_are_gaits_like_the_shipped_ones(tmp_path, stepped):
    path = tmp_path / 'mine.yaml'
    write_presets(path, NETWORKS['biped'], {'stroll': PRESETS['biped']['walk']})
    _, watcher = stepped('-p', 'network:=biped', '-p', f'presets:={path}', '-p', 'gait:=stroll')
    until(lambda: watcher.gaits, 'the gait')
    assert watcher.gaits[-1] == 'stroll'
    assert watcher.set(gait='run')[0].successful and watcher.set(gait='stroll')[0].successful
    path.write_text(path.read_text().replace('gait: walk', 'gait: crawl'))
    assert ("presets.stroll.gait: 'crawl' is not one of walk"
            in refused('-p', 'network:=biped', '-p', f'presets:={path}'))


@pytest.mark.parametrize('arguments, words', [
    (['network:=hexapod'], "network 'hexapod' is not one of delayed, quadruped, biped"),
    (['network:=biped', 'robot:=goat'], "robot file 'goat' is for the network delayed or "
     "quadruped, not 'biped'"),
    (['network:=biped', 'gait:=trot'], "gait 'trot' is not one of walk, run"),
    (['network:=quadruped', 'presets:=/no/such.yaml'], '/no/such.yaml: No such file')])
def test_nonsense_at_start_is_refused_in_one_line(arguments, words):
    reason = refused(*(word for each in arguments for word in ('-p', each)))
    assert words in reason and '\n' not in reason


def test_the_zig_zag_assignment_drives_a_leg_by_two_cells(tmp_path, stepped):
    text = (CONFIG / 'quadruped.yaml').read_text()
    text = for_network(text, 'quadruped\nassignment: zigzag')
    for leg, cells in {'lh': (1, 5), 'rh': (2, 6), 'lf': (3, 7), 'rf': (4, 8)}.items():
        text = text.replace(f'{leg}_calf_joint, cell: {cells[0]}',
                            f'{leg}_calf_joint, cell: {cells[1]}')
    path = tmp_path / 'zigzag.yaml'
    path.write_text(text)
    _, watcher = stepped('-p', 'network:=quadruped', '-p', 'gait:=walk', '-p', f'robot:={path}')
    health = until(lambda: watcher.diagnostics, 'diagnostics')[-1]
    assert {pair.key: pair.value for pair in health.values}['character'] == 'walk-like'
    path.write_text(text.replace('assignment: zigzag', 'assignment: crisscross'))
    assert ("leg 'lh' has the cells 1 and 6, not 5"
            in refused('-p', 'network:=quadruped', '-p', f'robot:={path}'))


@pytest.mark.parametrize('live', ['hopf', *in_depth('matsuoka', 'phase')], indirect=True)
def test_oscillators_switch_without_a_jerk(live):
    network, watcher = live
    robot = read_robot(CONFIG / 'quadruped.yaml')
    plans = {name: plan(robot, name, preset, preset.network, 3.0)
                for name, preset in PRESETS[network].items()}
    phases = {name: gait_plan.orbit.phases[:4] for name, gait_plan in plans.items()}
    check_switches(watcher, robot, plans, phases, 0.35)

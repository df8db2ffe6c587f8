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

"""Networks from outside the package: in a file of the user's, or offered by another package."""

import json
import os
from pathlib import Path
import shutil
import subprocess
import sys

from cpg_ros.analysis.objectives import search_space
from cpg_ros.dynamics.solve_orbit import solve_preset
from cpg_ros.fitting.inversion.parameter_files import write_fitted
from cpg_ros.fitting.inversion.recording_fit import fit_recording
from cpg_ros.fitting.recordings.csv_reader import read_csv
from cpg_ros.motion.plan import plan
from cpg_ros.motion.robot_file import read_robot, RobotError, write_robot
from cpg_ros.networks.registry import find_network, NetworkError, NETWORKS, PRESETS, SHIPPED
from depth import in_depth
import numpy as np
import pytest
import yaml

CONFIG = Path(__file__).resolve().parents[2] / 'config'
TWIN = '''\
from dataclasses import dataclass

from cpg_ros.networks.library.delayed import PRESETS, Delayed
from cpg_ros.networks.network import Preset


@dataclass(frozen=True)
class Twin(Delayed):
    """The delayed network with other names of legs, of which it does not say where they are."""

    name = 'NAME'
    legs = {'implicit': {'p': (1, 7), 'q': (2, 8), 'r': (3, 5), 's': (4, 6)}}
    sides = {}
    girdles = {}

    @classmethod
    def presets(cls):
        return {name: Preset(one.gait, cls(**one.network.as_dict()))
                for name, one in PRESETS.items()}
'''
LEGS = {'lh': 'p', 'rh': 'q', 'lf': 'r', 'rf': 's'}


def written(folder, name):
    (path := folder / f'{name}.py').write_text(TWIN.replace('NAME', name))
    return path


@pytest.fixture(scope='module')
def twin(tmp_path_factory):
    path = written(tmp_path_factory.mktemp('networks'), 'twin')
    find_network(str(path))
    return path


def robot_tree(shipped, network, **places):
    """Return a shipped robot's tree for the twin, with what the file says of each leg's place."""
    tree = yaml.safe_load((CONFIG / f'{shipped}.yaml').read_text())
    tree['network'] = str(network)
    tree.pop('geometry', None)
    tree['legs'] = {LEGS[leg]: {**entry, **{key: words[leg] for key, words in places.items()
                                            if leg in words}}
                    for leg, entry in tree['legs'].items()}
    return tree


def saved(path, tree):
    path.write_text(yaml.safe_dump(tree, sort_keys=False))
    return path


SIDES = {'lh': 'left', 'rh': 'right', 'lf': 'left', 'rf': 'right'}
GIRDLES = {'lh': 'hind', 'rh': 'hind', 'lf': 'fore', 'rf': 'fore'}


def test_a_file_is_a_network_and_then_has_a_name(twin):
    kind = find_network(str(twin))
    assert find_network(str(twin)) is kind is NETWORKS['twin'] is find_network('twin')
    assert list(NETWORKS) == [*SHIPPED, 'twin'] and next(iter(SHIPPED)) == 'delayed'
    assert PRESETS['twin'] == kind.presets()
    orbit, known = (solve_preset(PRESETS[name]['trot']) for name in ('twin', 'delayed'))
    assert orbit.period == known.period


def test_presets_stand_beside_the_file(tmp_path):
    (path := tmp_path / 'ring.py').write_text(
        'from dataclasses import dataclass\n'
        'from cpg_ros.networks.library.quadruped import Quadruped\n'
        "@dataclass(frozen=True)\nclass Ring(Quadruped):\n    name = 'ring'\n")
    with pytest.raises(NetworkError, match=r'ring\.py: PresetError: .*No such file'):
        find_network(str(path))
    shipped = (CONFIG / 'presets' / 'quadruped.yaml').read_text()
    path.with_suffix('.yaml').write_text(shipped.replace('network: quadruped', 'network: ring'))
    found = find_network(str(path)).presets()
    assert {name: one.network.as_dict() for name, one in found.items()} == {
        name: one.network.as_dict() for name, one in PRESETS['quadruped'].items()}
    assert {type(one.network) for one in found.values()} == {NETWORKS['ring']}
    space = search_space(str(path), 'trot', {}, {'beta': 0.25})
    assert [variable.name for variable in space.free] == ['alpha', 'gamma', 'delta']


@pytest.mark.parametrize(('old', 'new', 'words'), [
    ("name = 'NAME'", "name = 'biped'", "the name 'biped' is that of another network"),
    ("name = 'NAME'", "name = 'a b'", "name: 'a b' is not of letters"),
    ("'implicit'", "'implicit': {'p': (1, 7)}, 'more'", 'legs: more: it has other legs than'),
    ('(1, 7)', '(1, 9)', 'legs: implicit: p has the cell 9, and there are 8'),
    ('(1, 7)', '()', 'legs: implicit: p has no cell'),
    ('sides = {}', "sides = {'lh': 'left'}", "sides: 'lh' is not one of p, q, r, s"),
    ('sides = {}', "sides = {'p': 'top'}", "sides: 'top' is not one of left, right"),
    ('sides = {}', 'ranges = {}', "ranges: the parameter 'a' has none"),
    ('sides = {}', "free = ('k',)", "free: 'k' is not one of a, b, c, d, tau"),
    ('sides = {}', "line = 'k'", "InputError: 'k' is not one of a, b, c, d, tau"),
    ('sides = {}', "sides = {}\n    usual_gait = 'canter'", "usual_gait: 'canter' is not one of "),
    ('sides = {}', "readout = 'phase'", "readout 'phase' needs cells with two variables"),
    ('sides = {}', "searched = {'a': (0, 1)}", "searched: the parameter 'b' has no bounds"),
    ('one.gait,', "'canter',", "presets: walk: 'canter' is not one of pronk, pace"),
    ('cls(**', 'Delayed(**', 'presets: walk: it is of another network, Delayed'),
    ('PRESETS.items()}', "PRESETS.items() if name != 'jump'}",
     "presets: the gait 'jump' has none of its own name"),
    ('class Twin(Delayed)', 'class Twin', 'it must define one class of networks, not none'),
    ('\n@dataclass', '\nclass Other(Delayed):\n    pass\n\n@dataclass',
     'one class of networks, not 2: Other, Twin'),
    ('import PRESETS', 'import NOTHING', 'ImportError: cannot import name'),
    ('def presets', 'deaf presets', 'SyntaxError: '),
    ('def presets(cls):', 'def presets(cls):\n        1 / 0', 'ZeroDivisionError: division')])
def test_what_cannot_be_used_is_refused_in_one_line(tmp_path, old, new, words):
    (path := tmp_path / 'odd.py').write_text(TWIN.replace(old, new).replace('NAME', 'odd'))
    with pytest.raises(NetworkError) as caught:
        find_network(str(path))
    said = str(caught.value)
    assert said.startswith(f'{path}: ') and words in said and '\n' not in said, said
    assert 'odd' not in NETWORKS


def test_names_that_lead_nowhere(tmp_path):
    for name, words in ((f'{tmp_path}/none.py', 'there is no such file'),
                        (f'{tmp_path}', 'there is no such file'), ('a\0b.py', 'null'),
                        ('hexapod', "'hexapod' is not one of delayed, quadruped, biped")):
        with pytest.raises(NetworkError, match=words):
            find_network(name)


def test_robot_files_name_it_and_say_where_legs_are(tmp_path, twin):
    tree = robot_tree('unitree_go2', os.path.relpath(twin, tmp_path), side=SIDES, girdle=GIRDLES)
    robot = read_robot(saved(tmp_path / 'mine.yaml', tree))
    assert robot.networks == ('twin',) and robot.girdles['p'] == 'hind'
    write_robot(tmp_path / 'deep.yaml', robot)
    assert read_robot(tmp_path / 'deep.yaml').legs == robot.legs
    known = read_robot(CONFIG / 'unitree_go2.yaml')
    strides = [plan(one, 'trot', PRESETS[name]['trot'], PRESETS[name]['trot'].network,
                    one.motions['trot'].frequency).steer(0.3, 0.4)[0]
               for one, name in ((robot, 'twin'), (known, 'delayed'))]
    assert np.array_equal(*strides) and np.ptp(strides[0]) > 0.1


@pytest.mark.parametrize(('sides', 'words'), [
    ({**SIDES, 'rf': 'top'}, "legs.s.side: 'top' is not one of left, right"),
    ({leg: SIDES[leg] for leg in ('lh', 'rh', 'lf')}, 'legs.s.side: is missing: steering')])
def test_sides_that_are_wrong_or_missing(tmp_path, twin, sides, words):
    path = saved(tmp_path / 'mine.yaml', robot_tree('unitree_go2', twin, side=sides))
    with pytest.raises(RobotError, match=words):
        read_robot(path)


def test_a_robot_file_does_not_contradict_its_network(tmp_path):
    tree = yaml.safe_load((CONFIG / 'goat.yaml').read_text())
    tree['legs']['lh']['side'] = 'left'
    assert read_robot(saved(tmp_path / 'goat.yaml', tree)).sides == SIDES
    tree['legs']['lh']['side'] = 'right'
    with pytest.raises(RobotError, match=r"legs\.lh\.side: 'right' does not agree"):
        read_robot(saved(tmp_path / 'goat.yaml', tree))


def test_a_fit_names_the_file(tmp_path, twin):
    robot = read_robot(saved(tmp_path / 'mine.yaml', robot_tree('goat', twin)))
    orbit, t = solve_preset(PRESETS['twin']['trot']), np.arange(0.0, 8.0, 0.01)
    angles = [joint.offset + 0.2 * orbit.waveform(t + orbit.phases[joint.cell - 1]) / orbit.peak
              for joint in robot.joints]
    head = ','.join(['time', *(joint.name for joint in robot.joints)])
    np.savetxt(tmp_path / 'trot.csv', np.array([t, *angles]).T, delimiter=',', header=head,
               comments='')
    found = fit_recording(read_csv(tmp_path / 'trot.csv'), robot, free=('c',), order=1)
    assert found.fit.gait == 'trot' and found.fit.network.name == 'twin'
    assert found.stride.frequency == pytest.approx(1.0, abs=1e-4)
    assert found.fit.network.c == pytest.approx(6.5, rel=1e-2)
    parameters, beside = write_fitted(tmp_path / 'fitted.yaml', found, robot)
    node = yaml.safe_load(parameters.read_text())['/**']['ros__parameters']
    assert node['network'] == str(twin) and set(node['twin']) == {'a', 'b', 'c', 'd', 'tau'}
    assert yaml.safe_load(beside.read_text())['network'] == [str(twin)]


def analysed(network, **environment):
    run = subprocess.run([sys.executable, '-P', '-m', 'cpg_ros.analysis.analyze', '--network',
                          network, '--json'], capture_output=True, text=True,
                         env={**os.environ, **environment})
    return run.returncode, run.stderr, json.loads(run.stdout) if run.stdout else None


@pytest.fixture
def offered(tmp_path):
    """Return a package that offers a network, as pip would install it."""
    written(tmp_path, 'lent')
    (info := tmp_path / 'lent-1.0.dist-info').mkdir()
    (info / 'METADATA').write_text('Metadata-Version: 2.1\nName: lent\nVersion: 1.0\n')

    def offer(name, value):
        (info / 'entry_points.txt').write_text(f'[cpg_ros.networks]\n{name} = {value}\n')
        path = os.pathsep.join([str(tmp_path), os.environ.get('PYTHONPATH', ''), os.getcwd()])
        return {'PYTHONPATH': path}
    return offer


def test_other_packages_offer_networks(tmp_path, offered):
    places = offered('lent', 'lent:Twin')
    code, said, found = analysed('lent', **places)
    assert code == 0, said
    shutil.copy(tmp_path / 'lent.py', tmp_path / 'own.py')
    assert analysed('delayed', **places)[2]['gaits']['trot']['period'] == (
        found['gaits']['trot']['period'])
    assert set(found['gaits']['trot']['phases']) == {'p', 'q', 'r', 's'}
    code, said, _ = analysed('hexapod', **places)
    assert code == 2 and f"'hexapod' is not one of {', '.join(SHIPPED)}, lent" in said


@pytest.mark.parametrize(('name', 'value', 'words'), [
    ('lent', 'gone:Twin', "entry point 'lent = gone:Twin': ModuleNotFoundError"),
    *in_depth(('lent', 'lent:PRESETS', 'it is not a network class'),
              ('borrowed', 'lent:Twin', "its network has the name 'lent'"))])
def test_an_offer_of_no_use_harms_itself_alone(offered, name, value, words):
    places = offered(name, value)
    code, said, _ = analysed(name, **places)
    assert code == 2 and words in said and len(said.splitlines()) == 1
    assert analysed('delayed', **places)[0] == 0

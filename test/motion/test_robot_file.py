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

"""Robot files: the shipped ones load, and whatever is wrong is said in one line."""

import copy
from pathlib import Path

from cpg_ros.motion.robot_file import read_robot, RobotError, write_robot
from depth import examples
from hypothesis import given, HealthCheck
from hypothesis import strategies as st
import numpy as np
import pytest
import yaml

CONFIG = Path(__file__).resolve().parents[2] / 'config'
GOAT = yaml.safe_load((CONFIG / 'goat.yaml').read_text())
DROP = '(dropped)'


def broken(path, value):
    """Return the goat's tree with the value at this path (keys with dots) replaced or dropped."""
    *parents, last = [int(key) if key.isdigit() else key for key in path.split('.')]
    node = tree = copy.deepcopy(GOAT)
    for key in parents:
        node = node[key]
    if value is DROP:
        del node[last]
    else:
        node[last] = value
    return tree


def error_of(path):
    with pytest.raises(RobotError) as caught:
        read_robot(path)
    message = str(caught.value)
    assert str(path) in message
    assert len(message.splitlines()) == 1, message
    return message


def test_the_goat():
    robot = read_robot(CONFIG / 'goat.yaml')
    # docs/theory.md, section The delayed network: cells 1, 7 LH; 2, 8 RH; 3, 5 LF; 4, 6 RF.
    assert [(joint.leg, joint.cell) for joint in robot.joints] == [
        ('lh', 1), ('lh', 7), ('rh', 2), ('rh', 8), ('lf', 3), ('lf', 5), ('rf', 4), ('rf', 6)]
    assert robot.order == tuple(GOAT['joint_order'])
    assert np.array_equal(robot.cells, [0, 6, 1, 7, 2, 4, 3, 5])
    assert np.array_equal(robot.leg_cells, [0, 1, 2, 3])
    written = [joint for leg in GOAT['legs'].values() for joint in leg['joints']]
    for key in ('offset', 'lower', 'upper', 'velocity'):
        assert np.array_equal(robot.column(key), [joint[key] for joint in written])
    assert np.array_equal(robot.weights()[:, 0], [joint['amplitude'] for joint in written])
    assert not robot.weights()[:, 1:].any()


def test_the_quadruped_whose_controllers_have_an_order_of_their_own():
    robot = read_robot(CONFIG / 'quadruped.yaml')
    names = [joint.name for joint in robot.joints]
    assert len(names) == 12
    assert sorted(robot.order) == sorted(names) and list(robot.order) != names
    assert np.array_equal(robot.weights()[2], [0.0, -0.22, 0.15, 0.0, 0.0, 0.0])


def test_without_an_order_joints_come_as_in_the_file(tmp_path):
    tree = broken('joint_order', DROP)
    (path := tmp_path / 'robot.yaml').write_text(yaml.safe_dump(tree, sort_keys=False))
    assert read_robot(path).order == tuple(joint.name for joint in read_robot(path).joints)


@pytest.mark.parametrize(('path', 'value', 'words'), [
    ('speed', 3, 'file.speed: unknown key'), ('legs.mid', {}, 'legs.mid: unknown key'),
    ('legs.lh.joint', [], 'legs.lh.joint: unknown key'),
    ('network', DROP, 'file.network: is missing'), ('legs', DROP, 'file.legs: is missing'),
    ('network', 'quad', "network: 'quad' is not one of delayed"),
    ('legs', [1], 'legs: must be a mapping, not [1]'), ('legs.rf', DROP, 'legs.rf: is missing'),
    ('legs.rf', None, 'legs.rf: must be a mapping, not nothing'),
    ('legs.rf.joints', [], 'legs.rf.joints: must be a list with at least one entry'),
    ('legs.lh.joints.0', 'knee', "legs.lh.joints[0]: must be a mapping, not 'knee'"),
    ('legs.rf.joints.1.name', 'lh_toe_joint',
     "legs.rf.joints[1].name: 'lh_toe_joint' is also the name of legs.lh.joints[1]"),
    ('legs.lh.joints.1', DROP, "joint_order[1]: joint 'lh_toe_joint' is missing"),
    ('joint_order.1', 'tail', "joint_order[1]: joint 'tail' is missing from the legs"),
    ('joint_order.1', 'lh_tarsal_joint', "joint_order[1]: 'lh_tarsal_joint' appears twice"),
    ('joint_order.7', DROP, "joint_order: joint 'rf_pastern_joint' of legs.rf.joints[1] is"),
    ('joint_order.0', 4, 'joint_order[0]: must be a name, not 4'),
    ('joint_order', 'all', "joint_order: must be a list with at least one entry, not 'all'")])
def test_broken_trees(tmp_path, path, value, words):
    (file := tmp_path / 'goat.yaml').write_text(yaml.safe_dump(broken(path, value)))
    assert words in error_of(file)


@pytest.mark.parametrize(('changes', 'words'), [
    ({'effort': 3}, '.effort: unknown key'), ({'a\nb': 3}, 'unknown key'),
    ({'name': DROP}, '.name: is missing'), ({'name': 7}, '.name: must be a name, not 7'),
    ({'name': ' '}, '.name: must be a name'), ({'name': 'a\nb', 'cell': 3}, '.cell: '),
    ({'velocity': DROP}, '.velocity: is missing'), ({'velocity': 0}, '.velocity: 0 must be pos'),
    ({'upper': -1.0}, '.lower: -1 is not below upper -1'),
    ({'offset': 1.2}, '.offset: 1.2 is outside the limits -1 to 1'),
    ({'offset': float('nan')}, '.offset: must be finite'),
    ({'upper': float('inf')}, '.upper: must be finite'), ({'upper': 10**310}, '.upper:'),
    ({'offset': '0.0'}, ".offset: must be a number, not '0.0'"),
    ({'amplitude': True}, '.amplitude: must be a number, not True'),
    ({'amplitude': DROP}, "needs exactly one of 'amplitude' and 'weights'"),
    ({'weights': [0.1]}, "needs exactly one of 'amplitude' and 'weights'"),
    ({'amplitude': DROP, 'weights': [1, 0, 0]}, '.weights: takes 1, 2, 4 or 6 numbers (x, y, x^2'),
    ({'amplitude': DROP, 'weights': [0, '1']}, ".weights[1]: must be a number, not '1'"),
    ({'cell': 2}, ".cell: leg 'lh' has the cells 1 and 7, not 2"), ({'cell': 1.0}, 'not 1.0'),
    ({'cell': True}, 'and 7, not True'), ({'cell': [1]}, '.cell: ')],
    ids=lambda value: repr(value)[:40])
def test_broken_joints(tmp_path, changes, words):
    joint = {**GOAT['legs']['lh']['joints'][0], **changes}
    joint = {key: value for key, value in joint.items() if value is not DROP}
    (file := tmp_path / 'goat.yaml').write_text(yaml.safe_dump(broken('legs.lh.joints.0', joint)))
    place, reason = error_of(file).split('joints[0]')
    assert place.endswith('legs.lh.') and words in reason


@pytest.mark.parametrize(('content', 'words'), [
    (b'', 'must be a mapping, not nothing'), (b'- 1', 'file: must be a mapping, not [1]'),
    (b'network: delayed\nnetwork: delayed\n', "line 2: the key 'network' appears twice"),
    (b'legs: [1, 2\n', 'line 2'), (b'a: b: c', 'line 1'), (b'\tnetwork: x', 'line 1'),
    (b'? [1, 2]\n: 3\n', 'key'), (b'--- {}\n--- {}\n', 'line 2'), (b'!!python/none x', 'line 1'),
    (b'\x89PNG\r\n\x1a\n\x00\x00', 'file'), (b'\x00\x01\x02', 'file'), (b'\xff\xfe\x00', 'file')])
def test_files_that_are_not_robots(tmp_path, content, words):
    (file := tmp_path / 'goat.yaml').write_bytes(content)
    assert words in error_of(file).removeprefix(f'robot file {file}: ')


def test_files_that_cannot_be_read(tmp_path):
    assert 'No such file' in error_of(tmp_path / 'none.yaml')
    assert 'directory' in error_of(tmp_path)


PLACES = [f'legs.lh.joints.0.{key}' for key in GOAT['legs']['lh']['joints'][0]] + [
    'network', 'joint_order', 'joint_order.3', 'legs', 'legs.lh', 'legs.lh.joints']


@examples(60,
          suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.sampled_from(PLACES), st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(max_size=3), inner)))
def test_whatever_stands_there_it_loads_or_says_why_not(tmp_path, path, value):
    (file := tmp_path / 'goat.yaml').write_text(yaml.safe_dump(broken(path, value)))
    try:
        robot = read_robot(file)
    except RobotError as error:
        assert str(file) in str(error) and len(str(error).splitlines()) == 1
    else:
        assert robot.cells.dtype.kind == 'i' and np.isfinite(robot.weights()).all()


@pytest.mark.parametrize('file', sorted(CONFIG.glob('*.yaml')), ids=lambda path: path.stem)
def test_what_is_written_is_what_is_read(tmp_path, file):
    robot = read_robot(file)
    write_robot(tmp_path / file.name, robot, 'two lines\nof comment')
    assert read_robot(tmp_path / file.name) == robot
    assert [path.name for path in tmp_path.iterdir()] == [file.name]
    with pytest.raises(OSError, match='nowhere'):
        write_robot(tmp_path / 'nowhere' / 'robot.yaml', robot)

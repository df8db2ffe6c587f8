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

"""The part ``biped`` of a robot file: it is read back as written, and errors name their place."""

import copy
from pathlib import Path

from cpg_ros.common.errors import InputError
from cpg_ros.feedback.biped.feedback import gait_plan
from cpg_ros.feedback.biped.gains import BipedGains
from cpg_ros.motion.robot_file import load_robot, read_robot, RobotError, write_robot
import pytest
import yaml

HUMANOID = Path(__file__).resolve().parents[2] / 'config' / 'humanoid.yaml'
TREE = yaml.safe_load(HUMANOID.read_text())
KNEE = 'biped.links.left_knee_joint'


def changed(place, value):
    """Return the tree of the file with one value replaced, or dropped if it is None."""
    tree = copy.deepcopy(TREE)
    *parents, last = place.split('.')
    node = tree
    for key in parents:
        node = node[key]
    if value is None:
        del node[last]
    else:
        node[last] = value
    return tree


def test_what_is_written_is_read_back(tmp_path):
    robot = load_robot('humanoid')
    write_robot(tmp_path / 'humanoid.yaml', robot)
    assert read_robot(tmp_path / 'humanoid.yaml').biped == robot.biped
    assert set(robot.held) == {'waist_joint', 'left_shoulder_joint', 'right_shoulder_joint'}
    # Six joints a leg; the robot weighs what the model's header says.
    assert [len(leg) for leg in robot.legs.values()] == [6, 6]
    mass = robot.biped.mass + sum(link.mass for link in robot.biped.links.values())
    assert mass == pytest.approx(32.6)


def test_a_gait_has_gains_of_its_own(tmp_path):
    path = tmp_path / 'robot.yaml'
    path.write_text(yaml.safe_dump(changed(
        'biped.gains', {'lift': 0.09, 'duty': 0.55, 'run': {'duty': 0.4, 'frequency': 2.4}}),
        sort_keys=False))
    robot = read_robot(path)
    write_robot(tmp_path / 'again.yaml', robot)
    assert read_robot(tmp_path / 'again.yaml').biped == robot.biped
    walk, run, hop = (BipedGains.of_body(robot.biped, gait)
                      for gait in ('walk', 'run', 'two_legged_hop'))
    assert (walk.lift, walk.duty, run.duty, run.frequency) == (0.09, 0.55, 0.4, 2.4)
    # A lift stands among the gains that runs and hops have by themselves.
    usual = load_robot('humanoid').biped
    assert hop == BipedGains.of_body(usual, 'two_legged_hop')
    assert gait_plan(robot, 'run').frequency == 2.4
    path.write_text(yaml.safe_dump(changed('biped.gains', {'run': {'dutty': 0.4}}),
                                   sort_keys=False))
    with pytest.raises(InputError, match=r"biped\.gains\.run: 'dutty' is not one of"):
        BipedGains.of_body(read_robot(path).biped)


@pytest.mark.parametrize(('place', 'value', 'message'), [
    (f'{KNEE}.mass', -1.0, f'{KNEE}.mass: -1 must be at least 0'),
    (f'{KNEE}.kp', 0.0, f'{KNEE}.kp: 0 must be positive'),
    (f'{KNEE}.effort', None, f'{KNEE}.effort: is missing'),
    (f'{KNEE}.axis', [0.0, 2.0, 0.0], f'{KNEE}.axis: has the length 2, not 1'),
    (f'{KNEE}.angle', 0.5, f'{KNEE}.angle: unknown key'),
    (f'{KNEE}.parent', 'left_ankle_roll_joint', "'left_ankle_roll_joint' is neither base nor a "
     'link before'),
    ('biped.links.waist_joint.angle', None, 'biped.links.waist_joint.angle: is missing'),
    ('biped.links.left_shoulder_joint.cell', 5, 'cell: 5 is not the number of a cell, 1 to 4'),
    ('biped.links.left_shoulder_joint.cell', None, 'left_shoulder_joint: a swing needs a cell'),
    (f'{KNEE}.cell', 1, f'{KNEE}.cell: unknown key'),
    (KNEE, None, f'{KNEE}: is missing'),
    ('biped.soles.left', None, 'biped.soles.left: is missing'),
    ('biped.sole_size', [0.2], 'biped.sole_size: takes 2 numbers, not 1'),
    ('biped.base.mass', 0.0, 'biped.base.mass: 0 must be positive'),
    ('biped.gains', {'lift': 'high'}, "biped.gains.lift: must be a number, not 'high'"),
    ('biped.gains', {'run': {'lift': 'high'}}, "biped.gains.run.lift: must be a number, not "
     "'high'"),
    ('biped.gains', {'run': [0.1]}, 'biped.gains.run: must be a mapping'),
    ('biped.gains', 0.1, 'biped.gains: must be a mapping'),
    ('biped.links', [1], 'biped.links: must be a mapping')])
def test_what_is_wrong_is_named(tmp_path, place, value, message):
    path = tmp_path / 'robot.yaml'
    path.write_text(yaml.safe_dump(changed(place, value), sort_keys=False))
    with pytest.raises(RobotError) as caught:
        read_robot(path)
    assert message in str(caught.value) and str(path) in str(caught.value)
    assert len(str(caught.value).splitlines()) == 1

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

"""The part feedback of robot files."""

from dataclasses import replace

from cpg_ros.motion.body_file import OwnFeedback
from cpg_ros.motion.robot_file import load_robot, read_robot, RobotError, write_robot
import pytest
import yaml

GO2 = load_robot('unitree_go2')


@pytest.mark.parametrize('own', [
    None, OwnFeedback(), OwnFeedback(False, 'by hand', {'reflexes': False}, {'step': 0.5},
                                      (0.0, 0.0, 1.5708))])
def test_what_is_written_is_read_back(tmp_path, own):
    write_robot(tmp_path / 'my.yaml', replace(GO2, feedback=own))
    assert read_robot(tmp_path / 'my.yaml').feedback == own


@pytest.mark.parametrize('tree, words', [
    ({'enabled': 'no'}, "feedback.enabled: must be true or false, not 'no'"),
    ({'laws': {'reflexes': 1}}, 'feedback.laws.reflexes: must be true or false, not 1'),
    ({'gains': {'step': 'long'}}, 'feedback.gains.step'),
    ({'gains': [1.0]}, 'feedback.gains'), ({'made': 1}, 'feedback.made'),
    ({'imu_mount': [1.57]}, 'feedback.imu_mount: must be a list of roll, pitch and yaw'),
    ({'on': True}, 'feedback.on: unknown key')])
def test_what_is_wrong_is_said_with_its_place(tmp_path, tree, words):
    write_robot(tmp_path / 'my.yaml', GO2)
    whole = yaml.safe_load((tmp_path / 'my.yaml').read_text())
    (tmp_path / 'my.yaml').write_text(yaml.safe_dump({**whole, 'feedback': tree}))
    with pytest.raises(RobotError, match=words):
        read_robot(tmp_path / 'my.yaml')

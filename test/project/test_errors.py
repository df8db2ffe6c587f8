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

"""What is a user's mistake is reported as one, and nothing else is."""

import inspect

from cpg_ros.analysis import analyze
from cpg_ros.common.errors import CpgError
from cpg_ros.fitting.inversion import inversion
from cpg_ros.motion import plan as planning
from cpg_ros.motion.robot_file import load_robot
from cpg_ros.networks.registry import PRESETS
from modules import modules
import pytest


def test_every_error_of_the_package_is_of_the_family():
    found = {one for module in modules() for _, one in inspect.getmembers(module, inspect.isclass)
             if issubclass(one, BaseException) and one.__module__.startswith('cpg_ros')}
    assert len(found) > 10
    assert all(issubclass(one, CpgError) for one in found)
    # 1 is a negative result, 2 unusable input.
    assert {one.exit_code for one in found} == {1, 2}


def broken(*_, **__):
    raise ValueError('shapes (3,) and (4,) not aligned')


def test_a_mistake_in_a_solver_is_not_a_refusal(monkeypatch):
    monkeypatch.setattr(planning, 'gait_of', broken)
    preset = PRESETS['delayed']['trot']
    with pytest.raises(ValueError, match='not aligned') as error:
        planning.plan(load_robot('quadruped'), 'trot', preset, preset.network)
    assert not isinstance(error.value, CpgError)


def test_a_mistake_in_the_program_is_not_one_in_the_arguments(monkeypatch, tmp_path):
    monkeypatch.setattr(analyze, 'verdicts', broken)
    with pytest.raises(ValueError, match='not aligned'):
        analyze.main(['--network', 'delayed'])
    monkeypatch.setattr(inversion, 'read_recording', broken)
    with pytest.raises(ValueError, match='not aligned'):
        inversion.main(['--csv', str(tmp_path / 'walk.csv')])

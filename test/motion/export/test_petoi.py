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

"""Skill arrays of OpenCat, decoded as its firmware reads them."""

import re

from c_export import plans
from cpg_ros.motion.export import export
from cpg_ros.motion.pattern import Pattern
import numpy as np
import pytest

LEGS = ('lf', 'rf', 'rh', 'lh')


def decoded(text, name, joints):
    """Return the frames in degrees, (frames, joints), by the header of the array."""
    body = re.search(rf'const int8_t {name}\[\] PROGMEM = {{(.*?)}};', text, re.DOTALL)[1]
    data = [int(word) for word in re.findall(r'-?\d+', body)]
    assert all(-128 <= number <= 127 for number in data) and len(data) <= 450
    period, roll, pitch, ratio = data[:4]
    assert period > 1 and (roll, pitch) == (0, 0) and ratio in (1, 2)
    assert len(data) == 4 + period * joints
    return np.array(data[4:]).reshape(period, joints) * ratio, ratio


def walked(plan):
    """Return the phase of the first leg and the joints in degrees over some strides."""
    pattern = Pattern(plan, 0.1)
    phases, positions = [], []
    for tick in range(4000):
        pattern.advance(0.001)
        if tick >= 1500:
            phases.append(pattern.phases[0])
            positions.append(np.degrees(pattern.position))
    return np.array(phases), np.array(positions)


@pytest.mark.parametrize('robot, gaits, frames', [
    ('goat', ('trot', 'walk'), 55), ('quadruped', ('trot', 'walk'), 37)])
def test_frames_are_what_the_generator_does_over_a_stride(tmp_path, robot, gaits, frames):
    assert export.main(['--robot', robot, '--network', 'delayed', '--gaits', *gaits, '--target',
                        'petoi', '--out', str(tmp_path)]) == 0
    text = (tmp_path / 'petoi_skills.h').read_text()
    for plan in plans(robot, 'delayed', gaits):
        names = [joint.name for joint in plan.robot.joints]
        order = [plan.robot.legs[leg][number].name
                 for number in range(len(plan.robot.legs['lf'])) for leg in LEGS]
        rows, ratio = decoded(text, plan.name, len(order))
        assert len(rows) == frames
        phases, positions = walked(plan)
        for column, name in enumerate(order):
            wanted = np.interp(np.arange(frames) / frames, *_sorted(
                phases, positions[:, names.index(name)]), period=1.0)
            assert np.abs(rows[:, column] - wanted).max() < 0.5 * ratio + 0.1, (plan.name, name)
        assert np.ptp(rows, axis=0).max() > 20


def _sorted(phases, values):
    order = np.argsort(phases)
    return phases[order], values[order]


@pytest.mark.parametrize('words, message', [
    (['--robot', 'hexapod'], 'skill arrays are for four legs'),
    (['--robot', 'goat', '--rate', '50'], 'argument --rate: not for --target petoi'),
    (['--robot', 'goat', '--form', 'table'], 'argument --form: not for --target petoi')])
def test_what_is_no_skill_is_refused_in_one_line(tmp_path, capsys, words, message):
    assert export.main([*words, '--target', 'petoi', '--out', str(tmp_path / 'skill')]) == 2
    printed = capsys.readouterr().err
    assert message in printed and printed.count('\n') == 1
    assert not (tmp_path / 'skill').exists()

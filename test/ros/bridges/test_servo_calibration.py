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

"""Calibration files of servos."""

from cpg_ros.ros.bridges.servos.calibration import CalibrationError, load_calibration
import numpy as np
import pytest

GOOD = """
board: pca9685
device: /dev/i2c-1
servos:
  left_knee:
    {channel: 2, centre: 1500, direction: 1, per_rad: 600, lower: 600, upper: 2400, rest: 1}
  right_knee:
    {channel: 5, centre: 1450, direction: -1, per_rad: 600, lower: 600, upper: 2400, rest: 1}
"""


def load(tmp_path, text):
    path = tmp_path / 'servos.yaml'
    path.write_text(text)
    return load_calibration(path)


def test_angles_become_units_within_the_limits_and_back(tmp_path):
    found = load(tmp_path, GOOD)
    assert found.joints == ('left_knee', 'right_knee') and found.channels == (2, 5)
    assert found.options == {'address': 0x40, 'frequency': 50.0}
    assert found.units(np.array([0.5, 0.5])).tolist() == [1800, 1150]
    assert np.allclose(found.angles(np.array([1800, 1150])), [0.5, 0.5])
    assert found.units(np.array([9.0, 9.0])).tolist() == [2400, 600]
    assert found.units(np.array([0.0004, -0.0009])).tolist() == [1500, 1451]


@pytest.mark.parametrize(('before', 'after', 'words'), [
    ('pca9685', 'pca9865', "board: 'pca9865' is not one of pca9685, dynamixel, feetech_sts, "),
    ('device: /dev/i2c-1\n', '', 'file.device: is missing'),
    ('channel: 2', 'channel: 16', 'servos.left_knee.channel: 16 is not one of 0 to 15'),
    ('channel: 5', 'channel: 2', 'servos: channel 2 moves two joints'),
    ('direction: -1', 'direction: 2', 'right_knee.direction: 2 is neither 1 nor -1'),
    ('per_rad: 600', 'per_rad: -600', 'left_knee.per_rad: -600 must be positive; direction has'),
    ('upper: 2400', 'upper: 20001', 'left_knee.lower: 600 to upper 20001 is not a range within 0'),
    ('centre: 1450', 'centre: 500', 'right_knee.centre: is at 500, outside 600 to 2400'),
    ('rest: 1', 'rest: 2', 'left_knee.rest: is at 2700, outside 600 to 2400'),
    ('board', 'frequency: 500\nboard', 'frequency: 500 is not from 40 to 400'),
    ('board', 'baud: 9600\nboard', 'file.baud: unknown key'),
    ('servos:', 'servos: {}\nothers:', 'file.others: unknown key')])
def test_what_cannot_be_used_is_named(tmp_path, before, after, words):
    text = GOOD.replace(before, after, 1)
    with pytest.raises(CalibrationError) as raised:
        load(tmp_path, text)
    assert words in str(raised.value) and '\n' not in str(raised.value)


def test_a_pulse_is_no_longer_than_its_period(tmp_path):
    with pytest.raises(CalibrationError, match='upper 2600 is not a range within 0 to 2500'):
        load(tmp_path, GOOD.replace('board', 'frequency: 400\nboard', 1).replace('2400', '2600'))

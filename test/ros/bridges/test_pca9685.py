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

"""Registers of a PCA9685, by the numbers of NXP's data sheet."""

from cpg_ros.common.errors import CpgError
from cpg_ros.ros.bridges.servos.bus import open_board
from cpg_ros.ros.bridges.servos.calibration import load_calibration
from cpg_ros.ros.bridges.servos.pca9685 import Pca9685, prescale
import numpy as np
import pytest

MODE1, PRE_SCALE, SLEEP = 0x00, 0xFE, 0x10


class Chip:
    """A PCA9685 as section 7.3 has it: auto-increment, and a prescaler that needs sleep."""

    def __init__(self):
        self.registers = {MODE1: 0x11, PRE_SCALE: 0x1E}
        self.closed = False

    def write(self, data):
        register, *values = data
        assert len(values) == 1 or self.registers[MODE1] & 0x20, 'no auto-increment'
        for k, value in enumerate(values):
            assert register != PRE_SCALE or self.registers[MODE1] & SLEEP, 'blocked'
            # ALL_LED_OFF_H loads the OFF_H register of every channel: table 7.
            places = range(0x09, 0x46, 4) if register == 0xFD else (register + k,)
            self.registers.update(dict.fromkeys(places, value))

    def close(self):
        self.closed = True

    def pulse(self, channel):
        """Length in microseconds, 0 with full OFF: tables 3, 7, and section 7.3.3."""
        on_low, on_high, low, high = (self.registers.get(6 + 4 * channel + k, 0) for k in range(4))
        assert not self.registers[MODE1] & SLEEP and (on_low, on_high) == (0, 0)
        if high & 0x10:
            return 0.0
        return (low + 256 * high) / 4096 * self.period

    @property
    def period(self):
        return 1e6 * 4096 * (self.registers[PRE_SCALE] + 1) / 25e6


def test_the_prescaler_is_that_of_the_data_sheet():
    # Equation 2: 200 Hz. The highest frequency, 1526 Hz, is 03h: section 7.3.5.
    assert prescale(200.0) == 0x1E and prescale(1526.0) == 0x03


def test_registers_of_a_channel_are_written_in_one_message():
    chip = Chip()
    board = Pca9685(chip, (4,), 50.0)
    sent = []
    chip.write = sent.append
    board.write(np.array([1500]))
    # LED4_ON_L is 16h, LED4_OFF_L 18h (table 4); a count of 122 / 25 MHz: 1500 us are 307 = 133h.
    assert sent == [bytes((0x16, 0x00, 0x00, 0x33, 0x01))]


@pytest.mark.parametrize('frequency', [40.0, 50.0, 333.0, 400.0])
def test_pulses_have_their_length_whatever_the_prescaler_was_rounded_to(frequency):
    chip = Chip()
    board = Pca9685(chip, (0, 3, 15), frequency)
    assert [chip.pulse(channel) for channel in (0, 3, 15)] == [0.0, 0.0, 0.0]
    board.write(np.array([600, 1500, 2400]))
    count = chip.period / 4096
    for channel, wanted in ((0, 600), (3, 1500), (15, 2400)):
        assert chip.pulse(channel) == pytest.approx(wanted, abs=0.51 * count)
    assert chip.period == pytest.approx(1e6 / frequency, rel=0.03)
    board.detach()
    assert [chip.pulse(channel) for channel in range(16)] == [0.0] * 16
    assert board.read() is None
    board.write(np.array([600, 1500, 2400]))
    assert chip.pulse(3) > 0.0
    board.close()
    assert chip.closed


def test_a_device_that_is_not_there_is_an_error_of_the_system(tmp_path):
    path = tmp_path / 'servos.yaml'
    row = 'channel: 0, centre: 1500, direction: 1, per_rad: 600, lower: 600, upper: 2400, rest: 0'
    path.write_text(f'board: pca9685\ndevice: {tmp_path}/i2c-9\nservos:\n  knee: {{{row}}}\n')
    with pytest.raises(CpgError, match='i2c-9: No such file or directory'):
        open_board(load_calibration(path))

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

"""Servos on a serial port: a chain on a pseudo terminal."""

import os

from cpg_ros.ros.bridges.servos.bus import open_board
from cpg_ros.ros.bridges.servos.calibration import load_calibration
from cpg_ros.ros.bridges.servos.serial_board import SerialPort, ServoError
import numpy as np
import pytest
from servo_chain import ServoChain


@pytest.fixture
def chain():
    chain = ServoChain({1: 2048, 4: 1000})
    yield chain
    chain.end()


@pytest.fixture
def board(chain, tmp_path):
    path = tmp_path / 'servos.yaml'
    row = 'centre: 2048, direction: 1, per_rad: 651.9, lower: 0, upper: 4095, rest: 0'
    path.write_text(f'board: feetech_sts\ndevice: {chain.path}\nservos:\n'
                    f'  knee: {{channel: 4, {row}}}\n  ankle: {{channel: 1, {row}}}\n')
    board = open_board(load_calibration(path))
    yield board
    board.close()


def test_goals_come_before_the_torque_and_positions_in_the_order_of_the_file(chain, board):
    assert board.read().tolist() == [1000, 2048] and not any(chain.torque.values())
    board.write(np.array([1100, 2000]))
    assert board.read().tolist() == [1100, 2000]
    assert chain.torque == {1: True, 4: True} and chain.packets == 4
    board.write(np.array([1200, 2000]))
    board.detach()
    # The answer to a question shows that all before it has been taken.
    assert board.read().tolist() == [1200, 2000]
    assert not any(chain.torque.values()) and chain.packets == 7


def test_a_servo_that_does_not_answer_or_reports_an_error(chain, board):
    chain.answering = False
    assert board.read() is None
    chain.answering, chain.error = True, 0x20
    with pytest.raises(ServoError, match='servo 4 reports the error 0x20'):
        board.read()


def test_ports_that_cannot_be_used(tmp_path):
    with pytest.raises(ServoError, match='baud 12345 is not one of 9600, 19200, '):
        SerialPort('/dev/null', 12345)
    with pytest.raises(OSError, match='ioctl'):
        SerialPort(os.devnull, 115200)

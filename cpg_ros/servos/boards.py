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

"""The board that a calibration file describes."""

from cpg_ros.servos.calibration import Calibration
from cpg_ros.servos.dynamixel import Dynamixel
from cpg_ros.servos.feetech import Feetech
from cpg_ros.servos.pca9685 import LinuxI2c, Pca9685
from cpg_ros.servos.serial_board import SerialBoard
from cpg_ros.servos.serial_port import SerialPort
from cpg_ros.servos.servo_board import ServoBoard, ServoError


def open_board(calibration: Calibration) -> ServoBoard:
    """Open the bus, and return its servos, which are not driven yet.

    Raises:
        ServoError: the bus cannot be opened.

    """
    options, device = calibration.options, calibration.device
    try:
        if calibration.board == 'pca9685':
            return Pca9685(LinuxI2c(device, int(options['address'])), calibration.channels,
                           options['frequency'])
        protocol = (Dynamixel() if calibration.board == 'dynamixel' else
                    Feetech(encoder=calibration.board == 'feetech_sts'))
        return SerialBoard(SerialPort(device, int(options['baud'])), protocol,
                           calibration.channels)
    except OSError as error:
        raise ServoError(f'{device}: {error.strerror or error}') from error

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

"""Hobby servos on a PCA9685, which makes the pulses: its registers, over Linux's I2C.

Registers, prescaler and the order of switching on are those of NXP's PCA9685 product data sheet,
revision 4 (16 April 2015), sections 7.3 to 7.3.5.
"""

import fcntl
import os
import time

from cpg_ros.ros.bridges.servos.serial_board import ServoBoard
import numpy as np

#: Registers, table 4. MODE1: mode; LED0: first of four registers of channel 0, four more for each
#: further channel; ALL_OFF_H: switches all channels off; PRE_SCALE: divider of the clock.
MODE1, LED0, ALL_OFF_H, PRE_SCALE = 0x00, 0x06, 0xFD, 0xFE
#: Bits of MODE1, table 5. AUTO_INCREMENT: of the register address; SLEEP: oscillator off.
AUTO_INCREMENT, SLEEP = 0x20, 0x10
#: FULL_OFF: bit 4 of an OFF_H register, table 7: no pulses.
FULL_OFF = 0x10
#: CLOCK_FREQUENCY: frequency of the internal clock, Hz; NUM_COUNTS: counts of a pulse's period.
CLOCK_FREQUENCY, NUM_COUNTS = 25e6, 4096
#: STARTUP_TIME: time until the oscillator runs once it is on, s (500 us in section 7.3.1.1).
STARTUP_TIME = 0.001
#: Request of ioctl that sets the address of a device, linux/i2c-dev.h.
I2C_SLAVE = 0x0703


class LinuxI2c:
    """A device on an I2C bus of Linux, by its character device."""

    def __init__(self, path: str, address: int) -> None:
        """Open a bus such as ``/dev/i2c-1``; raise an OSError if that fails."""
        self._file = os.open(path, os.O_RDWR)
        try:
            fcntl.ioctl(self._file, I2C_SLAVE, address)
        except OSError:
            os.close(self._file)
            raise

    def write(self, data: bytes) -> None:
        """Write one message; the kernel raises an OSError if the device does not acknowledge."""
        os.write(self._file, data)

    def close(self) -> None:
        """Close the character device."""
        os.close(self._file)


def prescale(frequency: float) -> int:
    """Return PRE_SCALE for a frequency of pulses, Hz: equation 1 of section 7.3.5."""
    return round(CLOCK_FREQUENCY / (NUM_COUNTS * frequency)) - 1


class Pca9685(ServoBoard):
    """Up to 16 servos driven by pulses, in microseconds; their positions cannot be measured."""

    def __init__(self, bus: LinuxI2c, channels: tuple[int, ...], frequency: float) -> None:
        """Switch all pulses off, and set their frequency, Hz; channels are 0 to 15."""
        self._bus, self._channels = bus, channels
        scale = prescale(frequency)
        # Duration of a count, us, by the rounded PRE_SCALE, not by the wanted frequency.
        self._count = 1e6 * (scale + 1) / CLOCK_FREQUENCY
        self.detach()
        # PRE_SCALE can be written while the oscillator is off only.
        for register, value in ((MODE1, AUTO_INCREMENT | SLEEP), (PRE_SCALE, scale),
                                (MODE1, AUTO_INCREMENT)):
            bus.write(bytes((register, value)))
        time.sleep(STARTUP_TIME)

    def write(self, units: np.ndarray) -> None:
        """Make pulses of these lengths, us; each begins with its period (ON is 0)."""
        for channel, length in zip(self._channels, units, strict=True):
            off = round(length / self._count)
            self._bus.write(bytes((LED0 + 4 * channel, 0, 0, off & 0xFF, off >> 8)))

    def read(self) -> np.ndarray | None:
        """Return None: pulses go one way."""
        return None

    def detach(self) -> None:
        """Switch all pulses off at once."""
        self._bus.write(bytes((ALL_OFF_H, FULL_OFF)))

    def close(self) -> None:
        """Close the bus."""
        self._bus.close()

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

"""A generator one of whose threads disturbs it every two seconds: KIND, then arguments of ROS.

Kinds: idle; log (10,000 lines); garbage (a million objects are collected); lock (a call that holds
the interpreter's lock for a second); compile (numba compiles a function).
"""

import ctypes
import gc
import logging
import sys
import threading
import time

from cpg_ros.ros import generator
from numba import njit
from rclpy.logging import get_logger

#: From the start to the first disturbance, and between two, s.
BEGIN, PAUSE = 11.0, 2.0


def log() -> None:
    for k in range(10_000):
        get_logger('disturbed').info(f'line {k}')


def garbage() -> None:
    circles: list = [[] for _ in range(1_000_000)]
    for one in circles:
        one.append(one)
    del circles
    gc.collect()


def lock() -> None:
    # Functions of PyDLL keep the lock.
    ctypes.PyDLL(None).sleep(1)


def compile_one() -> None:
    logging.getLogger('numba').setLevel(logging.WARNING)

    def sums(values):
        total = 0.0
        for value in values:
            total += value**3 / (1.0 + value * value)
        return total
    njit(sums).compile('float64(float64[::1])')


KINDS = {'idle': lambda: None, 'log': log, 'garbage': garbage, 'lock': lock,
         'compile': compile_one}


def disturb(kind: str) -> None:
    time.sleep(BEGIN)
    while True:
        KINDS[kind]()
        time.sleep(PAUSE)


if __name__ == '__main__':
    threading.Thread(target=disturb, args=sys.argv[1:2], daemon=True).start()
    sys.exit(generator.main(sys.argv[2:]))

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

"""Our check sum and Unitree's library: run by Python 3.10 with cyclonedds 0.10.

usage: python unitree_sdk_crc.py FOLDER COUNT    Prints JSON: how many commands, how many differ,
and the median time in which a command is sealed with its sum, us.
"""

import ctypes
import json
from pathlib import Path
import statistics
import struct
import sys
import time

folder, count = Path(sys.argv[1]), int(sys.argv[2])
sys.path.insert(0, str(folder / 'unitree_sdk2_python'))
sys.path.append(str(Path(__file__).resolve().parents[2]))

from cpg_ros.ros.bridges.unitree.messages import LowCmd  # noqa: E402
import numpy as np  # noqa: E402
from unitree_sdk2py.idl.unitree_go.msg.dds_ import LowCmd_  # noqa: E402
from unitree_sdk2py.utils.crc import CRC  # noqa: E402

theirs, ours = CRC(), LowCmd()
rng, wrong, whole = np.random.default_rng(1), 0, 0
core, times = theirs.crc_lib.crc32_core, []
for k in range(count):
    for part in (ours.q, ours.dq, ours.tau, ours.kp, ours.kd):
        part[:] = rng.normal(0.0, 30.0, 12)
    began = time.perf_counter()
    sealed = ours.encode()
    times.append(1e6 * (time.perf_counter() - began))
    if k % 50 == 0:
        # Their own reader of the message, their own packing of the struct.
        message = LowCmd_.deserialize(sealed)
        wrong += theirs.Crc(message) != message.crc
        whole += 1
    body = sealed[4:]
    words = body[:22] + b'\0\0' + body[22:24] + b'\0\0' + body[24:804]
    wrong += core((ctypes.c_uint32 * 202).from_buffer_copy(words), 202) != struct.unpack(
        '<I', body[804:])[0]
print(json.dumps({'commands': count, 'read by their own reader': whole, 'wrong': wrong,
                  'us': round(statistics.median(times), 1)}))

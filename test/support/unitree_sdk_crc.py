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

usage: python unitree_sdk_crc.py FOLDER COUNT    Prints JSON: how many commands of go2, g1 and h1_2
each, how many differ, and the median time in which a command is sealed with its sum, us.
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

from cpg_ros.ros.bridges.unitree.messages import LAYOUTS, LowCmd, MODELS  # noqa: E402
import numpy as np  # noqa: E402
from unitree_sdk2py.idl.unitree_go.msg.dds_ import LowCmd_  # noqa: E402
from unitree_sdk2py.idl.unitree_hg.msg.dds_ import LowCmd_ as HGLowCmd_  # noqa: E402
from unitree_sdk2py.utils.crc import CRC  # noqa: E402

theirs = CRC()
core, times = theirs.crc_lib.crc32_core, []
rng, wrong, whole = np.random.default_rng(1), 0, 0
for model, kind in (('go2', LowCmd_), ('g1', HGLowCmd_), ('h1_2', HGLowCmd_)):
    ours = LowCmd(MODELS[model])
    first = LAYOUTS[MODELS[model].package].first
    for k in range(count):
        for part in (ours.q, ours.dq, ours.tau, ours.kp, ours.kd):
            part[:] = rng.normal(0.0, 30.0, len(part))
        ours.echo[:] = k % 256
        began = time.perf_counter()
        sealed = ours.encode()
        times.append(1e6 * (time.perf_counter() - began))
        if k % 50 == 0:
            # Their own reader of the message, their own packing of the struct.
            message = kind.deserialize(sealed)
            wrong += theirs.Crc(message) != message.crc
            whole += 1
        body = sealed[4:]
        words = body[:first] + b'\0\0' + body[first:first + 2] + b'\0\0' + body[first + 2:-4]
        n = len(words) // 4
        wrong += core((ctypes.c_uint32 * n).from_buffer_copy(words), n) != struct.unpack(
            '<I', body[-4:])[0]
print(json.dumps({'commands of each model': count, 'read by their own reader': whole,
                  'wrong': wrong, 'us': round(statistics.median(times), 1)}))

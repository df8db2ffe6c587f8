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

"""Unitree's library reads commands and sums them: run by Python 3.10 with cyclonedds 0.10.

usage: python unitree_sdk_crc.py FOLDER go|hg    Reads commands as they are sent, one after
another, from standard input; prints JSON: how many there are, and how many have another sum.
"""

import json
from pathlib import Path
import sys

folder, kind = Path(sys.argv[1]), sys.argv[2]
sys.path.insert(0, str(folder / 'unitree_sdk2_python'))

from unitree_sdk2py.idl.unitree_go.msg.dds_ import LowCmd_ as Go  # noqa: E402
from unitree_sdk2py.idl.unitree_hg.msg.dds_ import LowCmd_ as Hg  # noqa: E402
from unitree_sdk2py.utils.crc import CRC  # noqa: E402

type_, size = {'go': (Go, 812), 'hg': (Hg, 1004)}[kind]
sealed, crc, wrong = sys.stdin.buffer.read(), CRC(), 0
for first in range(0, len(sealed), size):
    # Their own reader of the message, their own packing of the struct.
    message = type_.deserialize(sealed[first:first + size])
    wrong += crc.Crc(message) != message.crc
print(json.dumps({'commands': len(sealed) // size, 'wrong': wrong}))

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

"""The check sum of Unitree's low-level commands: CRC-32/MPEG-2 of the words of a C struct.

Unitree's own code (``crc32_core``) runs over 32-bit words from their highest bit, polynomial
0x04c11db7, start 0xffffffff, nothing reflected. zlib computes the same polynomial reflected, so
the bytes of every word are turned round, their bits too, and the result back.
"""

import zlib

#: Every byte with its bits the other way round.
_MIRRORED = bytes(int(f'{byte:08b}'[::-1], 2) for byte in range(256))


def crc32(words: bytes) -> int:
    """Return the check sum of little-endian 32-bit words.

    Args:
        words: their bytes, a whole number of words.

    """
    turned = bytearray(len(words))
    for k in range(4):
        turned[k::4] = words[3 - k::4]
    reflected = zlib.crc32(turned.translate(_MIRRORED)) ^ 0xffffffff
    return int.from_bytes(reflected.to_bytes(4, 'little').translate(_MIRRORED), 'big')

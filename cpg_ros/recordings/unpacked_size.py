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

"""How large what is unpacked may become: a small file may hold zeros without end."""

from cpg_ros.recordings.recording import RecordingError

#: What a file may always unpack to, bytes; a larger one to so many times its own size.
ALWAYS, RATIO = 20_000_000, 100


class UnpackedSize:
    """Counts the bytes that come out of one file, chunk or message."""

    def __init__(self, packed: int) -> None:
        self.most, self._size = max(ALWAYS, RATIO * packed), 0

    def add(self, count: int) -> None:
        """Count bytes.

        Raises:
            RecordingError: they have become too many.

        """
        self._size += count
        if self._size > self.most:
            raise RecordingError(
                f'more than {self.most / 1e6:.0f} MB unpacked, which recordings do not have; if '
                'this one does, unpack it and read that')

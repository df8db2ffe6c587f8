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

"""The joints of a file that names or patterns ask for."""

from collections.abc import Sequence
from fnmatch import fnmatchcase

from cpg_ros.recordings.recording import few, RecordingError


def matching(wanted: Sequence[str], names: Sequence[str], source: str) -> list[str]:
    """Return the names that are asked for, each once, in the order in which they are.

    Args:
        wanted: names, or patterns such as 'left*'; all names, if empty.
        names: that are there.
        source: what to call the file in messages.

    Raises:
        RecordingError: nothing fits one of them.

    """
    found: list[str] = []
    for pattern in wanted:
        fitting = [name for name in names if pattern == name or fnmatchcase(name, pattern)]
        if not fitting:
            raise RecordingError(f'{source}: no joint {pattern!r}; there are {few(names, 40)}')
        found += fitting
    return list(dict.fromkeys(found if wanted else names))

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

"""The declaration of a format of recordings; each format is one file that ends in one of these.

A reader takes the path and its options by name, makes chunks of samples, and joins them by
`merged`; whatever is wrong with a file it raises as a RecordingError.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from cpg_ros.recordings.recording import Recording


@dataclass(frozen=True)
class Option:
    """An option of readers, which the command line has, too.

    Attributes:
        name: of the reader's argument; on the command line after two dashes.
        help: in a phrase.
        metavar: its value in the help.
        choices: values it may have; any, if empty.
        several: whether it takes one or more values, none of them by default.

    """

    name: str
    help: str  # noqa: A003
    metavar: str | None = None
    choices: tuple[str, ...] = ()
    several: bool = False


#: Every format has joints, so that every reader takes this.
JOINTS = Option('joints', "joints to use (default: the robot's, or all); for files other than "
                "bags also patterns such as 'JointPos*'", 'NAME', several=True)
UNIT = Option('unit', 'unit of the angles (default: as the file says, or rad)',
              choices=('rad', 'deg'))


@dataclass(frozen=True)
class RecordingFormat:
    """A format of recordings.

    Attributes:
        name: by which it is chosen; on the command line after two dashes.
        contents: what such a recording is, with its article, for the head of the help.
        help: of the option that takes one.
        metavar: the option's value in the help.
        read: reads one: its path, then by name ``progress`` (show a bar) and the options below.
        endings: of the names of its files.
        options: that its reader takes.
        features: what else its reader takes: ``servo``, if it has velocities and efforts, and
            ``some``, to pass over joints that are not there.
        lacks: option or feature -> why it is refused, in a phrase.
        recognises: tells whether a file with one of its endings is of this format, where others
            have that ending, too.
        files_in: returns the files of a folder that is one recording, sorted, or none for any
            other folder; None if recordings of this format are files.

    """

    name: str
    contents: str
    help: str  # noqa: A003
    metavar: str
    read: Callable[..., Recording]
    endings: tuple[str, ...]
    options: tuple[Option, ...] = (JOINTS,)
    features: tuple[str, ...] = ()
    lacks: Mapping[str, str] = field(default_factory=dict)
    recognises: Callable[[Path], bool] | None = None
    files_in: Callable[[Path], list[Path]] | None = None

    def refusal(self, argument: str) -> str:
        """Return why its reader does not take an argument, or ''."""
        if argument in (*(option.name for option in self.options), *self.features):
            return ''
        return self.lacks.get(argument, f'{self.name} recordings have none')

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

"""Blocks of code in the pages: what can be run here, and what needs a ROS installation."""

from dataclasses import dataclass
from pathlib import Path
import re

ROOT = Path(__file__).resolve().parents[2]
#: Pages whose Python and console blocks are all run.
PAGES = ['README.md', *(str(path.relative_to(ROOT)) for folder in ('tutorials', 'how_to')
                        for path in sorted((ROOT / 'docs' / folder).glob('*.md')))]
#: The first line of a block that is not run.
MARK = '# needs a ROS 2 installation'
FENCE = re.compile(r'^```(\{code-block\} )?(\w*)\n(?::name: (\S+)\n\n)?(.*?)^```', re.M | re.S)


@dataclass(frozen=True)
class Block:
    """A block of a page: its language, the file that it is saved as if any, and its text."""

    language: str
    file: str
    text: str

    @property
    def commands(self) -> list[str]:
        """The commands that a console shows."""
        return [line.removeprefix('$ ') for line in self.text.splitlines()]


def blocks(page: str) -> list[Block]:
    """Return the blocks of a page, in order."""
    return [Block(language, file or '', text)
            for _, language, file, text in FENCE.findall((ROOT / page).read_text())]

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

"""A folder of results: a file for every recording that is done, from which the table is made.

Each is written under another name and renamed, so that the work always ends between two rows.
"""

from collections.abc import Iterator
import hashlib
import json
import os
from pathlib import Path
from typing import Any

from cpg_ros.errors import InputError
from cpg_ros.files.atomic_write import stored_json, write_atomically
from cpg_ros.files.plain_text import printable
from cpg_ros.fleet.recordings_found import RESULTS

#: Folders of the rows and of the fitted files.
ROWS, FITTED = 'rows', 'fitted'


def key(recording: Path) -> str:
    """Return the name of a recording's files here, from its path."""
    return hashlib.sha256(os.fsencode(recording.resolve())).hexdigest()[:16]


class Results:
    """Rows on disk, by recording.

    Attributes:
        folder: of all.
        settings: digest of how recordings are fitted: rows of others are done again.

    """

    def __init__(self, folder: Path, settings: str) -> None:
        """Make the folder, or resume in it.

        Raises:
            InputError: it holds something else.
            OSError: it cannot be made.

        """
        self.folder, self.settings = folder, settings
        mark = folder / RESULTS
        if folder.exists() and not mark.exists() and any(folder.iterdir()):
            raise InputError(f'{folder} is not a results folder: it contains other files')
        for one in (ROWS, FITTED):
            (folder / one).mkdir(parents=True, exist_ok=True)
        write_atomically(mark, json.dumps({'made by': 'inversion --bags'}) + '\n')

    def _place(self, recording: Path) -> Path:
        return self.folder / ROWS / f'{key(recording)}.json'

    def get(self, recording: Path) -> dict[str, Any] | None:
        """Return a recording's row, if it was made with the same settings."""
        row: dict[str, Any] | None = stored_json(self._place(recording))
        return row if row and row.get('settings') == self.settings else None

    def put(self, recording: Path, row: dict[str, Any]) -> None:
        """Store the result of a recording: first its files, then the row that names them.

        Raises:
            OSError: it cannot be written.

        """
        files = row.pop('files', {})
        for name, text in files.items():
            write_atomically(self.folder / FITTED / name, text)
        if not files:
            # Of contents that it no longer has.
            for ending in ('.yaml', '_robot.yaml'):
                (self.folder / FITTED / f'{self.name(recording)}{ending}').unlink(missing_ok=True)
        kept = {'file': printable(str(recording)), 'settings': self.settings, **row,
                'reason': printable(row['reason']),
                'fitted': str(Path(FITTED, next(iter(files)))) if files else ''}
        write_atomically(self._place(recording), json.dumps(kept))

    def name(self, recording: Path) -> str:
        """Name of a recording's fitted file, without its ending."""
        stem = ''.join(letter if letter.isalnum() or letter in '-_' else '_'
                       for letter in recording.name.split('.')[0])
        return f'{stem[:60]}-{key(recording)[:8]}'

    def rows(self, recordings: list[Path]) -> Iterator[dict[str, Any]]:
        """Yield the rows of those recordings that have one, in their order."""
        yield from filter(None, map(self.get, recordings))

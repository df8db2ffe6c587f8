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

"""Put small faults into the package, one at a time, and check that a test catches each of them.

A mutant is a patch in this folder. The text before it says what is wrong, and ``Caught by:`` names
the tests that should notice; usually only these are run. Everything happens in a copy of the tree
with an install/ of its own. At the end, all tests that noticed are run without any patch: what
fails then, too, has not noticed anything.
"""

import argparse
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass, replace
import json
import os
from pathlib import Path
import queue
import re
import shutil
import subprocess
import sys
import tempfile
import time

ROOT = Path(__file__).resolve().parents[2]
FOLDER = Path(__file__).parent
#: Fraction of the mutants that has to be caught.
ENOUGH = 57 / 60
#: What make test leaves out.
LEFT_OUT = 'not (deep or alone or browser or docs)'
CAUGHT, MISSED, BROKEN = 'caught', 'missed', 'does not apply'
UNRELIABLE = 'fails without it, too'


@dataclass(frozen=True)
class Mutant:
    """A patch.

    Attributes:
        path: of its file.
        fault: what is wrong, one sentence.
        tests: files of tests, or tests, that should notice.
        files: that it changes.

    """

    path: Path
    fault: str
    tests: tuple[str, ...]
    files: tuple[str, ...]

    @property
    def name(self) -> str:
        return self.path.stem


@dataclass(frozen=True)
class Verdict:
    """What became of a mutant: the first test that failed, and how long it took in s."""

    name: str
    verdict: str
    by: str
    seconds: float


def mutated(path: Path, root: Path = ROOT) -> dict[str, str]:
    """Return the text of each file that a patch changes, with its changes.

    Lines are found by their text, with as much of their context as the file still has, not by
    their numbers.

    Raises:
        ValueError: lines are not in the file, or in several places.

    """
    changed: dict[str, str] = {}
    _, *parts = re.split(r'^--- .*\n\+\+\+ b/(\S+)\n', path.read_text(), flags=re.MULTILINE)
    for file, hunks in zip(parts[::2], parts[1::2], strict=True):
        text = '\n' + (root / file).read_text() + '\n'
        for hunk in re.split(r'^@@ .*\n', hunks, flags=re.MULTILINE)[1:]:
            lines = hunk.removesuffix('\n').split('\n')
            edited = [k for k, line in enumerate(lines) if line[:1] in ('-', '+')]
            for context in range(len(lines), -1, -1):
                some = lines[max(0, edited[0] - context):edited[-1] + 1 + context]
                old, new = (''.join(f'\n{line[1:]}' for line in some if line[:1] != other)
                            for other in '+-')
                if (count := text.count(old + '\n') if old else 0) == 1:
                    break
            else:
                raise ValueError(f'{path.name}: {count} places in {file} have these lines: {hunk}')
            text = text.replace(old + '\n', new + '\n')
        changed[file] = text[1:-1]
    return changed


def mutants(names=()) -> list[Mutant]:
    """Read all mutants, or those whose names begin so."""
    found = []
    for path in sorted(FOLDER.glob('*.patch')):
        text = path.read_text()
        head, _, tests = text.partition('\n--- ')[0].partition('Caught by:')
        files = re.findall(r'^\+\+\+ b/(\S+)', text, re.MULTILINE)
        found.append(Mutant(path, ' '.join(head.split()), tuple(tests.split()), tuple(files)))
    for name in names:
        if not any(one.name.startswith(name) for one in found):
            sys.exit(f"there is no mutant '{name}'")
    return [one for one in found if not names or one.name.startswith(tuple(names))]


class Copy:
    """A copy of the tree, built, in which one mutant at a time is tested."""

    def __init__(self, place: Path) -> None:
        self.place = place
        listed = subprocess.run(['git', 'ls-files', '-coz', '--exclude-standard'], cwd=ROOT,
                                check=True, capture_output=True, text=True).stdout
        for name in filter(None, listed.split('\0')):
            if (ROOT / name).is_file():
                (place / name).parent.mkdir(parents=True, exist_ok=True)
                shutil.copy2(ROOT / name, place / name)
        shutil.copytree(ROOT / 'install', place / 'install', symlinks=True)
        if not (place / '.venv').exists():
            (place / '.venv').symlink_to(ROOT / '.venv')
        paths = {name: value.replace(str(ROOT), str(place)) for name, value in os.environ.items()
                 if name in ('PYTHONPATH', 'AMENT_PREFIX_PATH', 'COLCON_PREFIX_PATH')}
        self._variables = {**os.environ, **paths, 'COLUMNS': '1000'}
        # Mutants would push compiled code that is good out of a folder that others use, too.
        self._variables.pop('NUMBA_CACHE_DIR', None)
        self._package = next((place / 'install' / 'cpg_ros' / 'lib').glob(
            'python3*/*-packages/cpg_ros'))

    def install(self, file: str) -> None:
        """Copy a source file of the copy to where the build has put it."""
        inside = Path(file).parts
        there = (self._package.parent / file if inside[0] == 'cpg_ros' else
                 self.place / 'install' / 'cpg_ros' / 'share' / 'cpg_ros' / file)
        shutil.copy2(self.place / file, there)

    def failures(self, *arguments: str) -> list[str]:
        """Run tests; return the names of those that fail."""
        done = subprocess.run(
            [ROOT / '.venv' / 'bin' / 'pytest', '--timeout', '300', '-m', LEFT_OUT, '-p',
             'no:cacheprovider', *arguments], cwd=self.place, env=self._variables,
            capture_output=True, text=True)
        found = re.findall(r'^(?:FAILED|ERROR) (test/.+?)(?: - .*)?$', done.stdout, re.MULTILINE)
        if not found and done.returncode not in (0, 5):
            sys.exit(f'pytest ended with {done.returncode}: {done.stdout}{done.stderr}')
        return found

    def judge(self, mutant: Mutant, whole: bool) -> tuple[str, str]:
        """Return what becomes of a mutant, and the test that decided."""
        try:
            changed = mutated(mutant.path, self.place)
        except ValueError as error:
            return BROKEN, str(error)
        try:
            for file, text in changed.items():
                (self.place / file).write_text(text)
                self.install(file)
            found = self.failures('-x', *mutant.tests) or (
                self.failures('-x', 'test') if whole else [])
        finally:
            for file in mutant.files:
                shutil.copy2(ROOT / file, self.place / file)
                self.install(file)
        return (CAUGHT, found[0]) if found else (MISSED, '')


def main() -> int:
    """Test mutants; return 0 if enough are caught."""
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument('names', nargs='*', help='beginnings of names; all by default')
    parser.add_argument('--all', action='store_true',
                        help='run all of make test where the tests that are named catch nothing')
    parser.add_argument('--jobs', type=int, default=1, help='copies of the tree (default: 1)')
    chosen = parser.parse_args()
    found = mutants(chosen.names)
    copies: queue.SimpleQueue[Copy] = queue.SimpleQueue()

    def tested(mutant: Mutant) -> Verdict:
        copy, began = copies.get(), time.monotonic()
        try:
            verdict, by = copy.judge(mutant, chosen.all)
        finally:
            copies.put(copy)
        one = Verdict(mutant.name, verdict, by, round(time.monotonic() - began, 1))
        print(f'{one.name:36} {one.verdict:8} {one.seconds:6.1f} s  '
              f'{one.by if one.by else mutant.fault}', flush=True)
        return one

    with tempfile.TemporaryDirectory(prefix='mutants-') as scratch:
        for number in range(chosen.jobs):
            copies.put(Copy(Path(scratch, str(number))))
        with ThreadPoolExecutor(chosen.jobs) as workers:
            verdicts = list(workers.map(tested, found))
        deciding = sorted({one.by for one in verdicts if one.verdict == CAUGHT})
        unreliable = copies.get().failures(*deciding) if deciding else []
    verdicts = [replace(one, verdict=UNRELIABLE) if one.by in unreliable else one
                for one in verdicts]
    caught = sum(one.verdict == CAUGHT for one in verdicts)
    print(json.dumps({'mutants': len(verdicts), 'caught': caught,
                      'seconds': round(sum(one.seconds for one in verdicts), 1),
                      'others': [asdict(one) for one in verdicts if one.verdict != CAUGHT]}))
    good = caught >= ENOUGH * len(verdicts) - 1e-9
    return int(not good or any(one.verdict == BROKEN for one in verdicts))


if __name__ == '__main__':
    sys.exit(main())

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

"""CPU time of the executable ``analyze``: user and system time of the whole process.

Interpreter start and imports belong to it, compiling does not: each command runs once before it is
measured. ``--beside FOLDER`` measures the commands of another workspace that has been built, such
as the commit before, by turns with this one's.
"""

from argparse import ArgumentParser
import os
from pathlib import Path
import resource
import statistics
import subprocess
import tempfile

from common import emit, log, ROOT

TARGETS = {'quadruped': 3.0, 'biped': 4.0}
RUNS = {'quadruped': ('--network', 'quadruped'), 'biped': ('--network', 'biped'),
        'delayed': ('--network', 'delayed')}


def spent(workspace: Path, arguments: list[str]) -> float:
    """Seconds of CPU that ``analyze`` of a workspace takes."""
    prefix = workspace / 'install' / 'cpg_ros'
    packages = next(prefix.glob('lib/python3*/*-packages'))
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run([prefix / 'lib' / 'cpg_ros' / 'analyze', *arguments], check=True,
                   env={**os.environ, 'PYTHONPATH': str(packages)},
                   stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return (after.ru_utime + after.ru_stime) - (before.ru_utime + before.ru_stime)


def main() -> None:
    """Measure, print one line."""
    parser = ArgumentParser(description=__doc__)
    parser.add_argument('--beside', type=Path, metavar='FOLDER', help='another workspace')
    parser.add_argument('--rounds', type=int, default=5)
    args = parser.parse_args()
    places = {'seconds': ROOT, **({'seconds_beside': args.beside} if args.beside else {})}
    found: dict[str, dict[str, float]] = {name: {} for name in places}
    with tempfile.TemporaryDirectory() as folder:
        for run, given in RUNS.items():
            for what, more in ((run, ()), (f'{run}_plot', ('--plot', f'{folder}/analysis.png'))):
                log(what)
                times: dict[str, list[float]] = {name: [] for name in places}
                for turn in range(args.rounds + 1):
                    for name, place in places.items():
                        seconds = spent(place, [*given, *more])
                        # What is not compiled yet is compiled in the first turn.
                        if turn:
                            times[name].append(seconds)
                for name, all_times in times.items():
                    found[name][what] = statistics.median(all_times)
    emit(benchmark='analyze', targets=TARGETS, **found,
         passed=all(found['seconds'][name] <= most for name, most in TARGETS.items()))


if __name__ == '__main__':
    main()

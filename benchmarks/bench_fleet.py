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

"""Past one machine: a thousand recordings through deaths and restarts, and what the fleet costs.

The same table, byte for byte but for timings, from two processes that nothing happens to and from
a dask cluster of real worker processes, of which one is killed at 30 % and whose scheduler is
restarted at 60 %. Two cores against one; dask against processes at jobs of 0.1 s; the memory of
the client. With --atlas also a map of 200 x 200 points, with --searches tune and optimize on each.
"""

import argparse
from concurrent.futures import Executor
import csv
import os
from pathlib import Path
import tempfile
import time

from common import emit, log
import psutil

from fleet_recordings import COUNT, DAMAGE, counted, make  # isort: skip
from fleet_jobs import dask_cluster, pause  # isort: skip

from cpg_ros.analysis.atlas.atlas import main as draw
from cpg_ros.common.jobs import outcomes
from cpg_ros.common.workers import cluster, processes
from cpg_ros.fitting.inversion import many_recordings
from cpg_ros.fitting.inversion.many_recordings import FitSettings, Folders

GOALS = {'efficiency': 1.8, 'overhead': 0.10}


def rows(out: Path) -> list[list[tuple[str, str]]]:
    """The table without timings."""
    with (out / 'table.csv').open() as file:
        return [[(name, value) for name, value in row.items() if name != 'seconds']
                for row in csv.DictReader(file)]


def table(folder: Path, count: int, damaged: int) -> dict[str, object]:
    """Both tables, and how often work was done twice."""
    log(f'making {count} recordings, {damaged} of them damaged')
    spoiled = make(folder / 'in', count, damaged)
    many_recordings.invert_recording = counted
    began = time.monotonic()
    with processes(2) as calm:
        Folders([folder / 'in'], folder / 'calm', FitSettings()).run(calm)
    spent = time.monotonic() - began
    os.environ[COUNT] = str(folder / 'count')
    events: list[str] = []
    with dask_cluster(folder, 2) as dask, cluster(dask.address, events.append) as fleet:
        work = Folders([folder / 'in'], folder / 'rough', FitSettings())
        done, room, memory = 0, fleet.room, {}
        keep = work.keep

        def kept(*arguments: object) -> None:
            nonlocal done
            keep(*arguments)
            done += 1
            if done in (count // 10, count):
                memory[f'{done}'] = psutil.Process().memory_info().rss / 2**20
            if done == 3 * count // 10:
                nanny = psutil.Process(dask.workers[0].pid)
                max(nanny.children(), key=lambda one: 'spawn_main' in ' '.join(
                    one.cmdline())).kill()
                log('a worker was killed')
            if done == 6 * count // 10:
                dask.restart_scheduler()
                log('the scheduler was restarted')

        work.keep = kept
        work.run(fleet)
    del os.environ[COUNT]
    calm_rows, rough_rows = rows(folder / 'calm'), rows(folder / 'rough')
    for one, other in zip(calm_rows, rough_rows, strict=False):
        if one != other:
            log(f'{dict(one)["file"]} differs in '
                + ', '.join(name for (name, value), pair in zip(one, other, strict=True)
                            if value != pair[1]))
    reasons = {Path(dict(row)['file']).name.split('.')[0]: dict(row)['reason']
               for row in calm_rows if dict(row)['reason']}
    reasons |= {Path(dict(row)['file']).parent.name: dict(row)['reason'] for row in calm_rows
                if 'bag_0' in dict(row)['file']}
    executed = (folder / 'count').read_text().splitlines()
    return {'recordings': count, 'rows': len(rough_rows), 'same_table': calm_rows == rough_rows,
            'damaged': len(spoiled), 'right_reasons': sum(
                name in reasons and DAMAGE[way] in reasons[name]
                for name, way in spoiled.items()),
            'failed_rows': sum(bool(dict(row)['reason']) for row in calm_rows),
            'done_twice': len(executed) - count, 'in_flight': room, 'events': events,
            'seconds_on_two_processes': spent, 'client_MiB_at': memory}


def inverted_in(executor: Executor, folder: Path, out: Path) -> float:
    began = time.monotonic()
    Folders([folder], out, FitSettings(), progress=False).run(executor)
    return time.monotonic() - began


def efficiency(folder: Path, count: int, rounds: int = 3) -> float:
    """How many times as fast two processes are, warm, by turns."""
    make(folder / 'some', count, 0)
    spent = {1: 0.0, 2: 0.0}
    with processes(1) as one, processes(2) as two:
        for turn in range(rounds + 1):
            for workers, fleet in ((1, one), (2, two)):
                took = inverted_in(fleet, folder / 'some', folder / f'some-{turn}-{workers}')
                spent[workers] += took * (turn > 0)
    return spent[1] / spent[2]


def atlas_efficiency(folder: Path) -> float:
    """The same of a map, start of the processes and the drawing included."""
    spent = {}
    for jobs in (1, 2, 2, 1):
        began = time.monotonic()
        out = folder / f'map-{began}'
        draw(['--over', 'c=2:10', 'tau=0.2:2', '--points', '60x60', '--jobs', str(jobs),
              '--out', str(out)])
        spent[jobs] = spent.get(jobs, 0.0) + time.monotonic() - began
    return spent[1] / spent[2]


def overhead(folder: Path, count: int = 200, rounds: int = 3) -> float:
    """Share by which jobs of 0.1 s take longer on dask than on processes."""
    spent = {'dask': 0.0, 'processes': 0.0}
    with (dask_cluster(folder, 2) as dask, cluster(dask.address) as far, processes(2) as near):
        for turn in range(rounds + 1):
            for name, fleet in (('processes', near), ('dask', far)):
                began = time.monotonic()
                assert sum(1 for _ in outcomes(fleet, pause, range(count))) == count
                spent[name] += (time.monotonic() - began) * (turn > 0)
    return spent['dask'] / spent['processes'] - 1.0


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--recordings', type=int, default=1000)
    parser.add_argument('--damaged', type=int, default=20)
    parser.add_argument('--efficiency', action='store_true', help='nothing else')
    parser.add_argument('--atlas', action='store_true')
    parser.add_argument('--searches', action='store_true')
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        if not args.efficiency:
            emit(benchmark='fleet table', **table(folder, args.recordings, args.damaged))
        emit(benchmark='fleet efficiency', goal=GOALS['efficiency'],
             two_processes_over_one={'inversion': efficiency(folder, 24),
                                     'atlas': atlas_efficiency(folder)})
        if not args.efficiency:
            emit(benchmark='fleet overhead', goal=GOALS['overhead'],
                 dask_over_processes=overhead(folder))
        if args.atlas:
            emit(benchmark='fleet atlas', **atlas(folder))
        if args.searches:
            emit(benchmark='fleet searches', **searches(folder))


def atlas(folder: Path) -> dict[str, object]:
    """A map of 200 x 200 points of all six gaits on two processes."""
    began = time.monotonic()
    draw(['--over', 'c=2:10', 'tau=0.2:2', '--jobs', '2', '--out', str(folder / 'atlas')])
    return {'seconds': time.monotonic() - began, 'goal_seconds': 600}


def searches(folder: Path) -> dict[str, object]:
    """Whether tune finds the same on one process, two and dask."""
    from cpg_ros.simulation.tuning.gaits import tune
    from go2 import GO2
    found = {}
    with (dask_cluster(folder, 2) as dask, cluster(dask.address) as far, processes(2) as two,
          processes(1) as one):
        for name, executor in (('one', one), ('two', two), ('dask', far)):
            robot, tuned, _ = tune(GO2, 'go2', ['trot', 'jump'], 24, 0, executor=executor,
                                   threads=1)
            found[name] = repr((robot.motions, [(each.design, each.price) for each in tuned]))
    return {'tune_the_same': len(set(found.values())) == 1}


if __name__ == '__main__':
    main()

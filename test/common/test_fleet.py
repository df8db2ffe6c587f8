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

"""Many jobs: on processes, on a dask cluster, through deaths of workers; and their progress."""

from argparse import ArgumentParser
from concurrent.futures import ThreadPoolExecutor
import io
import itertools
import os
from pathlib import Path
import shutil
import signal
import subprocess
import sys
import time
from urllib.parse import urlsplit

import cpg_ros
from cpg_ros.common.errors import InputError
from cpg_ros.common.jobs import JobProgress, outcomes, WorkerDied
from cpg_ros.common.workers import (
    add_options,
    Certificates,
    cluster,
    NoCluster,
    processes,
    working,
)
from fleet_jobs import dask_cluster, deadly, late_death, odd_ones_fail, slow_square, square
from hypothesis import given
from hypothesis import strategies as st
import pytest

psutil = pytest.importorskip('psutil')


@pytest.fixture(scope='module')
def two():
    with processes(2) as fleet:
        yield fleet


@pytest.fixture(scope='module')
def dask(tmp_path_factory):
    pytest.importorskip('distributed')
    with dask_cluster(tmp_path_factory.mktemp('dask')) as one:
        yield one


@given(st.lists(st.integers(-50, 50), max_size=30), st.integers(1, 4))
def test_every_job_has_one_outcome_on_any_executor(jobs, threads):
    with ThreadPoolExecutor(threads) as executor:
        found = list(outcomes(executor, odd_ones_fail, jobs))
    assert sorted(one.job for one in found) == sorted(jobs)
    for one in found:
        if one.job % 2:
            assert isinstance(one.error, ValueError)
        else:
            assert (one.value, one.error) == (one.job, None)


def test_results_are_in_the_order_of_the_jobs(two):
    assert list(two.map(square, range(20))) == [k * k for k in range(20)]


def test_jobs_are_made_only_when_there_is_room():
    made = itertools.count()
    with ThreadPoolExecutor(1) as executor:
        stream = outcomes(executor, square, made)
        for _ in range(5):
            next(stream)
        stream.close()
    assert next(made) <= 5 + 8


def test_a_worker_that_dies_costs_the_job_that_it_dies_of_and_no_other(two, tmp_path):
    jobs = [*range(8), str(tmp_path / 'mark'), 13, *range(20, 28)]
    found = {one.job: one for one in outcomes(two, deadly, jobs)}
    assert set(found) == set(jobs)
    assert isinstance(found.pop(13).error, WorkerDied)
    assert found.pop(str(tmp_path / 'mark')).value == 'survived'
    assert all(one.value == job for job, one in found.items())


def test_no_job_joins_one_that_is_alone_because_its_worker_died():
    # It would be lost with it.
    with processes(1) as one:
        found = {one.job: one for one in outcomes(one, late_death, [-1, -2, *range(4)])}
    assert {job for job, one in found.items() if one.error} == {-1, -2}
    assert [found[job].value for job in range(4)] == [0, 1, 2, 3]


def test_workers_end_with_a_client_that_is_killed():
    script = ('from cpg_ros.common.workers import processes\nimport os, signal\n'
              'if __name__ == "__main__":\n    fleet = processes(1)\n'
              '    print(fleet.submit(os.getpid).result(), flush=True)\n'
              '    os.kill(os.getpid(), signal.SIGKILL)\n')
    found = subprocess.run([sys.executable, '-P', '-c', script], capture_output=True, text=True)
    worker = int(found.stdout)
    for _ in range(100):
        if not psutil.pid_exists(worker) or psutil.Process(worker).status() == 'zombie':
            return
        time.sleep(0.1)
    pytest.fail('the worker goes on')


@pytest.mark.parametrize('after', [0.05, 0.2, 0.5])
def test_ctrl_c_while_workers_start_is_the_clients_alone(after):
    # They import for a second; a terminal sends Ctrl-C to all processes of a command.
    script = ('from cpg_ros.common.workers import processes\nimport sys, time\n'
              'fleet = processes(2)\ntry:\n'
              '    jobs = [fleet.submit(time.sleep, 60) for _ in range(2)]\n'
              '    print("submitted", flush=True)\n    jobs[0].result()\n'
              'except KeyboardInterrupt:\n    fleet.shutdown(wait=False)\n'
              '    sys.exit("stopped")\n')
    # A shell that runs the tests in the background has them ignore it.
    running = subprocess.Popen(
        [sys.executable, '-P', '-c', script], stdout=subprocess.PIPE, stderr=subprocess.PIPE,
        text=True, start_new_session=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL))
    assert running.stdout.readline() == 'submitted\n'
    time.sleep(after)
    os.killpg(running.pid, signal.SIGINT)
    assert running.communicate(timeout=60) == ('', 'stopped\n')


@pytest.mark.parametrize(('address', 'said'), [
    ('head', "'head' is not the address"), ('tcp://head', 'missing port number'),
    ('xyz://head:1', "unknown address scheme 'xyz'")])
def test_what_is_no_address_is_said_to_be_none(address, said):
    pytest.importorskip('distributed')
    with pytest.raises(InputError, match=said):
        cluster(address)


def test_an_address_where_nothing_answers(tmp_path):
    pytest.importorskip('distributed')
    found = subprocess.run(
        [sys.executable, '-P', '-m', 'cpg_ros.fitting.inversion.inversion', '--bags',
         str(Path(__file__).parent), '--out', str(tmp_path / 'out'), '--dask',
         'tcp://127.0.0.1:1'], capture_output=True, text=True, timeout=60)
    assert found.returncode == 2
    assert found.stderr == 'inversion: no dask scheduler answers at tcp://127.0.0.1:1\n'


def certificates(folder):
    """Make an authority and a certificate that it signs, by openssl; return CA, CERT, KEY."""
    def openssl(*words):
        subprocess.run(['openssl', *words], cwd=folder, check=True, capture_output=True)

    key = '-newkey', 'ec', '-pkeyopt', 'ec_paramgen_curve:prime256v1', '-nodes'
    openssl('req', '-x509', *key, '-keyout', 'ca.key', '-out', 'ca.pem', '-subj', '/CN=authority',
            '-days', '2')
    openssl('req', *key, '-keyout', 'key.pem', '-out', 'request.pem', '-subj', '/CN=cluster')
    openssl('x509', '-req', '-in', 'request.pem', '-CA', 'ca.pem', '-CAkey', 'ca.key',
            '-CAcreateserial', '-out', 'cert.pem', '-days', '2')
    return [str(folder / name) for name in ('ca.pem', 'cert.pem', 'key.pem')]


def dask_here(**options):
    """Return a scheduler and one worker in this process."""
    local = pytest.importorskip('distributed').LocalCluster
    return local(n_workers=1, threads_per_worker=1, processes=False, dashboard_address=None,
                 **options)


@pytest.mark.skipif(shutil.which('openssl') is None, reason='openssl is not installed')
def test_a_cluster_with_tls(tmp_path):
    pytest.importorskip('distributed')
    from distributed import Security
    (ours := tmp_path / 'ours').mkdir()
    (others := tmp_path / 'others').mkdir()
    own, said = certificates(ours), []
    roles = {f'tls_{role}_{kind}': file for role in ('client', 'scheduler', 'worker')
             for kind, file in zip(('cert', 'key'), own[1:], strict=True)}
    safe = Security(tls_ca_file=own[0], require_encryption=True, **roles)
    with dask_here(security=safe, host='127.0.0.1', protocol='tls://') as local:
        address = local.scheduler_address
        parser = ArgumentParser()
        add_options(parser)
        with working(parser.parse_args(['--dask', address, '--tls', *own]), '',
                     said.append) as fleet:
            assert list(fleet.map(square, range(5))) == [0, 1, 4, 9, 16]
        assert address.startswith('tls://') and not said
        with pytest.raises(InputError, match='needs --tls CA CERT KEY'):
            cluster(address)
        with pytest.raises(NoCluster, match=r'answers at .* to these certificates'):
            cluster(address, certificates=Certificates(*certificates(others)))
        with pytest.raises(NoCluster, match='no dask scheduler answers'):
            cluster(address.replace('tls', 'tcp'))
        for wrong, match in (((own[0], own[1], own[0]), 'cannot be used'),
                             ((own[0], own[1], 'none.pem'), 'none.pem: no such file')):
            with pytest.raises(InputError, match=match):
                cluster(address, certificates=Certificates(*wrong))


@pytest.mark.parametrize(('words', 'said'), [
    (['--tls', 'a', 'b', 'c'], 'argument --tls: it needs --dask'),
    (['--dask', 'tcp://x:1', '--tls', 'a', 'b', 'c'], "that begins with tls://, not 'tcp://x:1'")])
def test_certificates_without_an_address_for_them(words, said):
    pytest.importorskip('distributed')
    parser = ArgumentParser()
    add_options(parser)
    with (pytest.raises(InputError, match=said),
          working(parser.parse_args(words), '', lambda line: None)):
        pass


def test_a_scheduler_that_others_reach_without_tls_is_warned_of_once():
    said = []
    with dask_here(host='0.0.0.0', protocol='tcp://') as local:
        port = urlsplit(local.scheduler_address).port
        with cluster(f'tcp://127.0.0.1:{port}', said.append) as fleet:
            assert list(fleet.map(square, range(3))) == [0, 1, 4]
            fleet.renew()
    warnings = [line for line in said if line.startswith('warning: ')]
    assert len(warnings) == 1 and 'without TLS' in warnings[0]


def test_one_on_loopback_is_not(dask):
    said = []
    cluster(dask.address, said.append).shutdown()
    assert not said


def test_dask_gives_what_processes_give_through_deaths_and_a_restart(dask):
    said = []
    with cluster(dask.address, said.append) as fleet:
        assert list(fleet.map(square, range(10))) == [k * k for k in range(10)]
        done, before = [], itertools.count()
        for one in outcomes(fleet, slow_square, (next(before) for _ in range(60))):
            done.append((one.job, one.value))
            if len(done) == 18:
                nanny = psutil.Process(dask.workers[0].pid)
                worker = max(nanny.children(), key=lambda one: 'spawn_main' in ' '.join(
                    one.cmdline()))
                worker.kill()
            if len(done) == 36:
                dask.restart_scheduler()
    assert sorted(done) == [(k, k * k) for k in range(60)]
    assert said[0].startswith(f'the scheduler at {dask.address} is lost')
    assert said[1].startswith('the scheduler is back')


def test_workers_without_the_package_are_refused(dask, monkeypatch):
    class Lacking:
        def result(self, timeout):
            raise ModuleNotFoundError("No module named 'cpg_ros'")
    import distributed
    monkeypatch.setattr(distributed.Client, 'submit', lambda *_, **__: Lacking())
    with pytest.raises(NoCluster, match="lack the package: No module named 'cpg_ros'"):
        cluster(dask.address)


class Terminal(io.StringIO):
    def isatty(self):
        return True


def test_progress_is_a_line_a_minute_where_there_is_no_terminal():
    now, said = [0.0], io.StringIO()
    with JobProgress('bags', 100, stream=said, clock=lambda: now[0]) as tally:
        for k in range(50):
            now[0] += 3.0
            tally.add(failed=k % 10 == 0)
    lines = said.getvalue().splitlines()
    assert lines[0] == 'bags: 20 of 100 done, 2 failed, 20 a minute, 4 min left'
    assert lines[1] == 'bags: 40 of 100 done, 4 failed, 20 a minute, 3 min left'
    assert lines[2:] == ['bags: 50 of 100 done, 5 failed, 20 a minute, 2 min left']


def test_progress_is_redrawn_on_a_terminal_and_counts_what_earlier_runs_did():
    now, said = [0.0], Terminal()
    with JobProgress('bags', 4, stream=said, clock=lambda: now[0]) as tally:
        tally.add(kept=True)
        for _ in range(3):
            now[0] += 1.5
            tally.add()
    assert said.getvalue().startswith('\rbags: 3 of 4 done, 0 failed, 1 from before, 40 a minute')
    assert said.getvalue().endswith('\n')
    assert said.getvalue().count('\n') == 1


def test_short_work_says_nothing():
    said = Terminal()
    with JobProgress('bags', 1, stream=said) as tally:
        tally.add()
    assert said.getvalue() == ''


def test_the_rooms_that_take_an_executor_do_not_know_dask():
    root = Path(cpg_ros.__file__).parent
    naming = [file.relative_to(root).parts[0] for file in root.rglob('*.py')
              if 'from distributed' in file.read_text()]
    assert set(naming) == {'common'}

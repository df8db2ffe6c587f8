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

"""Jobs that worker processes run, and a local dask cluster of real processes."""

from contextlib import contextmanager
import os
from pathlib import Path
import signal
import socket
import subprocess
import sys
import time


def square(job):
    return job * job


def slow_square(job):
    time.sleep(0.05)
    return job * job


def pause(job):
    time.sleep(0.1)
    return job


def odd_ones_fail(job):
    if job % 2:
        raise ValueError(f'{job} is odd')
    return job


def deadly(job):
    """Kill the worker: with 13 always, with a path once (a file there is the memory of it)."""
    if job == 13:
        os.kill(os.getpid(), signal.SIGKILL)
    if isinstance(job, str):
        mark = Path(job)
        if not mark.exists():
            mark.touch()
            os.kill(os.getpid(), signal.SIGKILL)
        return 'survived'
    time.sleep(0.02)
    return job


def free_port():
    with socket.socket() as one:
        one.bind(('127.0.0.1', 0))
        return one.getsockname()[1]


class Cluster:
    """A scheduler and worker processes, started as a user does."""

    def __init__(self, folder, workers=2):
        self.port, self.folder = free_port(), folder
        # Jobs are found where this process finds them: here, or in benchmarks.
        self.environment = {**os.environ, 'PYTHONPATH': os.pathsep.join(
            [str(Path(__file__).parent), *filter(None, sys.path)])}
        self.address = f'tcp://127.0.0.1:{self.port}'
        self.scheduler = self.start_scheduler()
        self.workers = [self.start_worker() for _ in range(workers)]

    def _start(self, *words):
        return subprocess.Popen([sys.executable, '-m', 'dask', *words], env=self.environment,
                                stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
                                cwd=self.folder)

    def start_scheduler(self):
        return self._start('scheduler', '--host', '127.0.0.1', '--port', str(self.port),
                           '--no-dashboard', '--no-show')

    def start_worker(self):
        return self._start('worker', self.address, '--nthreads', '1', '--no-dashboard',
                           '--nanny', '--local-directory', str(self.folder))

    def ready(self, workers=2):
        from distributed import Client
        end = time.monotonic() + 60
        while True:
            try:
                with Client(self.address, timeout=2, set_as_default=False) as client:
                    client.wait_for_workers(workers, timeout=50)
                return
            except OSError:
                if time.monotonic() > end:
                    raise

    def restart_scheduler(self):
        self.scheduler.kill()
        self.scheduler.wait()
        self.scheduler = self.start_scheduler()
        # Workers end with their scheduler; on a cluster something starts them again.
        for worker in self.workers:
            worker.terminate()
            worker.wait()
        self.workers = [self.start_worker() for _ in self.workers]

    def stop(self):
        for one in (*self.workers, self.scheduler):
            one.terminate()
        for one in (*self.workers, self.scheduler):
            try:
                one.wait(10)
            except subprocess.TimeoutExpired:
                one.kill()
                one.wait()


@contextmanager
def dask_cluster(folder, workers=2):
    cluster = Cluster(folder, workers)
    try:
        cluster.ready(workers)
        yield cluster
    finally:
        cluster.stop()


def late_death(job):
    """Kill the process of a negative number a second after it was sent."""
    if job < 0:
        time.sleep(1.0)
        os.kill(os.getpid(), signal.SIGKILL)
    return job

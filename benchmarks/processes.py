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

"""Nodes as processes of their own: starting and ending them, their CPU time and their memory."""

import ctypes
import json
import os
from pathlib import Path
import signal
import subprocess
import sys
import tempfile
import time
from typing import Self

from common import log, ROOT
from cpg_ros.ros.node.node_base import leave_shared_memory

HERE = Path(__file__).resolve().parent
GENERATOR = [str(ROOT / 'install/cpg_ros/lib/cpg_ros/generator')]
NULL_NODE = [sys.executable, str(HERE / 'null_node.py')]
TICKS_A_SECOND = os.sysconf('SC_CLK_TCK')
#: Of linux/prctl.h.
PR_SET_PDEATHSIG = 1
LIBC = ctypes.CDLL(None)


def ends_with_us() -> None:
    """Have this process ended with its parent, however that ends.

    A generator that is left behind at a real-time priority is in the way of all that is measured
    afterwards.
    """
    LIBC.prctl(PR_SET_PDEATHSIG, signal.SIGTERM)


def enter_workspace() -> None:
    """Give this process, and so its children, the environment of the Makefile's ENTER.

    On a ROS domain that no other benchmark is likely to have.
    """
    built = subprocess.run(['bash', '-c', 'source install/setup.bash && env -0'], cwd=ROOT,
                           check=True, stdout=subprocess.PIPE, text=True).stdout
    os.environ.update(pair.split('=', 1) for pair in built.split('\0') if pair)
    os.environ.update({'AMENT_PREFIX_PATH': f'{ROOT}/install/cpg_ros:{ROOT}/.venv',
                       'ROS_AUTOMATIC_DISCOVERY_RANGE': 'LOCALHOST',
                       'ROS_DOMAIN_ID': str(50 + os.getpid() % 50)})
    os.environ.pop('ROS_PYTHON_CHECK_FIELDS', None)
    # So that nodes, their peers and their listeners have the same transport.
    leave_shared_memory()


class Process:
    """A child process and its log; ended when the block is left."""

    def __init__(self, command: list[str], **parameters: object) -> None:
        self._log = tempfile.NamedTemporaryFile(suffix='.log')  # noqa: SIM115
        if parameters:
            command = [*command, '--ros-args', *(word for name, value in parameters.items()
                                                 for word in ('-p', f'{name}:={value}'))]
        self._child = subprocess.Popen(command, stdout=self._log, stderr=subprocess.STDOUT,
                                       preexec_fn=ends_with_us)
        self.pid = self._child.pid

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.end()

    @property
    def alive(self) -> bool:
        return self._child.poll() is None

    @property
    def output(self) -> str:
        return Path(self._log.name).read_text(errors='replace')

    def wait_for(self, text: str, times: int = 1, timeout: float = 90.0) -> 'Process':
        """Wait until its log contains a text so often (the first start compiles, about 20 s)."""
        deadline = time.monotonic() + timeout
        while self.output.count(text) < times:
            if not self.alive or time.monotonic() > deadline:
                raise RuntimeError(f"no '{text}' from {self._child.args}:\n{self.output}")
            time.sleep(0.1)
        return self

    def cpu_s(self) -> float:
        """User and system time so far, all threads, s."""
        fields = Path(f'/proc/{self.pid}/stat').read_text().rpartition(')')[2].split()
        return (int(fields[11]) + int(fields[12])) / TICKS_A_SECOND

    def resident_mb(self) -> float:
        status = Path(f'/proc/{self.pid}/status').read_text()
        return int(status.partition('VmRSS:')[2].split()[0]) / 1024

    def signal(self, number: int) -> None:
        self._child.send_signal(number)

    def wait(self, timeout: float = 30.0) -> int:
        return self._child.wait(timeout)

    def end(self) -> int:
        """Interrupt it, once, and wait; return the exit code."""
        if self.alive:
            self._child.send_signal(signal.SIGINT)
            try:
                self._child.wait(10.0)
            except subprocess.TimeoutExpired:
                log(f'{self._child.args} does not end, killing it')
                self._child.kill()
                self._child.wait()
        return self._child.returncode


def start_node(kind: str, **parameters: object) -> Process:
    """Start 'generator' or 'null' and wait until it publishes."""
    command = {'generator': GENERATOR, 'null': NULL_NODE}[kind]
    process = Process(command, **parameters)
    try:
        return process.wait_for('publishing')
    except RuntimeError:
        process.end()
        raise


class Listener(Process):
    """listener.py, recording joint_states until it is ended or its time is over."""

    def __init__(self, seconds: float) -> None:
        self._file = tempfile.NamedTemporaryFile(suffix='.npz')  # noqa: SIM115
        self.seconds = seconds
        super().__init__([sys.executable, str(HERE / 'listener.py'), str(seconds),
                          self._file.name])
        self.wait_for('listening')

    def record(self) -> tuple[dict, list[dict]]:
        """Wait for its end; return its arrays by name, and the first and last diagnostics."""
        import numpy as np

        self._child.wait(self.seconds + 30.0)
        if self._child.returncode:
            raise RuntimeError(f'the listener failed:\n{self.output}')
        with np.load(self._file.name) as arrays:
            record = dict(arrays)
        return record, json.loads(str(record.pop('health')))

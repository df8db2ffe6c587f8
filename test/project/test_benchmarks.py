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

"""Peers: one keeps up with the node's own parts, and those that are missing are named."""

import json
import os
from pathlib import Path
import signal
import subprocess
import sys

from graph import free_domain, PATIENCE, Watcher

BENCHMARKS = Path(__file__).resolve().parents[2] / 'benchmarks'
PEER = BENCHMARKS / 'null_node.py'


def test_the_null_node_publishes_and_ends():
    domain = free_domain()
    process = subprocess.Popen(
        [sys.executable, str(PEER), '--ros-args', '-p', 'rate:=200.0'], text=True,
        env=dict(os.environ, ROS_DOMAIN_ID=str(domain)), stdout=subprocess.PIPE,
        stderr=subprocess.PIPE)
    try:
        assert process.stdout.readline() == 'publishing at 200 Hz\n', process.stderr.read()
        watcher = Watcher(domain, '/null')
        try:
            _, positions, _ = watcher.record(0.5)
        finally:
            watcher.end()
        assert not (positions - positions[0]).any()
        process.send_signal(signal.SIGINT)
        assert process.wait(PATIENCE) == 0
        assert 'Traceback' not in process.stderr.read()
    finally:
        process.kill()
        process.communicate()


def test_a_policy_that_is_missing_is_skipped_with_the_reason(tmp_path):
    ran = subprocess.run([sys.executable, str(BENCHMARKS / 'bench_policy.py'), '--seed', '1'],
                         env=dict(os.environ, MUJOCO_PLAYGROUND=str(tmp_path)), text=True,
                         capture_output=True, check=True)
    told = json.loads(ran.stdout)
    assert 'MUJOCO_PLAYGROUND' in told['playground']['skipped']
    assert '--robot' in told['feedback']['skipped'] and '--robot' in told['open']['skipped']

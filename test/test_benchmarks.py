"""The peer that the generator is measured against keeps up with the node's own parts."""

import os
import signal
import subprocess
import sys
from pathlib import Path

from graph import PATIENCE, Watcher, free_domain

PEER = Path(__file__).resolve().parent.parent / 'benchmarks' / 'null_node.py'


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

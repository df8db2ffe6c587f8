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

"""The node as a process: how it starts, ends, and lives beside others."""

import os
from pathlib import Path
import signal
import subprocess
import sys
import time

from ament_index_python.packages import get_package_share_directory
from depth import in_depth
from diagnostic_msgs.msg import DiagnosticStatus
from graph import free_domain, off_grid, PATIENCE, until, Watcher
import numpy as np
import pytest
from stepped import refused
import yaml

CONFIG = Path(get_package_share_directory('cpg_ros')) / 'config'


@pytest.mark.parametrize('number', [signal.SIGTERM, signal.SIGHUP,
                                    *in_depth(signal.SIGINT, signal.SIGQUIT)])
def test_a_signal_ends_it_at_the_stand_with_code_0(start, number):
    process, watcher = start('-p', 'rate:=200', '-p', 'frequency:=2')
    watcher.record(1.5)
    process.signal(number)
    assert process.wait() == 0
    assert 'ramping down' in process.log
    assert 'Traceback' not in process.log
    _, position, velocity = watcher.samples[-1]
    stand = {'hip': 0.0, 'thigh': 0.8, 'calf': -1.5}
    expected = [stand[name.split('_')[1]] for name in watcher.names]
    assert position == pytest.approx(expected, abs=1e-9)
    assert velocity == pytest.approx([0.0] * 12, abs=1e-9)
    speeds = np.abs(np.diff([sample[1] for sample in watcher.samples], axis=0)) / 0.005
    assert speeds.max() <= 20.0


def test_nohup_lets_it_live_on_without_its_terminal(start):
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        process, watcher = start('-p', 'rate:=200')
    finally:
        signal.signal(signal.SIGHUP, before)
    process.signal(signal.SIGHUP)
    watcher.record(1.5)
    assert process.alive and np.any(watcher.samples[-1][2])


# Instants of a start-up, s, and some of the interpreter's own, of which a package knows nothing.
INSTANTS = np.random.default_rng(28).uniform(0.0, 2.5, 20).round(3)


@pytest.mark.parametrize('instant', [*INSTANTS[:5], *in_depth(*INSTANTS[5:])])
def test_ctrl_c_while_it_starts_is_no_traceback(start, instant):
    process = start('-p', 'autostart:=false', watch=False)
    time.sleep(instant)
    process.signal(signal.SIGINT)
    code = process.wait()
    if 'Fatal Python error: init' in process.log or (code == -signal.SIGINT and not process.log):
        pytest.skip('Python itself was starting')
    assert code in (0, 130)
    assert 'Traceback' not in process.log and len(process.lines) < 10


@pytest.mark.parametrize('number', [signal.SIGINT, signal.SIGQUIT,
                                    *in_depth(signal.SIGTERM, signal.SIGHUP)])
def test_a_signal_while_it_imports_is_one_line(start, number):
    process = start('-p', 'autostart:=false', watch=False)
    maps = Path(f'/proc/{process.pid}/maps')
    until(lambda: 'multiarray' in maps.read_text(), 'numpy, the first to be imported')
    process.signal(number)
    assert process.wait() == 128 + number
    assert process.lines == ['generator: stopped']


# What is raised in a callback of the interpreter's own is dropped, as it is here.
DROPPED = """
import contextlib, os, signal, sys
from cpg_ros.ros import generator

class Starting(generator.Generator):
    def __init__(self):
        with contextlib.suppress(SystemExit):
            os.kill(os.getpid(), signal.SIGTERM)
        super().__init__()

generator.Generator = Starting
sys.exit(generator.main([]))
"""


def test_a_signal_whose_exception_is_dropped_while_it_starts_ends_it():
    variables = {**os.environ, 'ROS_DOMAIN_ID': str(free_domain())}
    done = subprocess.run([sys.executable, '-P', '-c', DROPPED], capture_output=True, text=True,
                          timeout=PATIENCE, env=variables)
    assert done.returncode == 0 and 'Traceback' not in done.stderr


def test_a_volley_of_signals_ends_it(start):
    # A launcher and a terminal signal the same process at once, each perhaps twice.
    process, _ = start('-p', 'rate:=200', '-p', 'ramp:=0.2', watch=True)
    while process.alive and 'ramping down' not in process.log:
        for number in (signal.SIGTERM, signal.SIGINT) * 200:
            process.signal(number)
    assert process.wait() == 0
    assert 'Traceback' not in process.log


def test_a_second_generator_in_another_namespace_is_left_alone(start):
    one, watcher = start('-p', 'rate:=200')
    two = start('-p', 'rate:=200', '-p', 'gait:=walk', '-r', '__ns:=/other', domain=one.domain,
                watch=False).wait_for('publishing')
    other = Watcher(one.domain, '/other/cpg_generator')
    until(lambda: other.gaits == ['walk'] and watcher.gaits == ['trot'], 'both gaits')
    other.record(1.5)
    assert watcher.set(gait='pace')[0].successful
    one.signal(signal.SIGTERM)
    assert one.wait() == 0
    _, positions, _ = other.record(0.5)
    assert off_grid([sample[0] for sample in other.samples], 0.005) < 1e-3
    assert np.ptp(positions, axis=0).max() > 0.2
    assert other.get('gait') == ['walk']
    assert two.alive
    other.end()


def test_the_watchdog_reports_and_puts_the_paper_model_back(start):
    # symmetry_gain 0 is the published model: rounding errors alone end its walk within some 30
    # strides.
    _, watcher = start('-p', 'rate:=200', '-p', 'gait:=walk', '-p', 'symmetry_gain:=0.0',
                       '-p', 'frequency:=8', '-p', 'amplitude:=0.5')
    until(lambda: any(s.level == DiagnosticStatus.ERROR for s in watcher.diagnostics), 'ERROR')
    error = next(s for s in watcher.diagnostics if s.level == DiagnosticStatus.ERROR)
    assert 're-seeded' in error.message
    until(lambda: watcher.diagnostics[-1].level != DiagnosticStatus.ERROR, 'the way back')
    watcher.record(0.5)
    positions = np.array([sample[1] for sample in watcher.samples])
    assert np.isfinite(positions).all()
    assert np.abs(np.diff(positions, axis=0)).max() <= 0.005 * 20 * 1.001
    assert np.ptp(positions[-60:], axis=0).max() > 0.2
    assert watcher.set(symmetry_gain=-1.0)[0].successful


def broken_goat(tmp_path, change):
    tree = yaml.safe_load((CONFIG / 'goat.yaml').read_text())
    change(tree)
    path = tmp_path / 'broken.yaml'
    path.write_text(yaml.safe_dump(tree))
    return path


def _joint(tree):
    return tree['legs']['lf']['joints'][0]


@pytest.mark.parametrize('change, key', [
    (lambda t: _joint(t).update(colour='red'), 'colour'),
    (lambda t: t['legs']['lf']['joints'].pop(0), 'lf_wrist_joint'),
    (lambda t: _joint(t).update(name='lh_toe_joint'), 'lh_toe_joint'),
    (lambda t: _joint(t).update(lower=1.0, upper=-1.0), 'lower'),
    (lambda t: _joint(t).update(velocity=float('inf')), 'velocity'),
])
def test_a_bad_robot_file_is_refused_at_start(tmp_path, change, key):
    path = broken_goat(tmp_path, change)
    reason = refused('-p', f'robot:={path}')
    assert str(path) in reason and key in reason and '\n' not in reason


@pytest.mark.parametrize('argument, reason', [
    ('gait:=gallop', "gait 'gallop' is not one of"),
    ('frequency:=fast', 'frequency must be a double'),
    ('delayed.tau:=0.1', 'critical delay 0.2852'),
    ('rate:=0.0', 'rate: 0.0 is not from 1 to 2000'),
    ('robot:=cow', "robot 'cow' is neither"),
    ('network:=brain', "network 'brain' is not one of"),
])
def test_a_bad_parameter_is_refused_at_start(argument, reason):
    assert reason in refused('-p', argument)


def test_what_is_refused_ends_the_process_in_one_line(start, tmp_path):
    path = broken_goat(tmp_path, lambda tree: _joint(tree).update(colour='red'))
    for argument, words in ((f'robot:={path}', 'colour'), ('rate:=0.0', 'is not from 1 to 2000')):
        process = start('-p', argument, watch=False)
        assert process.wait() == 1
        assert 'FATAL' in process.lines[-1] and words in process.lines[-1]
        assert 'Traceback' not in process.log

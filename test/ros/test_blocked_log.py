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

"""Nodes whose terminal is paused, whose pipe nobody reads, whose disk is full: they move on."""

import contextlib
import fcntl
import importlib.util
from itertools import product
import os
import pty
import signal
import subprocess
import sys
import threading
import time

from depth import in_depth
from diagnostic_msgs.msg import DiagnosticArray
from graph import EXECUTABLE, free_domain, Process, until, Watcher
import numpy as np
import pytest
from rcl_interfaces.msg import Log
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_srvs.srv import SetBool, Trigger
from unitree_faults import BRIDGE, Walk

KINDS = 'terminal', 'pipe', 'small pipe', 'full disk'
#: Seconds in which a node that ends must have ended.
END = 6.0


class Console:
    """Where a node writes; block() makes writing there wait or fail, unblock() ends that."""

    def __init__(self, kind):
        self.kind, self.text = kind, ''
        if kind == 'full disk':
            self.node = os.open('/dev/full', os.O_WRONLY)
            return
        self.own, self.node = pty.openpty() if kind == 'terminal' else os.pipe()
        if kind == 'small pipe':
            fcntl.fcntl(self.node, fcntl.F_SETPIPE_SZ, 4096)
        self._reading = threading.Event()
        self._reading.set()
        threading.Thread(target=self._read, daemon=True).start()

    def _read(self):
        with contextlib.suppress(OSError):
            while data := os.read(self.own, 1 << 16):
                self.text += data.decode()
                self._reading.wait()

    def block(self):
        if self.kind == 'terminal':
            os.write(self.own, b'\x13')  # Ctrl-S
        elif self.kind != 'full disk':
            self._reading.clear()
            # What is written next would wait; what another process writes is not made to.
            filling = subprocess.Popen(['cat', '/dev/zero'], stdout=self.node)
            time.sleep(0.5)
            filling.kill()
            filling.wait()

    def unblock(self):
        if self.kind == 'terminal':
            os.write(self.own, b'\x11')  # Ctrl-Q
        elif self.kind != 'full disk':
            self._reading.set()


@pytest.fixture(params=['terminal', 'full disk', *in_depth('pipe', 'small pipe')])
def console(request):
    console = Console(request.param)
    yield console
    console.unblock()
    os.close(console.node)


def ended(process):
    """Return the exit code; none if it is still there after END."""
    try:
        return process._process.wait(END)
    except subprocess.TimeoutExpired:
        return None


def test_a_generator_moves_on_and_ends_at_the_stand(console):
    process = Process('-p', 'rate:=200', '-p', 'ramp:=0.5', output=console.node)
    watcher = Watcher(process.domain)
    said = []
    watcher.node.create_subscription(
        Log, '/rosout', lambda message: said.append(message.msg),
        QoSProfile(depth=1000, durability=DurabilityPolicy.TRANSIENT_LOCAL))
    try:
        watcher.record(1.0)
        console.block()
        # More lines than a pipe holds: 64 kB.
        for _ in range(500):
            for gait in ('walk', 'trot'):
                assert watcher.set(gait=gait)[0].successful
        times, _, _ = watcher.record(1.0)
        assert np.median(np.diff(times)) == pytest.approx(0.005, abs=1e-4)
        # The graph hears what the console does not.
        count = len(said)
        assert watcher.set(gait='pace')[0].successful
        until(lambda: any(line.startswith('pace at') for line in said[count:]), '/rosout')
        for wanted in (False, True):
            assert watcher.call(SetBool, '/cpg_generator/enable',
                                SetBool.Request(data=wanted)).success
            until(lambda wanted=wanted: np.any(watcher.samples[-1][2]) == wanted, 'the ramp')
        watcher.record(1.0)
        process.signal(signal.SIGTERM)
        assert ended(process) == 0
        until(lambda: not np.any(watcher.samples[-1][2]), 'the last message, at rest')
        stand = {'hip': 0.0, 'thigh': 0.8, 'calf': -1.5}
        assert watcher.samples[-1][1] == pytest.approx(
            [stand[name.split('_')[1]] for name in watcher.names], abs=1e-9)
    finally:
        console.unblock()
        process.end()
        watcher.end()
    if console.kind != 'full disk':
        until(lambda: 'publishing 12 joints' in console.text and 'walk at' in console.text,
              'the log')
        assert 'Traceback' not in console.text


@pytest.mark.skipif(importlib.util.find_spec('unitree_go') is None
                    or importlib.util.find_spec('mujoco') is None,
                    reason="'make messages' has not been run, or the extra [sim] is not installed")
@pytest.mark.parametrize('number', [signal.SIGHUP, *in_depth(signal.SIGTERM)])
@pytest.mark.parametrize('console', ['terminal', *in_depth(*KINDS[1:])], indirect=True)
def test_a_bridge_sits_down(console, number):
    class Blocked(Walk):
        # It stands, which a shared machine can let it do.
        def start_generator(self):
            self.generator = Process('-p', 'autostart:=false', domain=self.domain)

        def start_bridge(self):
            self.bridge = Process(*self._parameters, domain=self.domain, executable=BRIDGE,
                                  output=console.node)

    walk = Blocked('rate:=200.0', 'state_timeout:=0.2')
    health = []
    walk.watcher.node.create_subscription(
        DiagnosticArray, '/diagnostics', lambda message: health.extend(
            status.name for status in message.status if 'unitree' in status.name), 10)
    try:
        for _ in range(10):
            until(lambda: walk.phase in ('standing', 'damping'), 'the stand')
            if walk.phase == 'standing':
                break
            # A shared machine stood still.
            walk.watcher.call(Trigger, '/unitree_bridge/start', Trigger.Request())
            until(lambda: walk.phase != 'damping' or not walk.robot.damped, 'the start')
            time.sleep(1.0)
        console.block()
        until(lambda: health, 'the health')
        walk.bridge.signal(number)
        assert ended(walk.bridge) == 0
        assert [phase for _, phase in walk.phases][-2:] == ['sitting', 'damping']
        assert walk.robot.damped
    finally:
        console.unblock()
        walk.end()


def run(code, output, **options):
    """Run Python code whose standard error and output go to a descriptor."""
    return subprocess.Popen([sys.executable, '-P', '-c', code], stdout=output, stderr=output,
                            **options)


STRAYS = """
import ctypes, sys, threading, warnings
from cpg_ros.ros.node.console import never_wait
never_wait('strays', [])
for k in range(3000):
    ctypes.CDLL(None).dprintf(2, b'%s\\n', b'from C' * 10)
    print('from Python' * 10)
    print('from Python' * 10, file=sys.stderr)
def fail():
    raise ValueError('x' * 1000)
for k in range(100):
    thread = threading.Thread(target=fail)
    thread.start()
    thread.join()
warnings.warn('a last word')
"""


@pytest.mark.parametrize('kind', KINDS)
def test_nothing_that_a_process_writes_makes_it_wait(kind):
    console = Console(kind)
    console.block()
    process = run(STRAYS, console.node)
    assert process.wait(60.0) == 0
    console.unblock()
    if kind != 'full disk':
        until(lambda: 'from Python' in console.text, 'what fitted')


@pytest.mark.parametrize('end', ['', 'raise SystemExit(0)', 'os._exit(0)', 'os.abort()',
                                 'os.kill(os.getpid(), 9)', 'raise ValueError'])
def test_what_is_written_before_an_end_comes_out(end):
    streams = 'stdout', 'stderr'
    lines = [f'line {k} of {stream}' for k in range(200) for stream in streams]
    code = ('import os, sys\nfrom cpg_ros.ros.node.console import never_wait\n'
            "never_wait('ending', [])\n"
            f'for line in {lines}:\n    print(line, file=getattr(sys, line.split()[-1]))\n{end}')
    read, write = os.pipe()
    process = run(code, write)
    os.close(write)
    with open(read) as stream:
        text = stream.read().splitlines()
    process.wait(60.0)
    for name in streams:
        assert ([line for line in text if line.endswith(name)]
                == [line for line in lines if line.endswith(name)])
    assert ('ValueError' in text) == (end == 'raise ValueError')


LOG = """
import sys
import rclpy
from rclpy.logging import get_logger

if sys.argv[1] == 'copied':
    from cpg_ros.ros.node.console import never_wait, STREAM_ARGUMENTS
    never_wait('name', sys.argv[2:])
    rclpy.init(args=[*sys.argv[2:], *STREAM_ARGUMENTS])
else:
    rclpy.init(args=sys.argv[2:])
logger = get_logger('some.name')
logger.debug('a {name} of\\ntwo lines')
logger.info('a {name} of\\ntwo lines')
logger.warning('a {name} of\\ntwo lines')
logger.error('a {name} of\\ntwo lines')
logger.fatal('a {name} of\\ntwo lines')
for k in range(3):
    logger.info('now and then', throttle_duration_sec=60.0)
    logger.warning('once', once=True)
    logger.info('not first', skip_first=True)
assert isinstance(logger.get_child('more').info('of a child'), bool)
rclpy.shutdown()
"""


WORDS = [[], ['--log-level', 'some.name:=debug'], ['--log-level', 'ERROR'],
         ['--disable-stdout-logs']]
FORMS = [None, '{severity} {time} {file_name}:{line_number} {message}',
         '{date_time_with_ms}\\t{name} {function_name} {none}']
ALL = list(product(WORDS, FORMS, (False, True)))
#: Each level, form and kind of output, and all kinds of pairs of the last two.
SOME = [(WORDS[0], FORMS[0], True), (WORDS[1], FORMS[1], True), (WORDS[2], FORMS[2], True),
        (WORDS[3], FORMS[0], False), (WORDS[0], FORMS[1], False), (WORDS[1], FORMS[2], False)]


@pytest.mark.parametrize(('words', 'form', 'terminal'), [
    *SOME, *in_depth(*(one for one in ALL if one not in SOME))])
def test_lines_look_as_those_of_rclpy(words, form, terminal, tmp_path):
    script = tmp_path / 'script.py'
    script.write_text(LOG)

    def lines(kind):
        own, other = pty.openpty() if terminal else os.pipe()
        environment = {**os.environ, 'ROS_LOG_DIR': str(tmp_path / kind)}
        if form is not None:
            environment['RCUTILS_CONSOLE_OUTPUT_FORMAT'] = form
        process = subprocess.Popen(
            [sys.executable, str(script), kind, *(['--ros-args', *words] if words else [])],
            stdout=other, stderr=other, env=environment)
        os.close(other)
        text = b''
        with contextlib.suppress(OSError):
            while data := os.read(own, 1 << 16):
                text += data
        assert process.wait() == 0
        file, = (tmp_path / kind).iterdir()
        return [normal(text.decode()), normal(file.read_text())]

    def normal(text):
        # The time differs.
        return ''.join('0' if one.isdigit() else one for one in text)

    native = lines('native')
    assert lines('copied') == native
    assert native[1] and bool(native[0]) == (words != ['--disable-stdout-logs'])


def test_a_paused_terminal_does_not_hold_up_the_end_of_a_start():
    console = Console('terminal')
    console.block()
    process = Process('-p', 'gait:=gallop_sideways', output=console.node)
    assert ended(process) in (1, None) and process._process.wait(60.0) == 1
    console.unblock()
    until(lambda: "gait 'gallop_sideways' is not one of" in console.text, 'the reason')


@pytest.mark.parametrize('name', ['generator', 'panel', *in_depth('inversion', 'robot_sim')])
def test_every_node_ends_though_its_terminal_is_paused(name):
    console = Console('terminal')
    words = ['-p', 'gait:=trot'] if name == 'generator' else []
    domain = free_domain()
    process = Process(*words, '-r', '__ns:=/blocked', domain=domain,
                      executable=EXECUTABLE.with_name(name), output=console.node)
    watcher = Watcher(domain)
    try:
        until(lambda: watcher.node.get_publishers_info_by_topic('/rosout'), 'the node')
        until(lambda: console.text, 'its first line')
        console.block()
        process.signal(signal.SIGTERM)
        assert ended(process) == 0
    finally:
        console.unblock()
        process.end()
        watcher.end()

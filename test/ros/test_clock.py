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

"""Time: simulated clocks that pause and jump, and system clocks that are set."""

import ctypes
import itertools
import re
import signal
import threading
import time
from types import SimpleNamespace

from cpg_ros.motion.robot_file import load_robot
from cpg_ros.ros.node.ticker import Ticker
from depth import in_depth
from graph import EXECUTABLE, off_grid, Process, SimulatedTime, until, Watcher
import numpy as np
import pytest
from std_srvs.srv import SetBool

#: Of every joint of the generic quadruped, rad/s.
LIMIT = 20.0


@pytest.fixture
def simulated(stepped):
    _, watcher = stepped('-p', 'rate:=100', '-p', 'frequency:=2', running=False)
    return watcher, SimulatedTime(watcher)


def settled(watcher):
    """Return the samples once no more of them come."""
    count = -1
    while count != len(watcher.samples):
        count = len(watcher.samples)
        time.sleep(0.3)
    return watcher.samples[:]


def test_simulated_time_sets_the_pace_and_pauses(simulated):
    watcher, clock = simulated
    assert settled(watcher) == [], 'nothing before the first /clock'
    clock.run(100.0, 103.0)
    samples = settled(watcher)
    stamps = np.array([sample[0] for sample in samples])
    assert off_grid(stamps, 0.01) < 1e-6
    assert stamps[-1] == pytest.approx(103.0, abs=0.02)
    assert len(stamps) >= 250
    # After a pause of wall time the pattern goes on where it stood.
    clock.run(103.0, 104.0)
    more = settled(watcher)
    positions = np.array([sample[1] for sample in more])
    assert off_grid([sample[0] for sample in more], 0.01) < 1e-6
    velocities = np.array([sample[2] for sample in more])
    assert np.abs(np.diff(positions, axis=0)).max() < 0.0105 * np.abs(velocities).max()


def check(samples, rate):
    """Hold each step between messages, that of one tick, against limits and velocities."""
    stamps, positions, velocities = map(np.array, zip(*samples, strict=True))
    steps = np.diff(positions, axis=0) * rate
    assert np.abs(steps).max() <= LIMIT * (1.0 + 1e-6)
    # A motion that starts anew does so at rest.
    anew = np.abs(np.diff(stamps) * rate - 1.0)[:, None] > 0.01
    before = np.where(anew, 0.0, velocities[:-1])
    low, high = np.minimum(before, velocities[1:]), np.maximum(before, velocities[1:])
    assert np.maximum(low - steps, steps - high).max() <= 0.05 * LIMIT
    return stamps, positions, velocities


def stand(watcher):
    robot = load_robot('quadruped')
    offsets = {joint.name: joint.offset for joint in robot.joints}
    return np.array([offsets[name] for name in watcher.names])


def test_a_jump_back_leads_to_the_stand_and_starts_again(simulated):
    watcher, clock = simulated
    clock.run(100.0, 102.5)
    before = len(settled(watcher))
    assert np.abs(watcher.samples[-1][2]).max() > 0.1
    clock.run(10.0, 14.0)
    samples = settled(watcher)
    stamps, positions, _ = check(samples, 100)
    after = stamps[before:], positions[before:]
    assert after[0][0] < 10.1 and off_grid(after[0], 0.01) < 1e-6
    # From where the joints were, through the stand, into the gait.
    assert np.abs(after[1][0] - positions[before - 1]).max() < 0.01
    assert np.abs(after[1][:150] - stand(watcher)).max(axis=1).min() < 0.01
    thigh = watcher.names.index('lh_thigh_joint')
    assert np.ptp(after[1][-100:, thigh]) == pytest.approx(0.5, abs=0.01)
    until(lambda: any('jumped back' in s.message for s in watcher.diagnostics), 'the warning')


def test_a_looped_clock(simulated):
    watcher, clock = simulated
    for _ in range(4):
        clock.run(20.0, 22.3)
    stamps, _, velocities = check(settled(watcher), 100)
    assert np.sum(np.diff(stamps) < 0.0) == 3
    assert np.abs(velocities).max() > 1.0


@pytest.mark.parametrize('turn', [1, 20])
def test_two_publishers_of_different_times(simulated, turn):
    watcher, clock = simulated
    clock.run(100.0, 102.5)
    for k in range(800):
        clock._tell((50.0 if k // turn % 2 else 102.5) + 0.005 * k)
        time.sleep(0.002)
    _, _, velocities = check(settled(watcher), 100)
    assert np.abs(velocities).max() > 1.0
    until(lambda: any(re.search('jumped back [0-9]+ times', s.message)
                      for s in watcher.diagnostics), 'the warning')


def test_jitter_of_the_clock_is_not_seen(simulated):
    watcher, clock = simulated
    rng = np.random.default_rng(5)
    for now in np.arange(100.0, 104.0, 0.002):
        clock._tell(now + rng.uniform(-0.04, 0.0))
        time.sleep(0.001)
    samples = settled(watcher)
    stamps, _, velocities = check(samples, 100)
    assert off_grid(stamps, 0.01) < 1e-6 and (np.diff(stamps) > 0.0).all()
    assert stamps[-1] == pytest.approx(104.0, abs=0.05) and len(stamps) > 250
    assert np.abs(velocities).max() > 1.0


@pytest.mark.parametrize('number', [signal.SIGTERM, *in_depth(signal.SIGINT)])
def test_a_stop_does_not_wait_for_a_clock_that_stands_still(start, number):
    process, watcher = start('-p', 'use_sim_time:=true', '-p', 'rate:=100', '-p', 'frequency:=2')
    SimulatedTime(watcher).run(100.0, 102.5)
    before = settled(watcher)
    assert np.abs(before[-1][2]).max() > 1.0, 'it freezes as the clock does'
    process.signal(number)
    assert process.wait() == 0
    stamps, positions, velocities = check(settled(watcher), 100)
    # Stamps go on from the last one; a busy machine leaves some out, and ends later.
    assert off_grid(stamps, 0.01) < 1e-6
    assert 0.4 < stamps[-1] - before[-1][0] < 1.2
    assert np.abs(positions[-1] - stand(watcher)).max() < 1e-6
    assert np.abs(velocities[-1]).max() < 1e-6


def test_disabled_and_enabled_again_while_the_clock_stands_still(simulated):
    watcher, clock = simulated
    clock.run(100.0, 102.5)

    def enable(enabled):
        return watcher.call(SetBool, '/cpg_generator/enable', SetBool.Request(data=enabled))

    settled(watcher)
    assert enable(False).success
    until(lambda: np.abs(np.array(watcher.samples[-1][1]) - stand(watcher)).max() < 1e-6,
          'the stand')
    standing = len(settled(watcher))
    # A start waits for the clock, and goes by it.
    assert enable(True).success
    assert len(settled(watcher)) == standing
    clock.run(102.5, 105.0)
    stamps, positions, _ = check(settled(watcher), 100)
    assert stamps[standing] == pytest.approx(102.5, abs=0.05)
    assert np.ptp(positions[-100:, watcher.names.index('lh_thigh_joint')]
                  ) == pytest.approx(0.5, abs=0.01)
    # Also where nothing has moved since.
    assert enable(False).success
    until(lambda: np.abs(np.array(watcher.samples[-1][1]) - stand(watcher)).max() < 1e-6,
          'the stand')
    check(settled(watcher), 100)


def test_a_stop_between_two_clocks(start):
    process, watcher = start('-p', 'use_sim_time:=true', '-p', 'rate:=100', '-p', 'frequency:=2')
    clock = SimulatedTime(watcher)
    clock.run(100.0, 102.5)
    process.signal(signal.SIGTERM)
    for k in itertools.count():
        if not process.alive:
            break
        clock._tell(102.5 + 0.01 * k)
        time.sleep(0.002)
        clock._tell(50.0 + 0.01 * k)
        time.sleep(0.002)
    assert process.wait() == 0
    _, positions, _ = check(settled(watcher), 100)
    # Beside two clocks a busy machine may not come to the very end of the ramp in time.
    assert np.abs(positions[-1] - stand(watcher)).max() < 0.02


def test_a_stop_before_the_first_time(start):
    process = start('-p', 'use_sim_time:=true', watch=False).wait_for('publishing')
    process.signal(signal.SIGINT)
    assert process.wait() == 0


def test_a_long_jump_forward_is_not_run_through(simulated):
    watcher, clock = simulated
    clock.run(100.0, 102.0)
    before = len(settled(watcher))
    clock.run(500.0, 501.0)
    after = settled(watcher)
    assert len(after) - before < 250
    positions = np.array([sample[1] for sample in after])
    assert np.abs(np.diff(positions, axis=0)).max() < 0.01 * 6.0
    assert after[-1][0] == pytest.approx(501.0, abs=0.02)


@pytest.mark.parametrize(('executable', 'node', 'args'), [
    ('generator', 'cpg_generator', []), *in_depth(
        ('inversion', 'cpg_inversion', []),
        ('robot_sim', 'robot_sim', ['-p', 'robot:=unitree_go2']))])
def test_use_sim_time_is_set_at_start(executable, node, args):
    process = Process(*args, executable=EXECUTABLE.with_name(executable))
    watcher = Watcher(process.domain, f'/{node}')
    try:
        for refused in (watcher.set(use_sim_time=True)[0],
                        watcher.set_together(use_sim_time=True)):
            assert not refused.successful
            assert refused.reason == 'use_sim_time is read-only: set it when the node starts'
        assert watcher.get('use_sim_time') == [False]
    finally:
        watcher.end()
        process.end()
    assert process.wait() == 0


def test_a_set_system_clock_shows_in_the_stamps_alone():
    # The machine's clock is not ours to set: the ticker runs against one that is.
    offset = [0]
    told = ctypes.CFUNCTYPE(ctypes.c_int64)(lambda: offset[0])
    ticks: list = []
    done = threading.Event()

    def tick(dt, stamp):
        ticks.append((time.monotonic(), dt, stamp - offset[0]))
        if len(ticks) == 100:
            offset[0] = -3600 * 10**9
        if len(ticks) == 200:
            offset[0] = 86400 * 10**9
        if len(ticks) == 300:
            done.set()

    failures: list = []
    steady = SimpleNamespace(ros_time_is_active=False)
    ticker = Ticker(SimpleNamespace(get_clock=lambda: steady), 500.0, tick, None, failures.append)
    ticker.loop.offset = ctypes.cast(told, ctypes.c_void_p).value
    began = time.monotonic()
    ticker.start()
    assert done.wait(60.0)
    ticker.end()
    ticker.join()
    assert not failures
    # Resumed by nobody, it makes up for what a loaded machine costs it.
    assert ticker.dropped == 0
    times, spans, stamps = (np.array(part) for part in zip(*ticks[:300], strict=True))
    # Every tick spans one period and belongs to its own deadline on the steady clock.
    assert spans == pytest.approx(0.002)
    assert np.diff(stamps) == pytest.approx(2e6, abs=5e5)
    assert times[-1] - began >= 0.6 - 0.01

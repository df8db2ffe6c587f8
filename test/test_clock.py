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

import threading
import time
from types import SimpleNamespace

from cpg_ros.nodes import deadline_thread as ticker_module
from graph import off_grid, SimulatedTime
import numpy as np
import pytest


@pytest.fixture
def simulated(start):
    _, watcher = start('-p', 'use_sim_time:=true', '-p', 'rate:=100', '-p', 'frequency:=2')
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


def test_a_jump_back_starts_again_from_the_stand(simulated):
    watcher, clock = simulated
    clock.run(100.0, 102.5)
    before = len(settled(watcher))
    moving = watcher.samples[-1]
    clock.run(10.0, 12.5)
    after = settled(watcher)[before:]
    stamps = np.array([sample[0] for sample in after])
    assert stamps[0] < 10.1 and off_grid(stamps, 0.01) < 1e-6
    thigh = watcher.names.index('lh_thigh_joint')
    # A ramp from the stand, as at the start, not a leap into the gait.
    assert abs(after[0][1][thigh] - 0.8) < 0.005
    assert np.ptp([sample[1][thigh] for sample in after[-100:]]) == pytest.approx(0.5, abs=0.01)
    assert np.any(np.abs(moving[2]) > 0.1)


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


def test_simulated_time_can_be_turned_on_and_off_live(start):
    _, watcher = start('-p', 'rate:=100', '-p', 'frequency:=2')
    watcher.record(1.2)
    assert watcher.set(use_sim_time=True)[0].successful
    before = len(settled(watcher))
    SimulatedTime(watcher).run(50.0, 51.0)
    assert len(settled(watcher)) - before >= 70
    assert watcher.samples[-1][0] == pytest.approx(51.0, abs=0.02)
    assert watcher.set(use_sim_time=False)[0].successful
    times, positions, _ = watcher.record(1.0)
    assert times[0] > 1e9 and off_grid(times, 0.01) < 1e-3
    assert np.abs(np.diff(positions, axis=0)).max() < 0.01 * 6.0


def test_a_set_system_clock_shows_in_the_stamps_alone(monkeypatch):
    # The machine's clock is not ours to set: the ticker runs against one that is.
    offset = [0]
    clocks = SimpleNamespace(monotonic_ns=time.monotonic_ns, sleep=time.sleep,
                             time_ns=lambda: time.monotonic_ns() + offset[0])
    monkeypatch.setattr(ticker_module, 'time', clocks)
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
    steady = SimpleNamespace(ros_time_is_active=False,
                             create_jump_callback=lambda *_, **__: None)
    ticker = ticker_module.Ticker(SimpleNamespace(get_clock=lambda: steady), 500.0, tick, None,
                                  failures.append)
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

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

"""A generator that was stopped goes on where it stood, slowed in, as its receivers see it."""

from pathlib import Path
import signal
import time

from cpg_ros.motion.pattern import Pattern
from cpg_ros.motion.plan import plan
from cpg_ros.motion.robot_file import load_robot
from cpg_ros.networks.registry import PRESETS
from depth import in_depth
from diagnostic_msgs.msg import DiagnosticStatus
from graph import until
import numpy as np
import pytest
from rclpy.qos import QoSProfile
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

#: Of every joint of the generic quadruped, rad/s.
LIMIT = 20.0


def stop(process, seconds):
    """Stop a process for some time of the wall clock, which is what it is tested against."""
    process.signal(signal.SIGSTOP)
    state = Path(f'/proc/{process.pid}/stat')
    until(lambda: state.read_text().rsplit(')')[1].split()[0] == 'T', 'a stop')
    time.sleep(seconds)
    process.signal(signal.SIGCONT)
    return time.monotonic()


def heard(watcher, kind, topic, angles):
    """Return the rows (s, rad ...) of a topic as they arrive, by the receiver's clock."""
    rows = []
    watcher.node.create_subscription(
        kind, topic, lambda message: rows.append((time.monotonic(), *angles(message))),
        QoSProfile(depth=5000))
    until(rows.__len__, topic)
    return rows


@pytest.mark.parametrize(('rate', 'seconds'), [(200, 0.2), *in_depth((100, 0.5), (100, 1.5))])
def test_what_was_missed_is_not_run_through(start, rate, seconds):
    process, watcher = start('-p', f'rate:={rate}', '-p', 'frequency:=2', '-p', 'ramp:=0.2',
                             '-p', 'command:=forward_position', '-p', 'assume_stand:=true')
    commands = heard(watcher, Float64MultiArray, 'forward_position_controller/commands',
                     lambda message: message.data)
    states = heard(watcher, JointState, 'lh/joint_states', lambda message: message.position)
    watcher.record(1.0)
    again = stop(process, seconds)
    watcher.record(1.5)
    for rows in map(np.array, (commands, states)):
        times, angles = rows[:, 0], rows[:, 1:]
        after = np.flatnonzero(times >= again)[0]
        # Two at once at most; over 8 periods, as a reader is late at times, too.
        assert np.sum(times[after:] < times[after] + 8.0 / rate) <= 10
        # Two ticks together are no more than a period's motion; what a reader loses takes time.
        steps = np.abs(np.diff(angles, axis=0))
        allowed = LIMIT * (np.diff(times) + 1.0 / rate)
        assert (steps[after - 1:] <= allowed[after - 1:, None]).all()
        # A tick that it was stopped in is sent now. Then on from where it stood, at rest at
        # first: seen over 8 periods, within the limit.
        after += steps[after - 1].max() >= 1e-3 * LIMIT
        assert steps[after - 1:after + 1].max() < 1e-3 * LIMIT
        gone = np.abs(angles[after:] - angles[after - 1])[:8].max(axis=1)
        assert (gone <= LIMIT * (times[after:after + 8] - times[after - 1])).all()
        # Later the gait is as it was.
        assert np.ptp(angles[-rate:], axis=0).max() == pytest.approx(0.5, abs=0.01)
    stamps = np.array([sample[0] for sample in watcher.samples])
    gaps = np.diff(stamps) * rate
    assert np.abs(gaps - np.round(gaps)).max() < 0.1, 'stamps leave their grid'
    until(lambda: any(s.level == DiagnosticStatus.WARN and 'ticks dropped' in s.message
                      for s in watcher.diagnostics), 'the warning')


@pytest.mark.parametrize('stalls', [[0.5], [0.02], [0.003], [0.3, 0.3], [0.5, 0.004]])
def test_positions_and_velocities_go_on_together(stalls):
    robot, dt = load_robot('quadruped'), 0.002
    preset = PRESETS['delayed']['trot']
    pattern = Pattern(plan(robot, 'trot', preset, preset.network, 2.0), ramp=0.2)
    for _ in range(400):
        pattern.advance(dt)
    usual = pattern.plan.speed.max()
    for stall in stalls:
        pattern.resume(stall)
        rows = [(pattern.position.copy(), pattern.velocity.copy())]
        for _ in range(60):
            pattern.advance(dt)
            rows.append((pattern.position.copy(), pattern.velocity.copy()))
        positions, velocities = map(np.array, zip(*rows, strict=True))
        mean = 0.5 * (velocities[2:] + velocities[1:-1])
        assert np.abs(np.diff(positions, axis=0)[1:] / dt - mean).max() < 0.01 * usual
        if stall >= 0.1:
            assert np.abs(velocities[1]).max() < 0.01 * usual
    for _ in range(1000):
        pattern.advance(dt)
    assert np.ptp(pattern.velocity) > 0.0 and not pattern.held

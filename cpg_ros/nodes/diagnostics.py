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

"""The generator's health, once a second on /diagnostics."""

from collections.abc import Callable
from typing import Any

from cpg_ros.motion.pattern import Pattern
from cpg_ros.nodes.cmd_vel import CmdVel
from cpg_ros.nodes.deadline_thread import Ticker
from cpg_ros.nodes.feedback_switch import FeedbackSwitch
from cpg_ros.nodes.health_publisher import Health, HealthPublisher
from cpg_ros.nodes.log_queue import QUEUE
from cpg_ros.nodes.other_publishers import OtherPublishers
from diagnostic_msgs.msg import DiagnosticStatus
from rclpy.node import Node

#: Time between two warnings of jumps of simulated time in the log, s.
QUIET = 5.0


class Diagnostics:
    """Reports ERROR on a fault until the pattern is back, and on other publishers and joints that
    do not follow; else WARN.

    A warning is for lateness, and for silence: what is not published is not OK.
    """

    def __init__(self, node: Node, pattern: Pattern, ticker: Ticker, others: OtherPublishers,
                 cmd_vel: CmdVel | None, feedback: FeedbackSwitch,
                 awaited: Callable[[], str], lag: Callable[[], str]) -> None:
        self._lag = lag
        self._feedback, self._awaited = feedback, awaited
        self._node, self._pattern, self._ticker = node, pattern, ticker
        self._others, self._cmd_vel = others, cmd_vel
        self._before = self._counts()
        self._silent = 0
        self._publisher = HealthPublisher(node, 'pattern', pattern.robot.name, self._status)

    def _counts(self) -> dict[str, int]:
        ticker, pattern = self._ticker, self._pattern
        return {'ticks': ticker.ticks, 'late ticks': ticker.late,
                'dropped ticks': ticker.dropped, 'jumps back of simulated time': ticker.jumps,
                'watchdog re-seeds': pattern.faults, 'ticks held by limits': pattern.held}

    def _status(self) -> Health:
        """Return the status of the last second."""
        counts, before, pattern = self._counts(), self._before, self._pattern
        self._before = counts
        new = {key: counts[key] - before[key] for key in counts}
        program = pattern.program
        self._silent = 0 if new['ticks'] and not self._ticker.paused else self._silent + 1
        misfit = self._cmd_vel.look_for_misfits() if self._cmd_vel else ''
        if new['watchdog re-seeds'] or pattern.recovering:
            level, text = DiagnosticStatus.ERROR, 'the network left its orbit and was re-seeded'
            if program.gain == 0.0:
                text += ' (symmetry_gain is 0: no gait is stable)'
        elif self._others.text:
            level, text = DiagnosticStatus.ERROR, self._others.text
        elif lag := self._lag():
            level, text = DiagnosticStatus.ERROR, lag
        elif new['jumps back of simulated time']:
            level = DiagnosticStatus.WARN
            text = self._why_anew(new['jumps back of simulated time'])
            self._node.get_logger().warning(text, throttle_duration_sec=QUIET)
        elif self._silent > 1.0 / self._ticker.rate:
            level, text = DiagnosticStatus.WARN, f'nothing is published: {self._why_silent()}'
        elif 100 * new['dropped ticks'] > new['ticks']:
            level, text = DiagnosticStatus.WARN, f'{new["dropped ticks"]} ticks dropped'
        elif misfit:
            level, text = DiagnosticStatus.WARN, misfit
        elif self._feedback.out:
            level, text = DiagnosticStatus.WARN, f'no feedback: {self._feedback.out}'
        elif new['ticks held by limits'] and not self._feedback.active:
            level, text = DiagnosticStatus.WARN, 'a joint limit held the pattern back'
        elif 100 * new['late ticks'] > new['ticks']:
            level, text = DiagnosticStatus.WARN, f'{new["late ticks"]} late ticks'
        else:
            level, text = DiagnosticStatus.OK, self._state()
        values: dict[str, object] = {
            'gait': program.name, 'character': program.character, 'state': self._state(),
            'network': program.orbit.network.name,
            'frequency [Hz]': f'{program.frequency:.6g}',
            'period [model time]': f'{program.orbit.period:.8g}',
            'symmetry gain [1/model time]': f'{program.gain:.4g}',
            'rate wanted [Hz]': f'{self._ticker.rate:.6g}', 'ticks in the last second':
            new['ticks'], **counts,
            'worst delay of a tick [ms]': f'{1e3 * self._ticker.worst:.3f}',
            'log lines dropped': QUEUE.dropped}
        if self._cmd_vel:
            values['cmd_vel'] = self._cmd_vel.state
        values |= self._feedback.state(1e-9 * self._node.get_clock().now().nanoseconds)
        return level, text, values

    def _why_anew(self, jumps: int) -> str:
        publishers = self._node.count_publishers('/clock')
        text = ('simulated time jumped back: starting again from the stand' if jumps == 1 else
                f'simulated time jumped back {jumps} times in a second')
        if publishers > 1:
            text += f'; /clock has {publishers} publishers, stop all but one'
        return text

    def _why_silent(self) -> str:
        clock: Any = self._node.get_clock()
        now = clock.now().nanoseconds
        if self._ticker.waiting:
            return f'waiting for {self._awaited()}'
        if not clock.ros_time_is_active:
            return f'no tick for {self._silent} s'
        return f'simulated time is still {1e-9 * now:.3f} s' if now else 'no /clock yet'

    def _state(self) -> str:
        pattern = self._pattern
        if self._ticker.waiting:
            return f'waiting for {self._awaited()}'
        if pattern.standing:
            return 'standing'
        if pattern.level < 1.0:
            return 'ramping up' if pattern.enabled else 'ramping down'
        return 'changing gait' if pattern.in_transition else 'running'

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

"""The bridge to Unitree's robots beside a stand-in robot at 500 Hz: lateness, age, CPU, memory.

Beside it runs a loop that does nothing, as often and at the same priority: how late the machine
itself is. Where a machine stands still for longer than a robot may be left alone, the bridge
stops; that is counted, and it is started again.

usage: bench_unitree.py [--seconds 600]
"""

import argparse
from pathlib import Path
import subprocess
import sys
import tempfile
import time

from common import emit, log, ROOT
import numpy as np
from processes import enter_workspace, Process

sys.path.append(str(ROOT / 'test' / 'support'))
BRIDGE = [str(ROOT / 'install/cpg_ros/lib/cpg_ros/unitree_bridge')]
PERIOD = 0.002
#: The first hip swings by so much a command, rad, there and back in so many of them.
STEP, BACK = 1e-4, 1000


def swing(k: np.ndarray | int) -> np.ndarray:
    """Angle of the first hip in the k-th command, rad."""
    return STEP * (np.abs((np.asarray(k) + BACK // 2) % BACK - BACK // 2) - BACK // 4)


def command(domain: int, times: Path, stand: list[float]) -> None:
    """Publish targets every period, and note when: the process of its own that is a generator."""
    import rclpy
    from rclpy.signals import SignalHandlerOptions
    from std_msgs.msg import Float64MultiArray
    rclpy.init(domain_id=domain, signal_handler_options=SignalHandlerOptions.NO)
    node = rclpy.create_node('targets')
    publisher = node.create_publisher(Float64MultiArray,
                                      'forward_position_controller/commands', 1)
    noted = np.memmap(times, float, 'r+')
    message, due = Float64MultiArray(data=stand), time.monotonic()
    for k in range(len(noted)):
        due += PERIOD
        time.sleep(max(0.0, due - time.monotonic()))
        message.data[0] = float(swing(k))
        noted[k] = time.monotonic()
        publisher.publish(message)


def idle(times: Path) -> None:
    """Wake up every period, and note how late, s: what the machine itself takes."""
    late = np.memmap(times, float, 'r+')
    due = time.monotonic()
    for k in range(len(late)):
        due += PERIOD
        time.sleep(max(0.0, due - time.monotonic()))
        late[k] = time.monotonic() - due


def ages(noted: np.ndarray, arrivals: np.ndarray) -> np.ndarray:
    """Seconds between the sending of a target and the arrival of the command made of it."""
    found, last = [], 0
    for at, angle in arrivals:
        while last + 1 < len(noted) and 0.0 < noted[last + 1] <= at:
            last += 1
        back = np.arange(max(0, last - 60), last + 1)
        found.append(at - noted[back[np.abs(swing(back) - angle)[::-1].argmin() * -1 - 1]])
    return np.array(found)


class Following:
    """Keeps the bridge following for some time, and notes when it did."""

    def __init__(self, bridge: Process, domain: int) -> None:
        self._bridge, self._domain = bridge, domain
        self.stretches: list[tuple[float, float]] = []
        self.stops: list[str] = []

    def last(self, seconds: float) -> None:
        """Watch over it, and start it again when it has stopped."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            self._bridge.wait_for('following', len(self.stops) + 1)
            time.sleep(3.0)
            began = time.monotonic()
            while time.monotonic() < end and (
                    self._bridge.output.count('damping:') == len(self.stops)):
                time.sleep(0.5)
            if time.monotonic() < end:
                self.stops.append(self._bridge.output.splitlines()[-1].rpartition('damping: ')[2])
                log(f'stopped, started again: {self.stops[-1]}')
                self._start()
            self.stretches.append((began, time.monotonic() - 2.0))

    def _start(self) -> None:
        from graph import Watcher
        from std_srvs.srv import Trigger
        watcher = Watcher(self._domain, '/unitree_bridge')
        time.sleep(2.0)
        answer = watcher.call(Trigger, '/unitree_bridge/start', Trigger.Request())
        watcher.end()
        if not answer.success:
            raise RuntimeError(answer.message)


def late_percent(gaps: np.ndarray) -> float:
    """Share of periods that are late by a period or more."""
    return 100.0 * float((gaps > 2.0 * PERIOD).mean())


def measure(seconds: float) -> None:
    """Stand, follow for some time, and tell what was seen."""
    from graph import free_domain, until
    from stand_in import StandIn
    domain, robot = free_domain(), None
    with tempfile.NamedTemporaryFile() as file, tempfile.NamedTemporaryFile() as idling, Process(
            ['env', f'ROS_DOMAIN_ID={domain}', *BRIDGE, '--ros-args', '-p',
             'command:=forward_position', '-p', 'motion_switcher:=false']) as bridge:
        np.zeros(round((2.0 * seconds + 60.0) / PERIOD)).tofile(file.name)
        np.zeros(round(seconds / PERIOD)).tofile(idling.name)
        robot = StandIn(domain)
        robot.start()
        stand = [str(angle) for angle in robot.body.stand]
        targets = subprocess.Popen([sys.executable, __file__, '--command', str(domain),
                                    file.name, *stand])
        loop = subprocess.Popen([sys.executable, __file__, '--idle', idling.name])
        following = Following(bridge, domain)
        try:
            bridge.wait_for('following')
            log(f'following for {seconds:g} s')
            cpu, memory, began = bridge.cpu_s(), bridge.resident_mb(), time.monotonic()
            following.last(seconds)
            spent = time.monotonic() - began
            cpu, memory = bridge.cpu_s() - cpu, (memory, bridge.resident_mb())
            noted = np.fromfile(file.name)
        finally:
            targets.terminate()
            loop.terminate()
            bridge.end()
            until(lambda: robot.damped, 'damping')
            robot.end()
        late = np.fromfile(idling.name)
        rows = [(part := robot.since(start))[part[:, 0] < end]
                for start, end in following.stretches]
        gaps = np.concatenate([np.diff(part[:, 0]) for part in rows])
        age = np.concatenate([ages(noted, part[:, [0, 5]]) for part in rows])
        emit(benchmark='unitree', seconds=spent, wrong_sums=robot.wrong, stops=following.stops,
             followed_s=sum(end - start for start, end in following.stretches),
             longest_s=max(end - start for start, end in following.stretches),
             late_percent=late_percent(gaps),
             sender_late_percent=late_percent(np.diff(noted[noted > 0.0])),
             idle_loop_late_percent=100.0 * float((late > PERIOD).mean()),
             idle_loop_latest_ms=1e3 * float(late.max()),
             watchdog_commands=sum(int((part[:, 1] == 0.0).sum()) for part in rows),
             gap_ms={f'p{p}': 1e3 * float(np.percentile(gaps, p)) for p in (50, 99, 99.9)},
             age_ms={f'p{p}': 1e3 * float(np.percentile(age, p)) for p in (50, 99, 99.9)},
             cpu_percent=100.0 * cpu / spent, memory_mb=memory)


def main() -> None:
    """Measure, or be the sender of targets."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--seconds', type=float, default=600.0)
    parser.add_argument('--command', nargs='+', help=argparse.SUPPRESS)
    parser.add_argument('--idle', help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.idle:
        idle(Path(given.idle))
        return
    if given.command:
        domain, times, *stand = given.command
        command(int(domain), Path(times), [float(angle) for angle in stand])
        return
    enter_workspace()
    measure(given.seconds)


if __name__ == '__main__':
    main()

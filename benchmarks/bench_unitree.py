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

sys.path.append(str(ROOT / 'test'))
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


def ages(noted: np.ndarray, arrivals: np.ndarray) -> np.ndarray:
    """Seconds between the sending of a target and the arrival of the command made of it."""
    found, last = [], 0
    for at, angle in arrivals:
        while last + 1 < len(noted) and 0.0 < noted[last + 1] <= at:
            last += 1
        back = np.arange(max(0, last - 60), last + 1)
        found.append(at - noted[back[np.abs(swing(back) - angle)[::-1].argmin() * -1 - 1]])
    return np.array(found)


def measure(seconds: float) -> None:
    """Stand, follow for some time, and tell what was seen."""
    from graph import free_domain, until
    from stand_in import StandIn
    domain, robot = free_domain(), None
    with tempfile.NamedTemporaryFile() as file, Process(
            ['env', f'ROS_DOMAIN_ID={domain}', *BRIDGE, '--ros-args', '-p',
             'command:=forward_position', '-p', 'motion_switcher:=false']) as bridge:
        np.zeros(round((seconds + 30.0) / PERIOD)).tofile(file.name)
        robot = StandIn(domain)
        robot.start()
        stand = [str(angle) for angle in robot.body.stand]
        targets = subprocess.Popen([sys.executable, __file__, '--command', str(domain),
                                    file.name, *stand])
        try:
            bridge.wait_for('following')
            time.sleep(3.0)
            log(f'following for {seconds:g} s')
            cpu, memory, began = bridge.cpu_s(), bridge.resident_mb(), time.monotonic()
            held = True
            while time.monotonic() < began + seconds and held:
                time.sleep(1.0)
                held = 'damping' not in bridge.output
            spent = time.monotonic() - began
            if not held:
                log(bridge.output.splitlines()[-1])
            cpu, memory = bridge.cpu_s() - cpu, (memory, bridge.resident_mb())
            noted = np.fromfile(file.name)
        finally:
            targets.terminate()
            bridge.end()
            until(lambda: robot.damped, 'damping')
            robot.end()
        rows = robot.since(began)
        rows = rows[rows[:, 0] < began + spent]
        gaps = np.diff(rows[:, 0])
        age = ages(noted, rows[:, [0, 5]])
        sending = np.diff(noted[noted > 0.0])
        emit(benchmark='unitree', seconds=spent, held=held, wrong_sums=robot.wrong,
             commands_hz=len(rows) / spent,
             late_percent=100.0 * float((gaps > 2.0 * PERIOD).mean()),
             watchdog_commands=int((rows[:, 1] == 0.0).sum()),
             sender_late_percent=100.0 * float((sending > 2.0 * PERIOD).mean()),
             gap_ms={f'p{p}': 1e3 * float(np.percentile(gaps, p)) for p in (50, 99, 99.9)},
             age_ms={f'p{p}': 1e3 * float(np.percentile(age, p)) for p in (50, 99, 99.9)},
             cpu_percent=100.0 * cpu / spent, memory_mb=memory)


def main() -> None:
    """Measure, or be the sender of targets."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--seconds', type=float, default=600.0)
    parser.add_argument('--command', nargs='+', help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.command:
        domain, times, *stand = given.command
        command(int(domain), Path(times), [float(angle) for angle in stand])
        return
    enter_workspace()
    measure(given.seconds)


if __name__ == '__main__':
    main()

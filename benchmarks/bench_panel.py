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

"""What a page costs the robot, and what it gives: the panel beside a generator and robot_sim.

Period: one generator at 1 kHz, by turns alone, with a page open, with the page closed, and with
the panel's process stopped (SIGSTOP); no tick may be lost, and p99 of the period be within the
noise of the run alone. Frames: robot_sim at 500 Hz with and without a bare websocket client.
Clicks: from the socket to ~/gait, 50 of them. Hostile: 500 requests. Memory: of the panel with a
page open. The page is a bare websocket client in a process of its own: software rendering is not
what people have.
"""

import argparse
import json
import os
import re
import signal
import statistics
import subprocess
import sys
import time

from common import emit, log, ROOT
import numpy as np
from processes import enter_workspace, Listener, Process, start_node
import rclpy
from rclpy.qos import DurabilityPolicy, QoSProfile
from std_msgs.msg import String
from websockets.exceptions import WebSocketException
from websockets.sync.client import connect

PANEL = [str(ROOT / 'install/cpg_ros/lib/cpg_ros/panel')]
SIM = [str(ROOT / 'install/cpg_ros/lib/cpg_ros/robot_sim')]
TARGETS = {'lost_ticks': 0, 'frames_a_second_min': 20.0, 'real_time_factor_min': 0.99,
           'click_ms_median': 100.0, 'memory_growth_percent': 5.0}
#: A page: counts frames, prints the count at its end.
PAGE = """
import sys, time
from websockets.sync.client import connect
frames, first, last = 0, None, None
try:
    with connect(sys.argv[1], max_size=None, compression=None) as page:
        print('open', flush=True)
        for text in page:
            if text.startswith('{"type": "frame"'):
                frames += 1
                last = time.monotonic()
                first = first or last
except KeyboardInterrupt:
    pass
print('frames', frames, (frames - 1) / (last - first) if frames > 1 else 0.0, flush=True)
"""
HOSTILE = ['', '{', '[' * 4000, 'null', '{"do":"set","name":"rate","value":NaN}', '"x"',
           '{"do":"set","name":"gait","value":"gallop"}', '{"do":"exec"}', b'\x00\xff',
           'x' * 70000]


class Panel(Process):
    """The panel on a free port, and the address of its socket."""

    def __init__(self) -> None:
        super().__init__(PANEL, port=0)
        self.wait_for('in a browser: http')
        self.socket = 'ws' + re.search(r'http(://\S+)', self.output)[1] + 'socket'

    def page(self) -> subprocess.Popen:
        page = subprocess.Popen([sys.executable, '-c', PAGE, self.socket], text=True,
                                stdout=subprocess.PIPE)
        page.stdout.readline()
        return page


def close(page: subprocess.Popen) -> tuple[int, float]:
    """Close a page; return its frames, and how many a second."""
    page.send_signal(signal.SIGINT)
    words = page.communicate(timeout=10)[0].split()
    return int(words[1]), float(words[2])


def period(seconds: float) -> dict[str, np.ndarray | int]:
    """Listen to joint_states; return the gaps in us between publications, and what was lost."""
    with Listener(seconds) as listener:
        record, health = listener.record()
    lost = int(np.sum(np.diff(record['sequence']) - 1))
    return {'gaps': np.diff(record['source']) * 1e-3, 'lost': lost,
            'dropped': int(health[-1]['dropped ticks']) - int(health[0]['dropped ticks'])}


def periods(rounds: int, seconds: float) -> dict[str, dict[str, float]]:
    """Measure the period of a generator at 1 kHz by turns."""
    found: dict[str, list] = {name: [] for name in ('alone', 'open', 'closed', 'stopped')}
    with start_node('generator', rate=1000.0):
        for k in range(rounds):
            log(f'period, round {k + 1} of {rounds}')
            found['alone'].append(period(seconds))
            with Panel() as panel:
                page = panel.page()
                time.sleep(2.0)
                found['open'].append(period(seconds))
                panel.signal(signal.SIGSTOP)
                found['stopped'].append(period(seconds))
                panel.signal(signal.SIGCONT)
                close(page)
                time.sleep(1.0)
                found['closed'].append(period(seconds))
    result = {}
    for name, parts in found.items():
        gaps = np.concatenate([part['gaps'] for part in parts])
        result[name] = {**{f'p{q:g}_us': float(np.percentile(gaps, q)) for q in (50, 99, 99.9)},
                        'p99_us_by_round': [float(np.percentile(part['gaps'], 99))
                                            for part in parts],
                        'ticks': len(gaps), 'dropped': sum(part['dropped'] for part in parts),
                        'lost': sum(part['lost'] for part in parts)}
    return result


def simulated(seconds: float, paged: bool) -> dict[str, float]:
    """Run robot_sim beside a generator in real time; with a page, count its frames."""
    with Process(SIM, rate=500.0, duration=seconds + 30.0) as sim, start_node(
            'generator', robot='unitree_go2', rate=500.0, combined_topic="''") as _, (
            Panel() if paged else Process(['sleep', '1000'])) as panel:
        page = panel.page() if paged else None
        time.sleep(3.0)
        began, spent = sim_time(), panel.cpu_s()
        time.sleep(seconds)
        then, cpu = sim_time(), panel.cpu_s() - spent
        result = {'real_time_factor': (then[0] - began[0]) / (then[1] - began[1]),
                  'panel_cpu_percent': 100.0 * cpu / seconds}
        if page:
            result['frames_a_second'] = close(page)[1]
        assert sim.alive
        return result


def sim_time() -> tuple[float, float]:
    """Return how long robot_sim has simulated, and the time when it said so, s."""
    from diagnostic_msgs.msg import DiagnosticArray
    node, seen = rclpy.create_node('asker'), []

    def hear(message: DiagnosticArray) -> None:
        for status in message.status:
            if 'simulation' in status.name:
                values = {value.key: value.value for value in status.values}
                stamp = message.header.stamp
                seen.append((float(values['simulated time [s]']),
                             stamp.sec + 1e-9 * stamp.nanosec))

    node.create_subscription(DiagnosticArray, '/diagnostics', hear, 10)
    while not seen:
        rclpy.spin_once(node, timeout_sec=1.0)
    node.destroy_node()
    return seen[-1]


def clicks(panel: Panel, count: int) -> dict[str, float]:
    """Ask for gaits over the socket; how long until ~/gait says so, ms."""
    node, heard = rclpy.create_node('clicker'), []
    node.create_subscription(
        String, 'cpg_generator/gait', lambda m: heard.append((m.data, time.monotonic())),
        QoSProfile(depth=10, durability=DurabilityPolicy.TRANSIENT_LOCAL))
    times = []
    with connect(panel.socket, max_size=None) as page:
        while '"controls"' not in page.recv():
            pass
        stamp = None
        while not heard:
            rclpy.spin_once(node, timeout_sec=0.1)
        for k in range(count):
            while stamp is None or time.monotonic() - stamp > 0.1:
                stamp = json.loads(page.recv(timeout=1.0)).get('stamp', stamp)
            gait, began = ('walk', 'trot', 'pace')[k % 3], time.monotonic()
            page.send(json.dumps({'do': 'set', 'name': 'gait', 'value': gait, 'stamp': stamp}))
            while heard[-1][0] != gait and time.monotonic() < began + 5.0:
                rclpy.spin_once(node, timeout_sec=0.1)
            if heard[-1][0] == gait:
                times.append(1e3 * (heard[-1][1] - began))
            while time.monotonic() < began + 0.3:
                page.recv(timeout=1.0)
    node.destroy_node()
    return {'count': count, 'lost': count - len(times), 'median_ms': statistics.median(times),
            'longest_ms': max(times)}


def hostile(panel: Panel, count: int) -> dict[str, object]:
    """Send what no page would; is the node alive, and what does it hold, MB."""
    before = panel.resident_mb()
    for k in range(count):
        try:
            with connect(panel.socket, max_size=None) as page:
                page.send(HOSTILE[k % len(HOSTILE)])
                for _ in range(200 if k % 50 == 0 else 0):
                    page.send('{"do":"alive"}')
                page.recv(timeout=1.0)
        except (WebSocketException, OSError, TimeoutError):
            continue
    time.sleep(2.0)
    return {'requests': count, 'alive': panel.alive, 'before_mb': before,
            'after_mb': panel.resident_mb()}


def memory(panel: Panel, seconds: float) -> dict[str, float]:
    """Watch the panel's memory with a page open, MB."""
    page = panel.page()
    time.sleep(10.0)
    start, held = panel.resident_mb(), []
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        held.append(panel.resident_mb())
        time.sleep(1.0)
    frames, rate = close(page)
    return {'seconds': seconds, 'frames': frames, 'frames_a_second': rate, 'start_mb': start,
            'end_mb': held[-1], 'most_mb': max(held),
            'growth_percent': 100.0 * (held[-1] / start - 1.0)}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument('--rounds', type=int, default=3)
    parser.add_argument('--seconds', type=float, default=8.0, help='of each turn')
    parser.add_argument('--memory', type=float, default=120.0, help='seconds with a page open')
    args = parser.parse_args()
    enter_workspace()
    os.environ.pop('DISPLAY', None)
    rclpy.init()
    result: dict[str, object] = {'period': periods(args.rounds, args.seconds)}
    log('robot_sim without and with a page')
    result['simulation'] = {'alone': simulated(2 * args.seconds, False),
                            'page': simulated(2 * args.seconds, True)}
    with start_node('generator', rate=200.0, transition=0.2), Panel() as panel:
        log('clicks')
        result['clicks'] = clicks(panel, 50)
        log('500 hostile requests')
        result['hostile'] = hostile(panel, 500)
        log(f'memory, {args.memory:g} s')
        result['memory'] = memory(panel, args.memory)
    rclpy.shutdown()
    emit(benchmark='panel', **result, targets=TARGETS)


if __name__ == '__main__':
    main()

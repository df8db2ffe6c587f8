"""How fast a generator at 1 kHz answers a gait switch and a signal, beside the null node.

All 30 ordered pairs of gaits through the real parameter service, half a second apart, each a new
orbit to solve or remember; the null node answers the same calls with a parameter that does
nothing. Then SIGINT and SIGTERM: how long until the process is gone, ramp included, and its code.
"""

import itertools
import random
import signal
import statistics
import time

import rclpy
from client import ParameterClient, text
from common import emit, log
from processes import Process, enter_workspace, start_node

from cpg_ros.networks.delayed import GAITS

TARGETS = {'answer_ms_max': 100.0, 'end_s_max': 1.0}


def answers(node: Process, values: list[str], parameter: str) -> dict[str, float]:
    """Set a parameter to one value after the other; times of the answers in ms."""
    client = ParameterClient({'gait': 'cpg_generator'}.get(parameter, 'null_node'))
    for value in values:
        (result,) = client.set([text(parameter, value)], atomically=False)
        if not result.successful:
            raise RuntimeError(f'{parameter} {value}: {result.reason}')
        time.sleep(0.5)
    times = client.answer_ms['set_parameters']
    client.node.destroy_node()
    return {'median': statistics.median(times), 'max': max(times)}


def ending(kind: str, number: int) -> dict[str, float]:
    """Start a node, let it run, signal it; seconds until it is gone, and its exit code."""
    with start_node(kind, rate=1000.0) as node:
        time.sleep(3.0)
        began = time.monotonic()
        node.signal(number)
        code = node.wait()
        return {'s': time.monotonic() - began, 'code': code}


def main() -> None:
    enter_workspace()
    rclpy.init()
    pairs = list(itertools.permutations(GAITS, 2))
    random.Random(0).shuffle(pairs)
    with start_node('generator', rate=1000.0, transition=0.4) as node:
        log('30 ordered pairs of gaits')
        ours = answers(node, [gait for pair in pairs for gait in pair], 'gait')
    with start_node('null', rate=1000.0) as node:
        log('the null node')
        null = answers(node, ['a', 'b'] * 15, 'nothing')
    rclpy.shutdown()
    log('signals')
    signals = {f'{kind} {name.name}': ending(kind, name)
               for kind in ('generator', 'null') for name in (signal.SIGINT, signal.SIGTERM)}
    ends = [value for key, value in signals.items() if key.startswith('generator')]
    emit(benchmark='services', pairs=len(pairs), answer_ms=ours, answer_ms_null=null,
         signals=signals, targets=TARGETS,
         passed=ours['max'] <= TARGETS['answer_ms_max'] and all(
             end['s'] <= TARGETS['end_s_max'] and end['code'] == 0 for end in ends))


if __name__ == '__main__':
    main()

"""How fast a generator at 1 kHz answers a gait switch and a signal, beside the null node.

All ordered pairs of each network's gaits through the real parameter service, half a second apart;
the null node answers the same calls with a parameter that does nothing. Then SIGINT and SIGTERM:
how long until the process is gone, ramp included, and its code.
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

from cpg_ros.networks.registry import NETWORKS, PRESETS

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
    ours = {}
    for network, kind in NETWORKS.items():
        gaits = [name for name, preset in PRESETS[network].items() if name == preset.gait]
        pairs = list(itertools.permutations(gaits, 2))
        random.Random(0).shuffle(pairs)
        with start_node('generator', rate=1000.0, transition=0.4, network=network,
                        robot=kind.usual_robot) as node:
            log(f'{network}: {len(pairs)} ordered pairs of gaits')
            ours[network] = answers(node, [gait for pair in pairs for gait in pair], 'gait')
            ours[network]['pairs'] = len(pairs)
    with start_node('null', rate=1000.0) as node:
        log('the null node')
        null = answers(node, ['a', 'b'] * 15, 'nothing')
    rclpy.shutdown()
    log('signals')
    signals = {f'{kind} {name.name}': ending(kind, name)
               for kind in ('generator', 'null') for name in (signal.SIGINT, signal.SIGTERM)}
    ends = [value for key, value in signals.items() if key.startswith('generator')]
    emit(benchmark='services', answer_ms=ours, answer_ms_null=null,
         signals=signals, targets=TARGETS,
         passed=all(each['max'] <= TARGETS['answer_ms_max'] for each in ours.values()) and all(
             end['s'] <= TARGETS['end_s_max'] and end['code'] == 0 for end in ends))


if __name__ == '__main__':
    main()

"""The executables: each loads what it runs, and can be interrupted while it does."""

import os
import signal
import sys
from functools import partial
from importlib import import_module
from types import FrameType

#: Executable -> module whose ``main`` it runs.
PLACES = {'generator': 'nodes.generator', 'robot_sim': 'nodes.robot_sim',
          'unitree_bridge': 'nodes.unitree.bridge', 'panel': 'panel.panel_node', **{
    name: f'tools.{name}' for name in ('inversion', 'cpg', 'demo', 'analyze', 'check_robot',
                                       'optimize', 'reproduce', 'tune', 'calibrate', 'atlas')}}


def start(name: str) -> int:
    """Run an executable on the words of the command line; return its exit code."""
    def leave(number: int, _: FrameType | None) -> None:
        # An exception amid the loading of compiled code would become another error there.
        print(f'{name}: stopped', file=sys.stderr, flush=True)
        os._exit(128 + number)

    before = signal.signal(signal.SIGINT, leave)
    main = import_module(f'cpg_ros.{PLACES[name]}').main
    signal.signal(signal.SIGINT, before)
    return main()


(generator, robot_sim, unitree_bridge, panel, inversion, cpg, demo, analyze, check_robot,
 optimize, reproduce, tune, calibrate, atlas) = (partial(start, name) for name in PLACES)

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

"""The executables: each loads what it runs, and can be interrupted while it does."""

from importlib import import_module
import os
import signal
import sys
from types import FrameType
from typing import NoReturn

#: The signals by which users, terminals and launch files end a process.
ENDINGS = signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT
#: Executable -> module whose ``main`` it runs.
PLACES = {'generator': 'nodes.generator', 'robot_sim': 'nodes.robot_sim',
          'unitree_bridge': 'nodes.unitree.bridge', 'panel': 'panel.panel_node',
          **{name: f'tools.{name}'
             for name in ('inversion', 'cpg', 'demo', 'analyze', 'check_robot', 'optimize',
                          'reproduce', 'tune', 'calibrate', 'atlas')}}


def start(name: str) -> int:
    """Run an executable on the words of the command line; return its exit code."""
    def leave(number: int, _: FrameType | None = None) -> NoReturn:
        # An exception amid the loading of compiled code would become another error there.
        print(f'{name}: stopped', file=sys.stderr, flush=True)
        os._exit(128 + number)

    heeded = [number for number in ENDINGS if signal.getsignal(number) != signal.SIG_IGN]
    for number in heeded:
        signal.signal(number, leave)
    main = import_module(f'cpg_ros.{PLACES[name]}').main
    try:
        for number in heeded:
            signal.signal(number, signal.default_int_handler if number == signal.SIGINT
                          else signal.SIG_DFL)
        code: int = main()
    except KeyboardInterrupt:
        # What it runs has not begun to handle it.
        return leave(signal.SIGINT)
    return code


def generator() -> int:
    """Run the executable generator; return its exit code."""
    return start('generator')


def robot_sim() -> int:
    """Run the executable robot_sim; return its exit code."""
    return start('robot_sim')


def unitree_bridge() -> int:
    """Run the executable unitree_bridge; return its exit code."""
    return start('unitree_bridge')


def panel() -> int:
    """Run the executable panel; return its exit code."""
    return start('panel')


def inversion() -> int:
    """Run the executable inversion; return its exit code."""
    return start('inversion')


def cpg() -> int:
    """Run the executable cpg; return its exit code."""
    return start('cpg')


def demo() -> int:
    """Run the executable demo; return its exit code."""
    return start('demo')


def analyze() -> int:
    """Run the executable analyze; return its exit code."""
    return start('analyze')


def check_robot() -> int:
    """Run the executable check_robot; return its exit code."""
    return start('check_robot')


def optimize() -> int:
    """Run the executable optimize; return its exit code."""
    return start('optimize')


def reproduce() -> int:
    """Run the executable reproduce; return its exit code."""
    return start('reproduce')


def tune() -> int:
    """Run the executable tune; return its exit code."""
    return start('tune')


def calibrate() -> int:
    """Run the executable calibrate; return its exit code."""
    return start('calibrate')


def atlas() -> int:
    """Run the executable atlas; return its exit code."""
    return start('atlas')

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

"""The executables: each loads its module, and can be interrupted while it does."""

from collections.abc import Callable
from functools import partial
from importlib import import_module
import os
from pathlib import Path
import signal
import sys
from types import FrameType
from typing import NoReturn

from cpg_ros.errors import MissingLibraryError, needed

#: The signals by which users, terminals and launch files end a process.
ENDINGS = signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT
#: Where an installation of ROS lists its packages.
INDEX = 'share/ament_index/resource_index/packages'
#: Executable -> module whose ``main`` it runs.
EXECUTABLES = {'generator': 'nodes.generator', 'robot_sim': 'nodes.robot_sim',
               'unitree_bridge': 'nodes.unitree.bridge', 'servo_bridge': 'nodes.servos.bridge',
               'servo_bus': 'nodes.servos.bus', 'panel': 'panel.panel_node',
               **{name: f'tools.{name}'
                  for name in ('inversion', 'cpg', 'demo', 'analyze', 'check_robot', 'optimize',
                               'reproduce', 'tune', 'calibrate', 'atlas', 'record_dataset',
                               'export')}}
#: What does with kernels in plain Python, and steps in C; for the others that is far too slow.
WITHOUT_NUMBA = ('generator', 'export', 'unitree_bridge', 'check_robot')


def command(name: str) -> list[str]:
    """Return the words that run an executable in a process of its own, whatever installed it."""
    return [sys.executable, '-P', '-m', 'cpg_ros.tools.executables', name]


def start(name: str) -> int:
    """Run an executable on the words of the command line; return its exit code."""
    def leave(number: int, _: FrameType | None = None) -> NoReturn:
        # An exception while compiled code loads would become another error there.
        print(f'{name}: stopped', file=sys.stderr, flush=True)
        os._exit(128 + number)

    # Nodes handle SIGINT also where a script starts them in the background, as launch files may.
    before = {number: signal.signal(number, leave) for number in ENDINGS
              if number != signal.SIGHUP or signal.getsignal(number) != signal.SIG_IGN}
    # ROS from wheels finds its parts below the environment that they were installed into.
    if (Path(sys.prefix) / INDEX / 'cpg_ros').exists():
        os.environ.setdefault('AMENT_PREFIX_PATH', sys.prefix)
    try:
        main = import_module(f'cpg_ros.{EXECUTABLES[name]}').main
        if 'cpg_ros.integration.jit' in sys.modules and name not in WITHOUT_NUMBA:
            needed('numba')
    except MissingLibraryError as error:
        print(f'{name}: {error}', file=sys.stderr)
        return error.exit_code
    try:
        for number, handler in before.items():
            signal.signal(number, signal.default_int_handler if callable(handler) else handler)
        code: int = main()
    except KeyboardInterrupt:
        # The tool does not handle the signal yet.
        return leave(signal.SIGINT)
    return code


def __getattr__(name: str) -> Callable[[], int]:
    """Return the function that runs an executable, for the entry points of setup.py."""
    if name in EXECUTABLES:
        return partial(start, name)
    raise AttributeError(f'module {__name__!r} has no attribute {name!r}')


if __name__ == '__main__':
    raise SystemExit(start(sys.argv.pop(1)))

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

"""The executables; each loads its module, and can be interrupted meanwhile."""

from collections.abc import Callable
from functools import partial
from importlib import import_module
import os
from pathlib import Path
import signal
import sys
from types import FrameType
from typing import NoReturn

from cpg_ros.common.errors import MissingLibraryError, needed

#: The signals by which users, terminals and launch files end a process.
TERMINATION_SIGNALS = signal.SIGINT, signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT
#: Executable -> module whose ``main`` it runs.
EXECUTABLES = {'generator': 'ros.generator', 'robot_sim': 'ros.robot_sim',
               'unitree_bridge': 'ros.bridges.unitree.bridge',
               'servo_bridge': 'ros.bridges.servos.bridge', 'servo_bus': 'ros.bridges.servos.bus',
               'panel': 'ros.panel.panel_node', 'inversion': 'ros.cli.inversion',
               'cpg': 'ros.cli.cpg', 'demo': 'ros.cli.demo', 'analyze': 'analysis.analyze',
               'check_robot': 'simulation.robot_setup.check_robot',
               'optimize': 'analysis.optimize', 'reproduce': 'analysis.papers.reproduce',
               'tune': 'simulation.tuning.tune', 'calibrate': 'simulation.robot_setup.calibrate',
               'atlas': 'analysis.atlas.atlas',
               'export': 'motion.export.export'}
#: WITHOUT_NUMBA: executables that also run without numba, with kernels in plain Python and steps
#: in C; for the others these are far too slow.
WITHOUT_NUMBA = ('generator', 'export', 'unitree_bridge', 'check_robot')


def command(name: str) -> list[str]:
    """Return the words that run an executable in a process of its own, however it is installed."""
    return [sys.executable, '-P', '-m', 'cpg_ros.ros.cli.executables', name]


def start(name: str) -> int:
    """Run an executable with the arguments of the command line; return its exit code."""
    def leave(number: int, _: FrameType | None = None) -> NoReturn:
        # An exception while compiled code loads would become another error there.
        print(f'{name}: stopped', file=sys.stderr, flush=True)
        os._exit(128 + number)

    # Nodes handle SIGINT also where a script starts them in the background, as launch files may.
    before = {number: signal.signal(number, leave) for number in TERMINATION_SIGNALS
              if number != signal.SIGHUP or signal.getsignal(number) != signal.SIG_IGN}
    # ROS from wheels finds its parts below the environment that they were installed into.
    if Path(sys.prefix, 'share/ament_index/resource_index/packages/cpg_ros').exists():
        os.environ.setdefault('AMENT_PREFIX_PATH', sys.prefix)
    try:
        main = import_module(f'cpg_ros.{EXECUTABLES[name]}').main
        if 'cpg_ros.dynamics.integration.compilation' in sys.modules and name not in WITHOUT_NUMBA:
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

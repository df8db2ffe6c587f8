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

"""Compile the kernels for which the first start of a generator would otherwise wait.

``make build`` runs it once for each installation: networks in C, and the feedback of robots with
point feet and with soles by numba. The rest is compiled on first use.
"""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
import os
import subprocess
import sys
import time

from cpg_ros.common.command_line import say
from cpg_ros.dynamics.integration.compilation import COMPILED
from cpg_ros.feedback.kinematics import geometry_of
from cpg_ros.motion.core import precompile
from cpg_ros.motion.robot_file import load_robot
from cpg_ros.networks.registry import NETWORKS

#: The networks of the shipped robots.
SHIPPED = (*NETWORKS, 'delayed6')
#: Parts that are compiled, those of the demonstration first.
PARTS = ('networks', *(('feedback', 'balance') if COMPILED else ()))
#: ROBOT: robot for which the feedback is compiled; BIPED: robot for which balance is compiled.
#: Their kernels are the same for every robot with such legs.
ROBOT, BIPED = 'unitree_go2', 'humanoid'


def compile_part(part: str) -> None:
    """Compile or load one network or all, the feedback, or the balance of a biped."""
    if part == 'feedback':
        # It loads numba.
        from cpg_ros.feedback.by_address import warm_up
        robot = load_robot(ROBOT)
        warm_up(geometry_of(robot), len(robot.joints))
    elif part == 'balance':
        from cpg_ros.feedback.by_address import warm_up_balance
        warm_up_balance(load_robot(BIPED))
    else:
        for network in SHIPPED if part == 'networks' else [part]:
            precompile(network)


def compile_parts(parts: Sequence[str]) -> None:
    """Compile parts in one process each, as many at once as there are cores."""
    began = time.monotonic()
    say(f'compiling the numerical kernels, so that no start waits for it: {", ".join(parts)} '
        '(a minute on two fast cores)')

    def compiled(part: str) -> None:
        code = subprocess.run([sys.executable, '-P', '-m', __spec__.name, part],
                              check=False).returncode
        say(f'  {time.monotonic() - began:3.0f} s  {part}'
            + (f' failed with exit code {code}' if code else ''))

    with ThreadPoolExecutor(os.cpu_count()) as threads:
        list(threads.map(compiled, parts))


def main(arguments: Sequence[str] | None = None) -> int:
    """Compile the given parts, or all; return the exit code."""
    parts = (sys.argv[1:] if arguments is None else arguments) or PARTS
    if len(parts) == 1:
        compile_part(parts[0])
    else:
        compile_parts(parts)
    return 0


if __name__ == '__main__':
    sys.exit(main())

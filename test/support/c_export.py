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

"""Exports of gaits, compiled by the system's compiler and run."""

from dataclasses import replace
from functools import cache
from pathlib import Path
import shutil
import subprocess

from cpg_ros.common.errors import CpgError
from cpg_ros.motion.export.c_project import CProject
from cpg_ros.motion.export.gait_data import CFormat, GaitData
from cpg_ros.motion.plan import plan
from cpg_ros.motion.robot import Joint, Robot
from cpg_ros.motion.robot_file import load_robot
from cpg_ros.networks.registry import find_network
import pytest

GCC = shutil.which('gcc')
STRICT = ('-std=c99', '-O2', '-Wall', '-Wextra', '-Wconversion', '-Wdouble-promotion',
          '-pedantic', '-Werror', '-fsanitize=undefined,address', '-fno-sanitize-recover=all')
#: A Python float is one of float64: both sides hear the same.
TOLERANCES = {'float32': 1e-4, 'float64': 1e-9}

needs_gcc = pytest.mark.skipif(GCC is None, reason='gcc is not installed')


def eight_legs():
    """Return a robot of eight legs with a joint each."""
    network = find_network('delayed8')
    legs = {leg: (Joint(f'{leg}_hip', leg, cells[0], 0.1, (0.3, 0.05), -1.0, 1.0, 10.0),)
            for leg, cells in network.legs['implicit'].items()}
    return Robot('octopod', ('delayed8', 'phase8'), 'implicit', 3, legs,
                 tuple(joint.name for leg in legs.values() for joint in leg))


@cache
def plans(robot, network, gaits=()):
    """Return plans of gaits, or of all presets that can run."""
    robot = eight_legs() if robot == 'octopod' else load_robot(robot)
    presets, found = find_network(network).presets(), []
    for name in gaits or presets:
        preset = presets[name]
        own = robot.motion(name, preset.gait).frequency
        try:
            found.append(plan(robot, name, preset, preset.network, 1.0 if own is None else own))
        except CpgError:
            if gaits:
                raise
    return found


def data_of(made, form='network', real='float64', tolerance=None, step=None, steering=False):
    """Return the constants of plans."""
    return GaitData([replace(one, step=step) for one in made],
                    CFormat(form, real, tolerance or TOLERANCES[real], steering))


def project_of(data, substep=0.001):
    """Return the files of constants."""
    return CProject(data, 'a test', substep)


def compiled(folder, data, golden=None, shim='', options=STRICT, substep=0.001):
    """Write and compile an export with its test, or with a main of one's own; return the path."""
    folder = Path(folder)
    files = project_of(data, substep).files(golden)
    if shim:
        files['test_cpg.c'] = shim
    for name, text in files.items():
        (folder / name).write_text(text)
    done = subprocess.run([GCC, *options, 'cpg.c', 'gait_data.c', 'test_cpg.c', '-lm', '-o',
                           'test_cpg'], cwd=folder, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr[:2000]
    return folder / 'test_cpg'


def output(plan, *arguments):
    """Run a program; return what it prints."""
    done = subprocess.run([plan, *map(str, arguments)], capture_output=True, text=True,
                          timeout=300)
    assert done.returncode == 0, done.stdout + done.stderr[:2000]
    return done.stdout

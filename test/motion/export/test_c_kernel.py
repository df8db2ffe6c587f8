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

"""The exported C in real time takes the steps of simulations, with numba and without."""

import os
from pathlib import Path
import subprocess
import sys

from c_export import GCC, needs_gcc
from cpg_ros.common import c_library
from cpg_ros.common.c_library import NoCompiler
from cpg_ros.dynamics.integration.simulate import simulate
from cpg_ros.dynamics.integration.stepper import Stepper
from cpg_ros.dynamics.solve_orbit import solve_orbit
from cpg_ros.motion.pattern import Pattern
from cpg_ros.motion.plan import plan
from cpg_ros.motion.robot_file import load_robot
from cpg_ros.networks.registry import find_network, SHIPPED
from depth import in_depth
import numpy as np
import pytest

SEED = 3535


@needs_gcc
@pytest.mark.parametrize('network', ['delayed', 'biped', 'hopf',
                                     *in_depth('quadruped', 'matsuoka', 'phase', 'delayed6')])
def test_steps_in_real_time_are_those_of_simulations(network):
    """From the same history, locked, with delays and coefficients of their own in all lanes."""
    draws, networks, starts = np.random.default_rng(SEED), [], []
    for preset in find_network(network).presets().values():
        own = preset.network
        networks.append(own.replace(**{own.delay_parameter: own.delay * draws.uniform(1.0, 2.0)})
                        if own.delay else own)
        starts.append(0.3 * draws.uniform(-1.0, 1.0, own.components))
    symmetry = networks[0].symmetry(networks[0].gaits()[0])
    for gain in (0.0, 1.3):
        runs = simulate(networks, np.array(starts), 60 * own.step, own.step, lock=(gain, symmetry))
        for one, start, x in zip(networks, starts, runs.x, strict=True):
            stepper = Stepper(one, start, gain=gain, symmetry=symmetry)
            single = simulate(one, start, 60 * own.step, own.step, lock=(gain, symmetry))
            for states in x[1:]:
                stepper.advance(own.step)
                assert np.abs(stepper.newest() - states).max() < 1e-12
            assert np.abs(single.x - x).max() < 1e-12


@needs_gcc
def test_a_compiler_that_is_missing_or_fails_is_one_line(monkeypatch, tmp_path):
    monkeypatch.setenv('NUMBA_CACHE_DIR', str(tmp_path))
    broken = tmp_path / 'broken'
    broken.write_text('#!/bin/sh\necho "error: no disk" >&2\nexit 1\n')
    broken.chmod(0o755)
    for compiler, line in (('missing-cc', "CC names, 'missing-cc', is not installed"),
                           (broken, 'cannot make the kernels .* no disk')):
        monkeypatch.setenv('CC', str(compiler))
        found = without_numba("""
from cpg_ros.networks.registry import find_network
from cpg_ros.dynamics.integration.stepper import Stepper
import sys
network = find_network('delayed').presets()['trot'].network
try:
    Stepper(network, [0.1] * network.components)
except Exception as error:
    sys.exit(f'{type(error).__name__}: {error}')""")
        assert found.returncode == 1 and found.stderr.startswith(NoCompiler.__name__)
        assert subprocess.run(['grep', '-qE', line], input=found.stderr, text=True
                              ).returncode == 0, found.stderr
        assert found.stderr.count('\n') == 1


def test_the_wheel_of_zig_compiles_where_the_system_has_no_compiler(monkeypatch):
    monkeypatch.delenv('CC', raising=False)
    monkeypatch.setattr(c_library.shutil, 'which', lambda _: None)
    monkeypatch.setattr(c_library, 'find_spec', lambda name: name == 'ziglang')
    assert c_library.compiler() == [sys.executable, '-m', 'ziglang', 'cc']
    monkeypatch.setattr(c_library, 'find_spec', lambda _: None)
    with pytest.raises(NoCompiler, match=r'cc, gcc, clang.* apt install gcc, or pip install zig'):
        c_library.compiler()


def without_numba(text, *arguments):
    return subprocess.run(
        [sys.executable, '-P', '-c', f'import sys; sys.modules["numba"] = None\n{text}',
         *arguments], capture_output=True, text=True, check=False)


WALK = """
from cpg_ros.motion.pattern import Pattern
from cpg_ros.motion.plan import plan
from cpg_ros.networks.registry import find_network
from cpg_ros.motion.robot_file import load_robot
robot, network, duty = load_robot(sys.argv[1]), find_network(sys.argv[2]), float(sys.argv[3])
plans = []
for name, preset in network.presets().items():
    try:
        plans.append(plan(robot, name, preset, preset.network, 1.0, duty=duty))
        print(name, repr(plans[-1].orbit.period), end=' ')
    except CpgError:
        pass
print()
pattern = Pattern(plans[0], 0.1)
for tick in range(900):
    if tick == 200:
        pattern.apply(plans[1], 0.3)
    if tick == 800:
        pattern._tracks[-1].stepper.disturb(float('nan'))
    pattern.advance(0.002)
    print(*map(repr, pattern.position.tolist()), end=' ')
print(pattern.faults)
"""


@needs_gcc
@pytest.mark.parametrize('robot, network, duty', [
    ('quadruped', 'delayed', 0.0), ('quadruped', 'quadruped', 0.6),
    *in_depth(('quadruped', 'delayed', 0.6), ('biped', 'biped', 0.0), ('quadruped', 'hopf', 0.0),
              ('quadruped', 'matsuoka', 0.0), ('quadruped', 'phase', 0.0))])
def test_all_gaits_walk_without_numba_as_they_do_with_it(robot, network, duty):
    """Every preset is solved for; a fade, and a network whose state is lost, are the same."""
    found = without_numba(WALK, robot, network, str(duty))
    assert found.returncode == 0, found.stderr
    periods, positions = found.stdout.splitlines()
    *positions, faults = positions.split()
    names = periods.split()[::2]
    presets, the_robot = find_network(network).presets(), load_robot(robot)
    plans = [plan(the_robot, name, presets[name], presets[name].network, 1.0, duty=duty)
             for name in names]
    assert len(names) >= 2
    for one, period in zip(plans, periods.split()[1::2], strict=True):
        assert float(period) == pytest.approx(one.orbit.period, rel=1e-9)
    pattern, wanted = Pattern(plans[0], 0.1), []
    for tick in range(900):
        if tick == 200:
            pattern.apply(plans[1], 0.3)
        if tick == 800:
            pattern._tracks[-1].stepper.disturb(float('nan'))
        pattern.advance(0.002)
        wanted.append(pattern.position.copy())
    off = np.abs(np.array(positions, float).reshape(900, -1) - wanted).max()
    print(f'\n| {robot}, {network}, duty {duty:g} | {off:.1e} rad |')
    assert off < 1e-9 and int(faults) == pattern.faults == 1


def test_every_network_is_made_in_c_and_solved_by_it():
    """The orbit that C's steps lead to has the period of the one that is solved for."""
    for name, network in SHIPPED.items():
        preset = next(iter(network.presets().values()))
        orbit = solve_orbit(preset.network, preset.gait)
        stepper = Stepper(preset.network, orbit, gain=1.0, symmetry=orbit.symmetry)
        stepper.advance(3.0 * orbit.period)
        assert stepper.now[0] == pytest.approx(orbit(np.array(0.0)), abs=1e-4 * np.abs(
            orbit.levels).max()), name


SANITIZERS = '-fsanitize=address,undefined', '-fno-sanitize-recover=all'
STORY = """
import sys
import test_core
test_core.tell(sys.argv[1], float(sys.argv[2]), 1)
"""


@needs_gcc
@pytest.mark.deep
@pytest.mark.parametrize('network, duty', [('delayed', 0.55), ('quadruped', 0.6)])
def test_the_core_stays_within_its_memory(tmp_path, network, duty):
    """Compiled with checks of addresses and of what C does not define."""
    here = Path(__file__).parents[1]
    checks = subprocess.run([GCC, '-print-file-name=libasan.so'], capture_output=True, text=True,
                            check=True).stdout.strip()
    told = subprocess.run(
        [sys.executable, '-P', '-c', STORY, network, str(duty)], capture_output=True, text=True,
        env={**os.environ, 'CC': ' '.join((GCC, *SANITIZERS)), 'NUMBA_CACHE_DIR': str(tmp_path),
             'LD_PRELOAD': checks, 'ASAN_OPTIONS': 'detect_leaks=0',
             'PYTHONPATH': ':'.join((
                 str(here), str(here.parent / 'support'), os.environ.get('PYTHONPATH', '')))})
    assert told.returncode == 0, told.stderr[-2000:]
    assert 'pattern-' in ' '.join(map(str, tmp_path.rglob('*.so')))
